"""Everything about a scene that stays constant during a run: bodies over flat arrays, and tools."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from lcmchain.compilation.processor import aligned
from lcmchain.effects.contact_depth import depth_control, gap_left, pressure_in_gap
from lcmchain.effects.face_pressure import (
    FacePressure,
    PressureOnFace,
    RegionalPressure,
    build_face_pressure,
    build_regional_pressure,
)
from lcmchain.effects.fibre_bending import (
    FORCE_ROWS,
    FibreBending,
    build_fibre_bending,
    frequency_bound,
)
from lcmchain.effects.grippers import Grip, Gripper, GripperTable, gripper_table, grips_of
from lcmchain.effects.pore_pressure import PoreColumns
from lcmchain.effects.pressures import pressures_of
from lcmchain.effects.process.mass_scaling import weight_per_inertia, with_added_mass
from lcmchain.effects.process.pace import PaceLaw, pace_law
from lcmchain.effects.supports import Support, SupportTable, build_supports
from lcmchain.elements.blocks import EMPTY_ROWS, LANES, NODE_CHUNK
from lcmchain.elements.families import SheetElement, family_of
from lcmchain.elements.family import Body
from lcmchain.elements.pressed_elements import PressedElements, pressed_elements
from lcmchain.elements.solid_shell.together import kinds_of
from lcmchain.errors import InputError
from lcmchain.interfaces.surfaces import PlyContact, interfaces_of_stages
from lcmchain.interfaces.table import Interface
from lcmchain.materials.law import Material, history_count, knows_step
from lcmchain.mesh.blank import BlankMesh
from lcmchain.mesh.cells import by_node
from lcmchain.mesh.mid_surface import TriangleMesh
from lcmchain.scene import Contact, Element, Process, Scene
from lcmchain.scene.plies import RESERVED_NAMES
from lcmchain.scene.process import require_time_for_fluid, require_time_for_rates
from lcmchain.scene.stack import PlySettings
from lcmchain.scene.stages import StagePlan, number_at
from lcmchain.stages import StageStart, StageTables, absent_nodes, stage_tables
from lcmchain.tools.motion import STANDARD_GRAVITY
from lcmchain.tools.table import ToolTable, build_tool_table, without_initial_overlap

# Contact stiffness over nodal mass, relative to the square of the highest element frequency at the
# start: 0.1 costs 5 % of the time step and leaves penetrations of some micrometres.
AUTOMATIC_PENALTY = 0.1
# Part of a ply's thickness by which springs give way at most where tools close on a stack, or a
# pressure acts on it. On long elements they would be softer, and all faces would take up what is
# pressed together instead of the plies.
DEEPEST_EXPECTED = 0.03


class Sheet(NamedTuple):
    """What a body is built from: a mesh, its material, and the choices of the scene's element."""

    name: str
    mesh: BlankMesh | TriangleMesh
    material: Material
    element: SheetElement


class PlacedBody(NamedTuple):
    """A body as the loop sees it: constants, and its ranges of what all bodies share.

    Ranges of nodes, of chunks of nodes, of corner forces, of history values, and of the blocks of
    the fibres' bending.
    """

    data: Any
    first_node: int
    last_node: int
    first_chunk: int
    last_chunk: int
    first_force: int
    last_force: int
    first_history: int
    last_history: int
    first_bending: int = 0
    last_bending: int = 0


class NodeData(NamedTuple):
    """Constants of the node kernel; every float is in SI.

    force_slot : (valence, node_count) where to find a node's corner forces.
    chunk_start : (chunk_count + 1,) int32, the first node of each chunk; no chunk has nodes of two
        bodies. chunk_order : (chunk_count,) int32, the chunks in the order of their elements.
    mass : (node_count,) [kg], with what is added for the time step; inverse_mass : (node_count,)
        [1/kg].
    area : (node_count,) reference area per face node [m²].
    impedance : (node_count,) root of area times mass, for the damping of contacts [m √kg].
    free : (3, node_count) 1 where a displacement component is free, 0 where it is held; None where
        all are free.
    offset : (node_count,) distance of the sheet's surface from the node [m].
    """

    force_slot: np.ndarray
    chunk_start: np.ndarray
    chunk_order: np.ndarray
    mass: np.ndarray
    inverse_mass: np.ndarray
    area: np.ndarray
    impedance: np.ndarray
    free: np.ndarray | None
    offset: np.ndarray


