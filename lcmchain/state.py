"""Every array that changes during a run, each declared once.

Loop, checkpoint, state of an FMU and rollback follow from the declarations: an array that is added
to :class:`State` is allocated, handed to the loop, saved and restored; one added to
:class:`Scratch` is allocated and handed to the loop.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import Field, dataclass, field, fields
from typing import Any, ClassVar, Self

import numpy as np

from lcmchain.compilation.processor import aligned, zeros
from lcmchain.effects.fibre_bending import MIDDLE_ROWS, VECTOR_ROWS
from lcmchain.elements.blocks import PACKS_OF_CHUNK, SPANS_OF_CHUNK
from lcmchain.errors import InputError
from lcmchain.interfaces.forces import PLY_CLOCK, PLY_COUNTERS, SUM_COLUMNS
from lcmchain.interfaces.springs import SLOPES
from lcmchain.interfaces.surfaces import NONE
from lcmchain.model import Model

# Columns of ``State.work``: energies [J] accumulated over the run, or of the last step.
KINETIC = 0  # of the sheets and of guided tools, last step
CONTACT = 1  # stored in penalty springs, last step
FRICTION = 2  # dissipated by sliding
CONTACT_DAMPING = 3  # dissipated by contact damping
MASS_DAMPING = 4  # dissipated by mass-proportional damping and by dampers of guided tools
EXTERNAL = 5  # work of prescribed tools, of forces on guided tools, of gravity and of pressures
RENEWAL = 6  # given up by elements where the curvature they share was renewed
PLY_REFRESH = 7  # given up by the springs between plies where they were renewed
WORK_COLUMNS = 8

# Entries of ``State.clock``.
TIME = 0  # of the process [s]
LAST_STEP = 1  # size of the last step, in the time of the sheet [s]
OMEGA2 = 2  # bound of the square of the highest frequency of the elements [1/s²]
LOOKED = 3  # when the guard of the hourglass energy last looked [s]
RESOLVED = 4  # when it last found that the mesh follows the deformation [s]
PACE = 5  # time of the process that passes in a time of the sheet
SHEET_TIME = 6  # time of the sheet: the sum of its steps [s]
MEAN_KINETIC = 7  # running mean of the kinetic energy where the pace is found [J]
DAMPING_RATE = 8  # bound of the rate c/m of what resists the rate of the strain [1/s]
CLOCK_ENTRIES = 9

# Entries of ``State.counters``.
STEPS = 0  # made so far
CHUNKS = 1  # of steps since the frequency was last evaluated
CONTROLLING_ELEMENT = 2  # that the frequency belongs to
CONTROLLING_PART = 3  # what governs it there, a code of the element's family
HALVINGS = 4  # of the step, see lcmchain.solver.recovery
RENEWED = 5  # chunks of steps since the elements' shared curvature was renewed
SAMPLES = 6  # rows of ``State.samples`` that are filled
STAGE = 7  # number of the present stage of the process
COUNTERS = 8

# How often a run may halve its step to get over a value that is not a number.
MOST_HALVINGS = 3

# Entries of ``State.tool_start``.
START_TRAVEL = 0  # when the present stage began [m]
START_OVERLAP = 1  # depth up to which a node exerts no force [m], see tools/initial_overlap.py
START_ENTRIES = 2

# Entries of ``State.rest``, of a stage that ends at rest (:mod:`lcmchain.solver.rest`).
REST_SCALE = 0  # energy that the motion is compared with [J]; 0 before the motions have ended
REST_LAST = 1  # kinetic energy after the last chunk of steps [J]
REST_PEAK = 2  # largest one since the last stop [J]
REST_TIME = 3  # when the sheet was at rest [s]; 0 before
REST_STOPS = 4  # how often it was stopped at a peak
REST_STOPPED = 5  # when it was stopped last [s]
REST_SWING = 6  # longest time from a stop to the next one [s]
REST_LEFT = 7  # kinetic energy of the peak at which the sheet was stopped last [J]
REST_ENTRIES = 8

# Entries of ``State.tool_stopped``.
STOPPED_TIME = 0  # [s], infinite where the tool was not stopped
STOPPED_TRAVEL = 1  # [m]
STOPPED_ENTRIES = 2

# Entries of ``State.tool_peak``.
PEAK_FORCE = 0  # [N]
PEAK_TIME = 1  # [s]
PEAK_ENTRIES = 2

# Columns of ``State.samples``, then those of every tool, one tool after the other. Energies [J] are
# named as in :meth:`lcmchain.solver.simulation.Simulation.energy`; the mass damping is the part of
# ``damping`` that is not contact damping. The last step is in the time of the process.
SAMPLED_ENERGIES = (
    "kinetic", "internal", "hourglass", "contact", "friction", "inelastic", "viscous", "damping",
    "external", "balance_error", "mass_damping",
)  # fmt: skip
SAMPLE_COLUMNS = ("time", "sheet_time", "last_step", *SAMPLED_ENERGIES)
TOOL_SAMPLE_COLUMNS = (
    "travel", "work", "impulse_x", "impulse_y", "impulse_z", "peak_force", "peak_time",
    "stop_impulse", "moment_impulse",
)  # fmt: skip

#: Then those of every gripper, one after the other.
GRIPPER_SAMPLE_COLUMNS = (
    "impulse_x", "impulse_y", "impulse_z", "travel_x", "travel_y", "travel_z",
)  # fmt: skip

# Columns of a tool's part of the chunk sums after the energies: force x, y, z and smallest gap.
# Where tools turn, their moments stand behind those of all tools.
TOOL_COLUMNS = 4


def entry(
    *shape: str, unit: str, meaning: str, dtype: type = float, in_frames: bool = False
) -> Any:
    """Declare an array; the sizes in ``shape`` are those of :func:`sizes`.

    in_frames : whether saved frames hold it, for the fields.
    """
    return field(
        metadata={
            "shape": shape, "unit": unit, "meaning": meaning, "dtype": dtype,
            "in_frames": in_frames,
        }
    )  # fmt: skip


def sizes(model: Model) -> dict[str, int]:
    """Return the sizes that declarations name."""
    tool_count = len(model.tool_names)
    turning_count = 0 if model.tools.turn_axis is None else tool_count
    span_count = model.nodes.chunk_order.size * SPANS_OF_CHUNK
    pack_count = model.nodes.chunk_order.size * PACKS_OF_CHUNK
    bending, pore = model.fibre_bending, model.pore
    plies = None if model.ply_contact is None else model.ply_contact.data
    return {
        "xyz": 3,
        "node": model.node_count,
        "averaged node": 0 if model.averaging is None else model.node_count,
        "tool": tool_count,
        "tool input": 2,
        "turning tool": turning_count,
        "tool stopped": STOPPED_ENTRIES,
        "process or stage": max(1, len(model.stages)),
        "held node": 0 if model.environment.depth_time is None else model.node_count,
        "sticking node": model.node_count if model.tools.friction.any() else 0,
        "support": len(model.support_names),
        "node held for a while": model.node_count if model.lets_go else 0,
        "tool start": START_ENTRIES,
        "stage": len(model.stages),
        "rest": REST_ENTRIES,
        "gripped again": model.node_count if model.stages and model.supports is not None else 0,
        "gripper": 0 if model.grippers is None else model.grippers.force.size,
        "work": WORK_COLUMNS,
        "clock": CLOCK_ENTRIES,
        "counter": COUNTERS,
        "halving": MOST_HALVINGS,
        "time and place": 4,
        "history": model.history_size,
        "corner force": model.corner_force_size,
        "porous element": 0 if pore is None else pore.padded_count,
        "corner load": model.corner_force_size if model.pressed else 0,
        "loaded node": model.node_count if model.pressed else 0,
        "bending middle": 0 if bending is None else bending.padded_count * MIDDLE_ROWS,
        "bending vector": 0 if bending is None else bending.padded_count * VECTOR_ROWS,
        "peak": PEAK_ENTRIES,
        "ply point": 0 if plies is None else model.node_count,
        "ply facet": 0 if plies is None else len(plies.facet_node),
        "ply chunk": 0 if plies is None else model.nodes.chunk_order.size,
        "ply list": 0 if plies is None else model.nodes.chunk_order.size + 1,
        "ply list entry": 0 if plies is None else 4 * model.node_count,
        "ply list border": 0 if plies is None else 4 * model.node_count + 1,
        "ply row number": 0 if plies is None else span_count * plies.row_size,
        "ply span": 0 if plies is None else span_count,
        "lowest and highest": 2,
        "corner": 4,
        "slope": SLOPES,
        "depth and offset": 2,
        "ply counter": 0 if plies is None else PLY_COUNTERS,
        "ply clock entry": 0 if plies is None else PLY_CLOCK,
        "ply sum": SUM_COLUMNS,
        "sample": model.sample_count,
        "sample column": len(SAMPLE_COLUMNS)
        + len(TOOL_SAMPLE_COLUMNS) * tool_count
        + len(GRIPPER_SAMPLE_COLUMNS) * len(model.grips),
        "chunk": model.nodes.chunk_order.size,
        "pack": pack_count,
        "chunk sum": WORK_COLUMNS + TOOL_COLUMNS * tool_count + turning_count,
    }


class _Arrays:
    """Arrays by name, as declared by :func:`entry`."""

    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]

    @classmethod
    def names(cls) -> list[str]:
        return [declared.name for declared in fields(cls)]

    @classmethod
    def zeros(cls, model: Model) -> Self:
        """Return all arrays with zeros."""
        return cls(
            **{name: zeros(*declared) for name, declared in cls.shapes_and_types(model).items()}
        )

    @classmethod
    def shapes_and_types(cls, model: Model) -> dict[str, tuple[tuple[int, ...], np.dtype]]:
        """Return shape and type of every array by its name."""
        size = sizes(model)
        return {
            f.name: (
                tuple(size[name] for name in f.metadata["shape"]),
                np.dtype(f.metadata["dtype"]),
            )
            for f in fields(cls)
        }

    def as_dict(self) -> dict[str, np.ndarray]:
        """Return the arrays by name (not copied)."""
        return {name: getattr(self, name) for name in self.names()}


@dataclass
class State(_Arrays):
    """What a run needs to go on from where it is; copying it is a checkpoint.

    Units and meanings stand in the declarations.
    """

    position: np.ndarray = entry("xyz", "node", unit="m", meaning="at time n", in_frames=True)
    velocity: np.ndarray = entry("xyz", "node", unit="m/s", meaning="at time n - 1/2")
    mean_velocity: np.ndarray = entry(
        "xyz", "averaged node", unit="m/s", meaning="running mean that damping leaves alone"
    )
    history: np.ndarray = entry(
        "history",
        unit="1",
        meaning="what elements keep: shared curvature and what laws remember, in blocks",
        in_frames=True,
    )
    stick: np.ndarray = entry(
        "tool", "xyz", "sticking node", unit="m", meaning="elastic slip of the friction springs"
    )
    depth_offset: np.ndarray = entry(
        "tool", "held node", unit="m", meaning="further depth that the contact springs feel"
    )
    near: np.ndarray = entry(
        "tool",
        "node",
        unit="1",
        meaning="whether contact of the node with the tool is evaluated",
        dtype=np.uint8,
    )
    tool_travel: np.ndarray = entry(
        "tool", unit="m, rad", meaning="at time n; of a tool that turns its angle", in_frames=True
    )
    tool_velocity: np.ndarray = entry("tool", unit="m/s, rad/s", meaning="at time n - 1/2")
    tool_input: np.ndarray = entry(
        "tool",
        "tool input",
        unit="m/s, N",
        meaning="velocity of a driven tool, added force of a guided one",
    )
    driven: np.ndarray = entry(
        "tool",
        unit="1",
        meaning="whether the travel follows the input instead of the scene's motion",
        dtype=np.int64,
    )
    tool_start: np.ndarray = entry(
        "tool",
        "tool start",
        unit="m",
        meaning="when the present stage began, see the entries above",
    )
    rest: np.ndarray = entry(
        "stage", "rest", unit="J, s", meaning="of every stage, see the entries above"
    )
    tool_force: np.ndarray = entry(
        "tool",
        "xyz",
        unit="N",
        meaning="of the sheets on the tool at the last step",
        in_frames=True,
    )
    tool_impulse: np.ndarray = entry(
        "tool", "xyz", unit="N s", meaning="integral of the tool force over time"
    )
    tool_work: np.ndarray = entry("tool", unit="J", meaning="of the tool on the sheets")
    tool_moment: np.ndarray = entry(
        "turning tool",
        unit="N m",
        meaning="of the sheets on the tool about its axis at the last step; 0 without one",
    )
    tool_moment_impulse: np.ndarray = entry(
        "turning tool", unit="N m s", meaning="integral of the moment over time"
    )
    tool_stop_force: np.ndarray = entry(
        "tool",
        unit="N",
        meaning="of a guided tool on its stop, along its direction, at the last step",
    )
    tool_stop_impulse: np.ndarray = entry(
        "tool", unit="N s", meaning="integral of the force on the stop over time"
    )
    tool_stopped: np.ndarray = entry(
        "tool",
        "process or stage",
        "tool stopped",
        unit="s, m",
        meaning="when and where it came to its stop, or a force ended its stroke, by stage",
    )
    tool_peak: np.ndarray = entry(
        "tool",
        "peak",
        unit="N, s",
        meaning="largest tool force of a step since the last sample, see the entries above",
    )
    samples: np.ndarray = entry(
        "sample",
        "sample column",
        unit="s, J, m, N s, N",
        meaning="histories, see the columns above",
    )
    contact_force: np.ndarray = entry(
        "node",
        unit="N",
        meaning="sum of the normal forces of all tools at the last step",
        in_frames=True,
    )
    pore_pressure: np.ndarray = entry(
        "porous element",
        unit="Pa",
        meaning="of the fluid in the elements at time n, in blocks",
        in_frames=True,
    )
    pore_rate: np.ndarray = entry(
        "porous element", unit="Pa/s", meaning="of the pore pressures, in blocks"
    )
    pore_resistance: np.ndarray = entry(
        "porous element",
        unit="Pa s/m3",
        meaning="by which the pore pressures fall with the rate of the volumes, in blocks",
    )
    node_load: np.ndarray = entry(
        "xyz",
        "loaded node",
        unit="N",
        meaning="of pressures in and on the sheet on each node at the last step",
    )
    ply_facet: np.ndarray = entry(
        "ply point",
        unit="1",
        meaning="facet of another ply that a point faces; -1 without",
        dtype=np.int32,
    )
    ply_rows: np.ndarray = entry(
        "ply row number",
        unit="1, m, N, J",
        meaning="springs of points on other plies and what their laws keep, see "
        "lcmchain.interfaces.rows",
    )
    ply_acts: np.ndarray = entry(
        "ply span",
        unit="1",
        meaning="whether a point of a span is near enough to act",
        dtype=np.uint8,
    )
    ply_slope: np.ndarray = entry(
        "ply facet", "slope", unit="1", meaning="of the smooth surface at the corners of a facet"
    )
    ply_counters: np.ndarray = entry(
        "ply counter",
        unit="1",
        meaning="counts, see lcmchain.interfaces.forces",
        dtype=np.int64,
    )
    ply_clock: np.ndarray = entry(
        "ply clock entry", unit="m", meaning="see lcmchain.interfaces.forces"
    )
    penetration_max: np.ndarray = entry("tool", unit="m", meaning="deepest so far")
    support_force: np.ndarray = entry(
        "support", "xyz", unit="N", meaning="of the support on the sheet at the last step"
    )
    support_impulse: np.ndarray = entry(
        "support", "xyz", unit="N s", meaning="integral of the support force over time"
    )
    support_let_go: np.ndarray = entry(
        "support", unit="s", meaning="time at which the support let go; infinite before"
    )
    free: np.ndarray = entry(
        "xyz",
        "node held for a while",
        unit="1",
        meaning="1 where a component is free, 0 where it is held",
    )
    gripped_at: np.ndarray = entry(
        "xyz",
        "gripped again",
        unit="m",
        meaning="where a node that is held was when the present stage began",
    )
    gripper_force: np.ndarray = entry(
        "gripper", "xyz", unit="N", meaning="of the gripper on the sheet at the last step"
    )
    gripper_start: np.ndarray = entry(
        "gripper", "xyz", unit="m", meaning="travel of its place when the gripper came to work"
    )
    gripper_impulse: np.ndarray = entry(
        "gripper", "xyz", unit="N s", meaning="integral of the gripper force over time"
    )
    gripper_travel: np.ndarray = entry(
        "gripper",
        "xyz",
        unit="m",
        meaning="of the place that is gripped since it came to work, at the last step",
    )
    gripper_work: np.ndarray = entry("gripper", unit="J", meaning="of the gripper on the sheet")
    gripper_let_go: np.ndarray = entry(
        "gripper", unit="s", meaning="time at which the gripper let go; infinite before"
    )
    work: np.ndarray = entry("work", unit="J", meaning="energies, see the columns above")
    clock: np.ndarray = entry("clock", unit="s, 1/s2, J", meaning="times, see the entries above")
    counters: np.ndarray = entry(
        "counter", unit="1", meaning="counts, see the entries above", dtype=np.int64
    )
    halvings: np.ndarray = entry(
        "halving", "time and place", unit="s, m", meaning="where the step was halved, in order"
    )

    @classmethod
    def at_rest(cls, model: Model) -> State:
        """Return the state at time 0: reference positions, no velocity."""
        state = cls.zeros(model)
        state.position[:] = model.node_positions.T
        for body in model.bodies:
            model.history_of(body, state.history)[:] = body.no_history()
        state.clock[PACE] = 1.0
        state.ply_facet[:] = NONE
        state.support_let_go[:] = state.gripper_let_go[:] = np.inf
        state.tool_stopped[:, :, STOPPED_TIME] = np.inf
        if model.lets_go:
            state.free[:] = model.nodes.free
        state.tool_start[:, START_OVERLAP] = model.tools.initial_overlap
        return state

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, np.ndarray]) -> State:
        """Return the state of saved arrays.

        Raises
        ------
        ValueError : an array is missing or unknown.
        """
        differing = sorted(set(arrays) ^ set(cls.names()))
        if differing:
            raise ValueError(f"missing or unknown arrays: {', '.join(differing)}")
        return cls(**{name: aligned(array) for name, array in arrays.items()})

    def frame(self) -> dict[str, np.ndarray]:
        """Return copies of the arrays that saved frames hold."""
        framed = [f.name for f in fields(self) if f.metadata["in_frames"]]
        return {name: getattr(self, name).copy() for name in framed}

    def copy(self) -> State:
        """Return an independent copy, for checkpoints and rollback."""
        return State(**{name: aligned(array) for name, array in self.as_dict().items()})

    def set_to(self, other: State) -> None:
        """Take over the values of another state of the same model, without new arrays."""
        for name, array in self.as_dict().items():
            np.copyto(array, getattr(other, name))

    def require_fits(self, model: Model) -> None:
        """Check that the arrays have the sizes and types of a model.

        Raises
        ------
        InputError : they are those of another model.
        """
        for name, (shape, dtype) in self.shapes_and_types(model).items():
            found = getattr(self, name)
            if (found.shape, found.dtype) != (shape, dtype):
                raise InputError(
                    f"the saved state belongs to another model: {name} is {found.dtype} "
                    f"{found.shape} instead of {dtype} {shape}; run this model from the start, or "
                    "go on with the scene and the version of lcmchain that saved the state"
                )

    @property
    def time(self) -> float:
        """Present time of the process [s]."""
        return float(self.clock[TIME])

    @property
    def pace(self) -> float:
        """Time of the process that passes in a time of the sheet; 1 where the scene has a time."""
        return float(self.clock[PACE])

    @property
    def last_step(self) -> float:
        """Size of the last step, in the time of the sheet [s]."""
        return float(self.clock[LAST_STEP])

    @property
    def step_count(self) -> int:
        return int(self.counters[STEPS])

    @property
    def step_factor(self) -> float:
        """Part of the stable step, safety included, that the run has come down to."""
        return 0.5 ** int(self.counters[HALVINGS])


@dataclass
class Scratch(_Arrays):
    """What the loop works with and nobody needs afterwards."""

    corner_force: np.ndarray = entry("corner force", unit="N", meaning="in blocks of elements")
    force: np.ndarray = entry("xyz", "node", unit="N", meaning="sum of forces on each node")
    corner_load: np.ndarray = entry(
        "corner load", unit="N", meaning="of pressures in and on the sheet, in blocks of elements"
    )
    near_pack: np.ndarray = entry(
        "pack", "tool", unit="1", meaning="1 where a node of it is near the tool", dtype=np.uint8
    )
    tools_near: np.ndarray = entry(
        "pack", unit="1", meaning="tools near a node of a pack", dtype=np.int32
    )
    bending_middle: np.ndarray = entry(
        "bending middle",
        unit="m",
        meaning="mid-surface nodes of fibres that bend in the plane, in blocks",
    )
    bending_vector: np.ndarray = entry(
        "bending vector", unit="N", meaning="what they send to their neighbours, in blocks"
    )
    ply_ahead: np.ndarray = entry(
        "xyz", "ply point", unit="m", meaning="positions in the middle of the time of a spring"
    )
    ply_held: np.ndarray = entry(
        "ply point", "depth and offset", unit="m", meaning="of points before a refresh"
    )
    ply_touching: np.ndarray = entry(
        "ply point", unit="1", meaning="facet of a point before a refresh", dtype=np.int32
    )
    ply_normal: np.ndarray = entry(
        "ply point", "xyz", unit="m2", meaning="sum of the normals of the facets around a node"
    )
    ply_sums: np.ndarray = entry(
        "ply chunk", "ply sum", unit="J, 1", meaning="of points, see lcmchain.interfaces.forces"
    )
    ply_corner: np.ndarray = entry(
        "ply point", "corner", unit="1", meaning="nodes of the facet of a point", dtype=np.int32
    )
    ply_interface: np.ndarray = entry(
        "ply span",
        "lowest and highest",
        unit="1",
        meaning="numbers of the interfaces that points of a span are on",
        dtype=np.int32,
    )
    ply_start: np.ndarray = entry(
        "ply list",
        unit="1",
        meaning="where the entries of a chunk begin in the lists",
        dtype=np.int32,
    )
    ply_run_start: np.ndarray = entry(
        "ply list", unit="1", meaning="first run of a chunk, each of one point", dtype=np.int32
    )
    ply_run_point: np.ndarray = entry(
        "ply list entry", unit="1", meaning="point of a run", dtype=np.int32
    )
    ply_run_item: np.ndarray = entry(
        "ply list border", unit="1", meaning="where a run begins in the lists", dtype=np.int32
    )
    ply_force: np.ndarray = entry(
        "ply point", "xyz", unit="N", meaning="on points that are near enough to act"
    )
    ply_near: np.ndarray = entry(
        "ply point", unit="1", meaning="whether a point is near enough to act", dtype=np.uint8
    )
    ply_node: np.ndarray = entry(
        "ply list entry", unit="1", meaning="node that it presses on", dtype=np.int32
    )
    ply_weight: np.ndarray = entry(
        "ply list entry", unit="1", meaning="and with which part of its force"
    )
    chunk_sums: np.ndarray = entry(
        "chunk", "chunk sum", unit="J, N, m", meaning="energies, tool forces, gaps by chunk"
    )