class Environment(NamedTuple):
    """Scalars of contact, damping and gravity."""

    penalty: float  # [Pa/m]
    tangential_ratio: float
    contact_damping_ratio: float
    depth_time: float | None  # in which depths in tools go to zero [s], None where they are left
    depth_stiffening: float  # [1/m], see lcmchain.effects.contact_depth
    mass_damping: float  # [1/s]
    # acceleration along -z by the weight [m/s²]; (node_count,) where mass is added selectively
    gravity: float | np.ndarray


@dataclass(frozen=True)
class Model:
    """Constants of one forming simulation (see the classes above for the arrays).

    bodies : the sheets, bottom first; ``placed`` the same for the loop.
    interfaces : what lies between them, by their names.
    averaging : time over which the mean velocity is taken that damping leaves alone [s], or None.
    pace : how the pace of a process without a time is found, or None.
    automatic_penalty : whether the contact stiffness was chosen by the program.
    history_interval : between two samples of the histories [s], infinite without histories.
    fibre_bending : of the fibres within the plane, or None.
    pore : the elements whose pores may hold fluid under pressure, all of them, or None.
    pore_columns : of a stack, the columns of fluid that these lie over at present; None where each
        element has a pressure of its own.
    face_pressure : on the faces of the sheets, or None.
    ply_contact : which sheets touch each other and how, or None.
    grips : the grippers of the scene on their nodes; ``grippers`` those that pull, for the loop.
    stages : of the process, in their order; none where it has one. The tables above are then those
        of the stage with the number ``stage``; ``over_all_stages`` is the model with which a run
        begins, whose tools have their course over all stages.
    corner_force_size : corner forces of all bodies, those of the fibres' bending, then zeros for
        nodes with fewer elements.
    """

    bodies: tuple[Body, ...]
    interfaces: tuple[Interface, ...]
    placed: tuple[PlacedBody, ...]
    fibre_bending: FibreBending | None
    pore: PressedElements | None
    face_pressure: FacePressure | RegionalPressure | None
    ply_contact: PlyContact | None
    corner_force_size: int
    nodes: NodeData
    tools: ToolTable
    tool_names: tuple[str, ...]
    grips: tuple[Grip, ...]
    grippers: GripperTable | None
    supports: SupportTable | None
    support_names: tuple[str, ...]
    environment: Environment
    averaging: float | None
    pace: PaceLaw | None
    automatic_penalty: bool
    process_time: float
    frame_count: int
    step_safety: float
    history_interval: float
    pore_columns: PoreColumns | None = None
    stages: tuple[StageTables, ...] = ()
    stage: int = 0
    over_all_stages: Model | None = None

    @property
    def whole(self) -> Model:
        """The model over all stages, for what tells of a whole run."""
        return self.over_all_stages or self

    @property
    def present_stage(self) -> StageTables | None:
        """The present stage, None where the process has one."""
        return self.stages[self.stage] if self.stages else None

    @property
    def lets_go(self) -> bool:
        """Whether nodes may be held for a while: by supports, or since their ply is not there."""
        return self.supports is not None or any(s.absent is not None for s in self.stages)

    def tools_at_work(self, time: float) -> np.ndarray:
        """Return whether contact with each tool is evaluated at a time [s] of the process (T,).

        A border of two stages belongs to the one that ends there.
        """
        if not self.stages:
            return np.ones(len(self.tool_names), dtype=bool)
        number = number_at([stage.end for stage in self.stages], time)
        return self.stages[number].tools_at_work

    def in_stage(self, number: int, state: StageStart) -> Model:
        """Return the model in a stage, of which the state says where it began."""
        return self.stages[number].model(self, number, self.whole, state)

    @property
    def sample_count(self) -> int:
        """Rows of the histories over the process; none where the interval is infinite."""
        return math.ceil(self.process_time / self.history_interval * (1.0 - 1e-12))

    @property
    def element_count(self) -> int:
        return sum(body.mesh.element_count for body in self.bodies)

    @property
    def node_count(self) -> int:
        return self.nodes.mass.size

    @property
    def empty_slot(self) -> int:
        """The place among the corner forces in which there is nothing."""
        return self.corner_force_size - EMPTY_ROWS

    @property
    def sheet_mass(self) -> np.ndarray:
        """Mass of the nodes (node_count,) [kg] without what is added for the time step."""
        return np.concatenate([body.node_mass for body in self.bodies])

    @property
    def node_positions(self) -> np.ndarray:
        """Reference positions of all nodes (node_count, 3) [m]."""
        return np.concatenate([body.mesh.node_positions for body in self.bodies])

    @property
    def history_size(self) -> int:
        """History values of all bodies, in blocks."""
        return max(placed.last_history for placed in self.placed)

    def only_body(self, asked_by: str = "what is asked for") -> Body:
        """Return the body of a model that has one.

        Parameters
        ----------
        asked_by : what knows one sheet alone, for the message.

        Raises
        ------
        InputError : the model has several.
        """
        if len(self.bodies) != 1:
            names = ", ".join(body.name for body in self.bodies)
            raise InputError(
                f"{asked_by} is of one sheet, and the model has {len(self.bodies)} ({names}); use "
                "a model of one of them",
                key="plies",
            )
        return self.bodies[0]

    @cached_property
    def fibre_bending_omega2(self) -> float:
        """Bound of the highest ω² of the fibres' bending [1/s²], which no deformation changes."""
        if self.fibre_bending is None:
            return 0.0
        return frequency_bound(self.fibre_bending, self.nodes.mass)

    @cached_property
    def stiffness_at_rest(self) -> float:
        """Larger in-plane stiffness of each sheet at rest, times its volume, of all sheets [J]."""
        stiffness = 0.0
        for body in self.bodies:
            C = body.material.stress_and_tangent(np.zeros(6))[1]
            stiffness += max(C[0, 0], C[1, 1]) * body.volume
        return stiffness

    @cached_property
    def contact_stiffness(self) -> np.ndarray:
        """Contact stiffness of the nodes (node_count,) [N/m]."""
        return self.environment.penalty * self.nodes.area

    @cached_property
    def contact_damping(self) -> np.ndarray:
        """Contact damping of the nodes (node_count,) [N s/m]."""
        critical = 2.0 * np.sqrt(self.contact_stiffness * self.nodes.mass)
        return self.environment.contact_damping_ratio * critical

    @cached_property
    def contact_omega2(self) -> np.ndarray:
        """ω² of the nodes (node_count,) on the contact stiffness of one tool [1/s²]."""
        return self.contact_stiffness / self.nodes.mass

    @cached_property
    def interactions(self) -> tuple[Any, ...]:
        """What acts on the bodies or between them, in the order in which it acts on a node.

        See :mod:`lcmchain.effects.interaction`. The tools come last: what their contact takes for
        the motion of a node has to know of all other forces.
        """
        tools = self.tools if self.tool_names else None
        pressures = pressures_of(self.pore, self.pore_columns, self.face_pressure)
        found = (pressures, self.ply_contact, self.supports, self.grippers, tools)
        return tuple(interaction for interaction in found if interaction is not None)

    @property
    def held_grip_count(self) -> int:
        """Grippers that hold or lead: their supports come after those that are no grippers."""
        return sum(not grip.settings.pulls for grip in self.grips)

    @property
    def pressed(self) -> bool:
        """Whether any pressure loads the elements."""
        return self.pore is not None or self.face_pressure is not None

    @property
    def remembers(self) -> bool:
        """Whether any law has a memory."""
        return any(history_count(body.material.law) for body in self.bodies)

    @property
    def resists_rates(self) -> bool:
        """Whether the stress of any law depends on the rate of the strain."""
        return any(knows_step(body.material.law) for body in self.bodies)

    def renew(
        self, positions: np.ndarray, history: np.ndarray, counted_at: np.ndarray | None = None
    ) -> float:
        """Renew what elements take from their neighbours; return the energy that it puts in [J].

        Parameters
        ----------
        positions : (3, node_count) [m]. history : (history_size,), written.
        counted_at : positions at which the energy is taken, ``positions`` by default. Between two
            steps those half a step before: the energy ½ v₋·M v₊ + U that central differences
            conserve then changes by ΔU - ½ dt v₋·Δf, which is ΔU there.
        """
        return sum(
            body.renew(positions, self.history_of(body, history), counted_at)
            for body in self.bodies
        )

    def history_of(self, body: Body, history: np.ndarray) -> np.ndarray:
        """Return a body's part of the history values (history_size,)."""
        placed = self.placed[self.bodies.index(body)]
        return history[placed.first_history : placed.last_history]

    def body_of_element(self, element: int) -> Body:
        """Return the body that an element of the model belongs to."""
        return next(b for b in reversed(self.bodies) if b.first_element <= element)

    def element_at(self, node: int) -> int:
        """Return the first element that has a node as a corner."""
        body = next(b for b in reversed(self.bodies) if b.first_node <= node)
        here = (body.mesh.elements == node - body.first_node).any(axis=1)
        return body.first_element + int(np.flatnonzero(here)[0])


def build_model(
    scene: Scene,
    supports: Callable[[Any], Sequence[Support]] = lambda mesh: (),
    *,
    pore_pressure: bool = False,
) -> Model:
    """Build the model of a scene: a body for every ply, and what lies between them.

    Parameters
    ----------
    supports : chooses nodes of a ply's mesh whose motion is prescribed; asked for every ply.
    pore_pressure : whether a fluid is coupled, whose pressures the state then holds.

    Raises
    ------
    InputError : a blank, tool or material that cannot be used; names the scene key.
    """
    stack, plans = scene.stack, scene.stage_plans()
    sheets = [sheet_of(ply) for ply in stack]
    nodes = np.concatenate([sheet.mesh.node_positions for sheet in sheets])
    return assemble_bodies(
        sheets,
        tools=build_tool_table(
            scene.tools, scene.source.directory, scene.process.time, blank=nodes
        ),
        tool_names=tuple(tool.name for tool in scene.tools),
        contact=scene.contact,
        process=scene.process,
        interfaces=stack.interfaces(scene.interfaces),
        stages=plans,
        interfaces_by_stage=[
            stack.interfaces(
                [entry for entry, works in zip(scene.interfaces, plan.interfaces) if works]
            )
            for plan in plans
        ],
        supports=_supports_of(sheets, supports),
        history_interval=scene.history_interval,
        face_pressures=scene.pressure,
        grippers=scene.grippers,
        pore_pressure=pore_pressure,
        finds_pace=scene.time_is_found,
    )


def sheet_of(ply: PlySettings) -> Sheet:
    """Return what the body of a ply of a scene (``Scene.stack``) is built from.

    Raises
    ------
    InputError : the ply cannot be meshed; names its entry.
    """
    mesh = family_of(ply.element).mesh_of(ply.build_blank())
    return Sheet(ply.name, mesh, ply.built_material(), ply.element)


def _supports_of(
    sheets: Sequence[Sheet], supports: Callable[[Any], Sequence[Support]]
) -> list[Support]:
    """Return the supports of all sheets by the nodes of the model."""
    found = []
    first_node = 0
    for sheet in sheets:
        found += [
            replace(support, nodes=support.nodes + first_node) for support in supports(sheet.mesh)
        ]
        first_node += sheet.mesh.node_count
    return found


def assemble_model(
    mesh: BlankMesh | TriangleMesh, material: Material, element: SheetElement, **others: Any
) -> Model:
    """Build the model of one sheet; ``others`` as for :func:`assemble_bodies`."""
    return assemble_bodies([Sheet("sheet", mesh, material, element)], **others)


def assemble_bodies(
    sheets: Sequence[Sheet],
    *,
    tools: ToolTable,
    tool_names: Sequence[str],
    contact: Contact,
    process: Process,
    supports: Sequence[Support] = (),
    history_interval: float = math.inf,
    face_pressures: Sequence[PressureOnFace] = (),
    interfaces: Sequence[Interface] = (),
    grippers: Sequence[Gripper] = (),
    pore_pressure: bool = False,
    finds_pace: bool = False,
    stages: Sequence[StagePlan] = (),
    interfaces_by_stage: Sequence[Sequence[Interface]] = (),
) -> Model:
    """Build the model of sheets that share tools and time, and touch where interfaces say so.

    Their nodes and elements are numbered one sheet after the other.

    Parameters
    ----------
    contact, process : tables of a scene.
    supports : of nodes of the model.
    history_interval : between two samples of the histories [s]; none by default.
    face_pressures : on the faces of all sheets.
    interfaces : between sheets that touch; without any they pass through each other.
    grippers : that hold, lead or pull a place of the sheets.
    pore_pressure : as for :func:`build_model`.
    finds_pace : whether the pace follows the energies; the process then takes other times than
        ``process.time``, which is that at pace 1.
    stages : of the process; ``interfaces_by_stage`` is then what is between sheets in each of them.
        A sheet that is not there in the first ones waits at its place.

    Raises
    ------
    InputError : names that cannot tell the sheets apart in a file, a mesh or material that the
        elements do not know, a fluid in a process without a time, or see
        :func:`lcmchain.effects.supports.build_supports`.
    """
    _require_names([sheet.name for sheet in sheets])
    require_time_for_fluid(time_is_found=finds_pace, pore_pressure=pore_pressure)
    require_time_for_rates(
        time_is_found=finds_pace,
        resists_rates=any(knows_step(sheet.material.law) for sheet in sheets),
    )
    time = float(process.time)
    bodies, order, placed, fibre_bending, last_force = _laid_out(sheets, process)
    positions = np.concatenate([body.mesh.node_positions for body in bodies])
    absent = absent_nodes(bodies, stages, stages[0]) if stages else None
    tools = _tools_clear_of(tools, bodies, positions, absent)
    grips = grips_of(grippers, bodies)
    pulling = [grip for grip in grips if grip.settings.pulls]
    supports = [*supports, *(grip.support(time) for grip in grips if not grip.settings.pulls)]
    support_table, free = build_supports(supports, positions, time)
    if free is None and absent is not None:
        free = np.ones((3, len(positions)))  # plies that are laid down later are held until then
    nodes = _node_data(bodies, placed, fibre_bending, last_force, free)
    pressure = _pressures_on_faces(face_pressures, bodies, order, time)
    stiffness = _contact_stiffness(
        contact, tools, bodies, pressure, time, stages, absent is not None, bool(interfaces)
    )
    depths = _depth_control_over(contact, tools, bodies, nodes, stiffness)
    contacts = interfaces_of_stages(
        interfaces_by_stage or [interfaces],
        bodies,
        stiffness.of_plies,
        there=[plan.plies for plan in stages] if absent is not None else (),
    )
    model = Model(
        bodies=tuple(bodies),
        interfaces=tuple(interfaces),
        placed=placed,
        fibre_bending=fibre_bending,
        pore=pressed_elements(bodies, order, key="pore pressure") if pore_pressure else None,
        face_pressure=pressure,
        ply_contact=contacts[0] if contacts else None,
        corner_force_size=last_force + EMPTY_ROWS,
        nodes=nodes,
        grips=grips,
        grippers=gripper_table(pulling, positions, nodes.mass, nodes.chunk_start, time),
        tools=tools,
        tool_names=tuple(tool_names),
        supports=support_table,
        support_names=tuple(support.name for support in supports),
        environment=_environment(contact, process, bodies, stiffness, depths(time)),
        averaging=process.damping_average if process.mass_damping > 0.0 else None,
        pace=pace_law(bodies, time, process.quasi_static) if finds_pace else None,
        automatic_penalty=contact.penalty is None,
        process_time=time,
        frame_count=int(process.frames),
        step_safety=float(process.step_safety),
        history_interval=float(history_interval),
    )
    if not stages:
        return model
    tables = stage_tables(
        model,
        stages,
        contacts,
        grippers=grippers,
        supports=supports,
        pressures=face_pressures,
        quasi_static=float(process.quasi_static),
        depth_time=lambda time: depths(time)[0],
    )
    return replace(model, stages=tables)


class _LaidOut(NamedTuple):
    """Bodies with the inertia that they move with, and their ranges of the flat arrays.

    order : of their elements and fibres: those together that the loop takes as one body.
    last_force : where the forces of elements and fibres end.
    """

    bodies: list[Body]
    order: list[int]
    placed: tuple[PlacedBody, ...]
    fibre_bending: FibreBending | None
    last_force: int


def _laid_out(sheets: Sequence[Sheet], process: Process) -> _LaidOut:
    """Build the bodies of all sheets, one behind the other in the numbers of nodes and elements."""
    bodies: list[Body] = []
    first_node = first_element = 0
    for name, mesh, material, element in sheets:
        family = family_of(element)
        bodies.append(family.build(name, mesh, material, element, first_node, first_element))
        first_node += mesh.node_count
        first_element += mesh.element_count
    order = [number for kind in kinds_of([body.data for body in bodies]) for number in kind]
    placed = _placed(bodies, order)
    last_force = placed[order[-1]].last_force
    fibre_bending = build_fibre_bending([bodies[number] for number in order], last_force)
    bodies = with_added_mass(
        bodies,
        process.mass_scaling,
        step_safety=float(process.step_safety),
        fibre_bending=fibre_bending,
    )
    if fibre_bending is not None:
        last_force += fibre_bending.padded_count * FORCE_ROWS
        placed = _with_bending(placed, order, fibre_bending)
    return _LaidOut(bodies, order, placed, fibre_bending, last_force)


def _tools_clear_of(
    tools: ToolTable, bodies: Sequence[Body], positions: np.ndarray, absent: np.ndarray | None
) -> ToolTable:
    """Return the tools, without small overlaps with the sheets that are there at the start."""
    offset = _contact_offsets(bodies)
    thickness = min(body.material.thickness for body in bodies)
    if absent is not None:
        positions, offset = positions[~absent], offset[~absent]
    return without_initial_overlap(tools, positions, offset, thickness)


def _contact_offsets(bodies: Sequence[Body]) -> np.ndarray:
    """Return the distance of each node from the surface of its sheet (node_count,) [m]."""
    return np.concatenate([np.full(b.mesh.node_count, b.contact_offset) for b in bodies])


def _node_data(
    bodies: Sequence[Body],
    placed: Sequence[PlacedBody],
    fibre_bending: FibreBending | None,
    last_force: int,
    free: np.ndarray | None,
) -> NodeData:
    """Return the constants of all nodes; ``free`` as :func:`build_supports` returns it."""
    mass = np.concatenate([body.inertial_mass for body in bodies])
    area = np.concatenate([body.node_area for body in bodies])
    chunk_start = _chunk_start(placed)
    force_slot = _force_slots(bodies, placed, fibre_bending, last_force)
    return NodeData(
        force_slot=force_slot,
        chunk_start=chunk_start,
        chunk_order=_chunk_order(force_slot, placed, chunk_start),
        mass=aligned(mass),
        inverse_mass=aligned(1.0 / mass),
        area=aligned(area),
        impedance=aligned(np.sqrt(area * mass)),
        free=free,
        offset=aligned(_contact_offsets(bodies)),
    )


class _ContactStiffness(NamedTuple):
    """Stiffness of contact with tools and of each ply where anything asks for it [Pa/m].

    gap : that the tools leave for all sheets [m]; infinite where it decides nothing.
    """

    penalty: float
    of_plies: list[float]
    gap: float


def _contact_stiffness(
    contact: Contact,
    tools: ToolTable,
    bodies: Sequence[Body],
    pressure: FacePressure | RegionalPressure | None,
    time: float,
    stages: Sequence[StagePlan],
    laid_down: bool,
    interfaces: bool,
) -> _ContactStiffness:
    """Return the stiffness of contact: as given, or what follows from plies and pressures.

    Parameters
    ----------
    pressure : on faces. time : of the process [s].
    laid_down : whether sheets come later than the first stage. interfaces : whether sheets touch.
    """
    gap, closed = math.inf, 0.0
    if laid_down:
        gap, closed = _closing_by_stages(tools, bodies, time, stages)
    elif contact.penalty is None or len(bodies) > 1:
        gap = gap_left(tools, [body.mesh for body in bodies], time, stages)
    expected = 0.0
    if len(bodies) > 1:
        if not laid_down:
            closed = pressure_in_gap(gap, [body.material for body in bodies])
        expected = max(closed, 0.0 if pressure is None else pressure.largest)
    stiff_enough = expected / (DEEPEST_EXPECTED * min(b.material.thickness for b in bodies))
    of_plies: list[float] = []
    if contact.penalty is None or interfaces:
        of_plies = [max(_automatic_penalty(body), stiff_enough) for body in bodies]
    penalty = min(of_plies) if contact.penalty is None else contact.penalty
    return _ContactStiffness(float(penalty), of_plies, gap)


def _depth_control_over(
    contact: Contact,
    tools: ToolTable,
    bodies: Sequence[Body],
    nodes: NodeData,
    stiffness: _ContactStiffness,
) -> Callable[[float], tuple[float | None, float]]:
    """Return what gives ``depth_time`` and ``depth_stiffening`` for a time of the process [s]."""
    slowest = float(np.sqrt(stiffness.penalty * nodes.area / nodes.mass).min())
    rate = 2.0 * contact.damping_ratio * slowest
    materials = [body.material for body in bodies]
    return lambda time: depth_control(contact, tools, stiffness.gap, materials, time, rate)


def _environment(
    contact: Contact,
    process: Process,
    bodies: Sequence[Body],
    stiffness: _ContactStiffness,
    depth: tuple[float | None, float],
) -> Environment:
    """Return the scalars of contact, damping and weight; ``depth`` : time and stiffening."""
    return Environment(
        stiffness.penalty,
        float(contact.tangential_ratio),
        float(contact.damping_ratio),
        *depth,
        float(process.mass_damping),
        weight_per_inertia(bodies, STANDARD_GRAVITY if process.gravity else 0.0),
    )


def _closing_by_stages(
    tools: ToolTable, bodies: Sequence[Body], time: float, stages: Sequence[StagePlan]
) -> tuple[float, float]:
    """Return the gap that tools leave for all sheets [m], and the pressure between them [Pa].

    Of the stage in which they close most on the sheets that are there: its gap in parts of the
    thickness of these, times that of all.
    """
    thickness = sum(body.material.thickness for body in bodies)
    least, pressure = math.inf, 0.0
    for plan in stages:
        there = [body for body, is_there in zip(bodies, plan.plies, strict=True) if is_there]
        materials = [body.material for body in there]
        gap = gap_left(tools, [body.mesh for body in there], time, [plan])
        pressure = max(pressure, pressure_in_gap(gap, materials))
        least = min(least, gap * thickness / sum(own.thickness for own in materials))
    return least, pressure


def _pressures_on_faces(
    entries: Sequence[PressureOnFace], bodies: Sequence[Body], order: Sequence[int], time: float
) -> FacePressure | RegionalPressure | None:
    """Return what presses on faces: two numbers a step where all act on whole outer faces."""
    if all(entry.acts_on_whole_outer_faces for entry in entries):
        return build_face_pressure(entries, bodies, order, time)
    return build_regional_pressure(entries, bodies, order, time)


def assemble_sheet(
    blank: BlankMesh, material: Material, element: SheetElement | None = None
) -> Model:
    """Build the model of a sheet without tools, for statics and vibrations.

    ``element`` holds the choices of a scene's ``[element]`` table; the defaults are the scene's.
    """
    return assemble_model(
        blank,
        material,
        element if element is not None else Element(),
        tools=build_tool_table((), None, 1.0),
        tool_names=(),
        contact=Contact(),
        process=Process(time="1 s"),
    )


def _require_names(names: Sequence[str]) -> None:
    """Check that every sheet has a name of its own, which is that of a group in the result."""
    for name in names:
        if names.count(name) > 1:
            raise InputError(f'two sheets have the name "{name}"; give each its own')
        if len(names) > 1 and name in RESERVED_NAMES:
            raise InputError(f'a sheet cannot have the name "{name}", which result files use')


def _placed(bodies: Sequence[Body], order: Sequence[int]) -> tuple[PlacedBody, ...]:
    """Give every body its ranges of all but the fibres' bending.

    Nodes and their chunks follow the bodies, forces and histories an order of their own.
    """
    placed: list[PlacedBody] = []
    chunk = 0
    for body in bodies:
        nodes = (body.first_node, body.first_node + body.mesh.node_count)
        last_chunk = chunk + -(-body.mesh.node_count // NODE_CHUNK)
        placed.append(PlacedBody(body.data, *nodes, chunk, last_chunk, 0, 0, 0, 0))
        chunk = last_chunk
    force = history = 0
    for number in order:
        body = bodies[number]
        element_count, corner_count = body.force_nodes.shape
        padded = LANES * -(-element_count // LANES)
        last_force = force + padded * 3 * corner_count
        last_history = history + padded * body.history_count
        placed[number] = placed[number]._replace(
            first_force=force,
            last_force=last_force,
            first_history=history,
            last_history=last_history,
        )
        force, history = last_force, last_history
    return tuple(placed)


def _with_bending(
    placed: Sequence[PlacedBody], order: Sequence[int], fibre_bending: FibreBending
) -> tuple[PlacedBody, ...]:
    """Give every body its range of blocks of the fibres' bending, whose sheets follow ``order``."""
    counts = fibre_bending.block_counts
    ends = np.cumsum(np.concatenate([counts, np.zeros(len(placed) - len(counts), dtype=int)]))
    starts = np.concatenate([[0], ends[:-1]])
    found = list(placed)
    for number, first, last in zip(order, starts.tolist(), ends.tolist(), strict=True):
        found[number] = placed[number]._replace(first_bending=first, last_bending=last)
    return tuple(found)


def _chunk_start(placed: Sequence[PlacedBody]) -> np.ndarray:
    """Return the first node of every chunk, and the number of nodes."""
    starts = [np.arange(place.first_node, place.last_node, NODE_CHUNK) for place in placed]
    return np.append(np.concatenate(starts), placed[-1].last_node).astype(np.int32)


def _force_slots(
    bodies: Sequence[Body],
    placed: Sequence[PlacedBody],
    fibre_bending: FibreBending | None,
    last_force: int,
) -> np.ndarray:
    """Return where each node finds its forces, (valence, node_count) int32.

    The corner forces lie in blocks of 16 elements with 3 rows per corner, those of the fibres'
    bending behind them in blocks of 16 nodes; slots without an element point to the zeros behind
    them all, which begin at ``last_force``.
    """
    nodes, slots = [], []
    for body, place in zip(bodies, placed, strict=True):
        corner_count = body.force_nodes.shape[1]
        corners = body.force_nodes.ravel()
        element, corner = np.divmod(np.arange(corners.size), corner_count)
        block, lane = np.divmod(element, LANES)
        slot = place.first_force + (block * 3 * corner_count + 3 * corner) * LANES + lane
        there = corners >= 0
        nodes.append(corners[there] + body.first_node)
        slots.append(slot[there])
    if fibre_bending is not None:
        slot = fibre_bending.force_slots()
        one_layer = fibre_bending.below == fibre_bending.above
        nodes += [fibre_bending.below, fibre_bending.above[~one_layer]]
        slots += [slot, slot[~one_layer]]
    node_count = sum(body.mesh.node_count for body in bodies)
    # a fixed order of the corners of each node keeps sums bit-identical for any thread count
    return by_node(np.concatenate(nodes), np.concatenate(slots), node_count, last_force)


def _chunk_order(
    force_slot: np.ndarray, placed: Sequence[PlacedBody], chunk_start: np.ndarray
) -> np.ndarray:
    """Return the chunks of every body in the order in which their corner forces lie in memory.

    Threads take elements and chunks from the front to the back: one that works on the nodes, of
    either face, of the elements that it has worked on finds them in its own cache.
    """
    first = force_slot[0]
    middle = np.array([np.median(first[i:k]) for i, k in pairwise(chunk_start)])
    orders = [
        place.first_chunk + np.argsort(middle[place.first_chunk : place.last_chunk], kind="stable")
        for place in placed
    ]
    return np.concatenate(orders).astype(np.int32)


def _automatic_penalty(body: Body) -> float:
    """Return the contact stiffness [Pa/m] that keeps contact from governing the time step.

    The wave in the plane is the faster one in a fabric, that over the thickness in a film or in any
    other sheet that is as stiff across as along.
    """
    material = body.material
    C = material.stress_and_tangent(np.zeros(6))[1]
    stiffness = max(C[0, 0], C[1, 1])
    wave2 = stiffness / material.density
    omega2 = 4.0 * wave2 / body.shortest_length**2
    if body.reference_frequencies().over_thickness > 0.0:
        omega2 = max(omega2, 4.0 * (C[2, 2] / material.density) / material.thickness**2)
    return AUTOMATIC_PENALTY * omega2 * 0.5 * material.density * material.thickness
