"""The interface of the forming unit, and the properties of a scene that decide it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from lcmchain.coupling.solids.stack import largest_ply
from lcmchain.elements.families import family_of
from lcmchain.errors import InputError
from lcmchain.fmu.forming.scene_parameters import scene_parameters
from lcmchain.fmu.variables import (
    COMMON_OUTPUTS,
    COMMON_PARAMETERS,
    STEP_OUTCOME,
    TIME,
    Kind,
    Variable,
    quoted,
)
from lcmchain.mesh.sheet_mesh import SheetMesh
from lcmchain.scene import Scene
from lcmchain.tools.motion import FIXED, GUIDED

# Groups: outputs that are computed together.
TOOLS, ENERGY, FIELDS, RATES, SOLVER, FLUID, STACK, BETWEEN, GRIPPERS, MEANS = (
    "tools", "energy", "fields", "rates", "solver", "fluid", "stack", "between plies", "grippers",
    "means",
)  # fmt: skip

#: Pore pressure that the fluid gives [Pa] per element; the unit's one field input.
PORE_PRESSURE = "pore_pressure"

# Suffix, kind, variability, unit, type, start, description.
MOTION_INPUTS = (
    ("drive", Kind.BOOLEAN, "discrete", None, None, False, "true: {tool} follows velocity_input"),
    ("velocity_input", Kind.REAL, "continuous", "m/s", "Velocity", 0.0,
     "velocity of {tool} along its direction while drive is true"),
    ("drive_to_position", Kind.BOOLEAN, "discrete", None, None, False,
     "true: {tool} is at position_input at the end of a step, at constant velocity over it"),
    ("position_input", Kind.REAL, "continuous", "m", "Length", 0.0,
     "travel of {tool} along its direction while drive_to_position is true"),
)  # fmt: skip
FORCE_INPUTS = (
    ("force_input", Kind.REAL, "continuous", "N", "Force", 0.0,
     "force added to the load of {tool} along its direction while it is guided"),
)  # fmt: skip

#: Inputs of a tool that turns.
TURN_INPUTS = (
    ("drive", Kind.BOOLEAN, "discrete", None, None, False, "true: {tool} follows velocity_input"),
    ("velocity_input", Kind.REAL, "continuous", "rad/s", "AngularVelocity", 0.0,
     "angular velocity of {tool} about its axis while drive is true"),
    ("drive_to_position", Kind.BOOLEAN, "discrete", None, None, False,
     "true: {tool} is at position_input at the end of a step, at constant velocity over it"),
    ("position_input", Kind.REAL, "continuous", "rad", "Angle", 0.0,
     "angle of {tool} about its axis while drive_to_position is true"),
)  # fmt: skip

# Suffix, unit, type, description.
FORCE_OUTPUTS = (
    ("force_x", "N", "Force", "force of the blank on {tool}, x component"),
    ("force_y", "N", "Force", "force of the blank on {tool}, y component"),
    ("force_z", "N", "Force", "force of the blank on {tool}, z component"),
)
TOOL_OUTPUTS = (
    ("travel", "m", "Length", "travel of {tool} along its direction"),
    ("velocity", "m/s", "Velocity", "velocity of {tool} along its direction"),
    ("force", "N", "Force",
     "force of the blank on {tool} along its direction (negative: it resists)"),
    *FORCE_OUTPUTS,
)  # fmt: skip
TURN_OUTPUTS = (
    ("angle", "rad", "Angle", "angle of {tool} about its axis"),
    ("angular_velocity", "rad/s", "AngularVelocity", "angular velocity of {tool} about its axis"),
    ("moment", "N.m", "Moment",
     "moment of the blank on {tool} about its axis (negative: it resists a turn forward)"),
    *FORCE_OUTPUTS,
)  # fmt: skip
#: Outputs of a gripper, behind its name; ``HOLDS`` tells whether it holds.
HOLDS = "holds"
GRIPPER_OUTPUTS = (
    ("grip_force_x", "N", "Force", "force of {gripper} on the blank, x component"),
    ("grip_force_y", "N", "Force", "force of {gripper} on the blank, y component"),
    ("grip_force_z", "N", "Force", "force of {gripper} on the blank, z component"),
    ("grip_travel_x", "m", "Length", "way of the place that {gripper} holds, x component"),
    ("grip_travel_y", "m", "Length", "way of the place that {gripper} holds, y component"),
    ("grip_travel_z", "m", "Length", "way of the place that {gripper} holds, z component"),
)  # fmt: skip
#: Outputs that swing from one step of the solver to the next have a mean, ``mean_force`` of
#: ``force``: those of these units.
UNITS_WITH_MEAN = ("N", "N.m")

# Name, unit, type, group, description.
SCALAR_OUTPUTS = (
    ("thickness_min", "m", "Thickness", FIELDS, "smallest thickness of all elements"),
    ("thickness_max", "m", "Thickness", FIELDS, "largest thickness of all elements"),
    ("fibre_volume_fraction_min", "1", "Fraction", FIELDS,
     "smallest fibre volume fraction of all elements"),
    ("fibre_volume_fraction_max", "1", "Fraction", FIELDS,
     "largest fibre volume fraction of all elements"),
    ("shear_angle_max", "rad", "Angle", FIELDS, "largest size of the shear angle of all elements"),
    ("kinetic_energy", "J", "Energy", ENERGY, "kinetic energy of the blank and of guided tools"),
    ("internal_energy", "J", "Energy", ENERGY, "strain energy of the blank"),
    ("hourglass_energy", "J", "Energy", ENERGY, "strain energy of the hourglass stabilisation"),
    ("external_work", "J", "Energy", ENERGY, "work of tools, forces and gravity so far"),
    ("energy_balance_error", "J", "Energy", ENERGY,
     "energy that appeared from nowhere (negative: was lost) so far"),
    ("critical_time_step", "s", "TimeStep", SOLVER, "stable time step of the explicit solver"),
)  # fmt: skip
STEP_COUNT = Variable(
    "step_count",
    Kind.INTEGER,
    "output",
    "discrete",
    "time steps of the explicit solver so far",
    group=SOLVER,
)

# Name, unit, type, group, description; per element.
FIELD_OUTPUTS = (
    ("thickness", "m", "Thickness", FIELDS, "thickness"),
    ("fibre_volume_fraction", "1", "Fraction", FIELDS, "fibre volume fraction"),
    ("shear_angle", "rad", "Angle", FIELDS, "shear angle, signed"),
    ("thickness_rate", "m/s", "ThicknessRate", RATES, "mean rate of thickness over the last step"),
    ("position_x", "m", "Length", FIELDS, "x of the element's centre"),
    ("position_y", "m", "Length", FIELDS, "y of the element's centre"),
    ("position_z", "m", "Length", FIELDS, "z of the element's centre"),
)
#: Fields of a stack of plies, one value per element of all plies: what lies over each other there.
STACK_FIELDS = (
    ("stack_thickness", "m", "Thickness", STACK, "thickness of all plies over each other"),
    ("stack_fibre_volume_fraction", "1", "Fraction", STACK,
     "fibre volume fraction of all plies over each other"),
)  # fmt: skip
#: Extrema that every ply of a stack has beside those of all plies.
PLY_SCALARS = tuple(entry for entry in SCALAR_OUTPUTS if entry[3] == FIELDS)
STACK_SCALARS = tuple(
    (f"{name}_{end}", unit, declared, group, f"{size} {text}")
    for name, unit, declared, group, text in STACK_FIELDS
    for end, size in (("min", "smallest"), ("max", "largest"))
)
#: Contact between plies: of every ply, on both of its faces, and of all plies.
BETWEEN_SCALARS = (
    ("ply_pressure_max", "Pa", "Pressure", BETWEEN,
     "largest pressure of another ply on a face in the last step of the solver"),
    ("slip_max", "m", "Length", BETWEEN,
     "largest distance that a node has slid on other plies since the start"),
    ("slip_path_max", "m", "Length", BETWEEN,
     "longest way that a node has slid on other plies since the start, to and fro"),
    ("sliding_part", "1", "Fraction", BETWEEN,
     "part of the area that touches another ply which slides in the last step of the solver"),
)  # fmt: skip
#: Input that says how the pore pressure is meant.
AT_REST = "pore_pressure_at_rest"
#: Fields that a fluid in the pores exchanges, by the names of
#: :mod:`lcmchain.coupling.iteration.interface`; ``fluid_thickness`` is its thickness, V/A.
FLUID_OUTPUTS: tuple[tuple[str, str, str | None, str, str], ...] = (
    ("volume", "m3", "Volume", FLUID, "volume of the element"),
    ("volume_rate", "m3/s", "VolumeFlowRate", FLUID, "mean rate of volume over the last step"),
    ("volume_rate_slope", "m3/(s.Pa)", None, FLUID,
     "estimated derivative of volume_rate by the pressure, for the fixed-stress split"),
    ("reference_pressure", "Pa", "Pressure", FLUID, "pressure that volume_rate belongs to"),
    ("pore_resistance", "Pa.s/m3", None, FLUID,
     "of the last step, by which pore_pressure at rest falls with the rate of volume"),
    ("area", "m2", "Area", FLUID, "area of the element's mid-surface"),
    ("area_rate", "m2/s", "AreaRate", FLUID, "mean rate of area over the last step"),
    ("fluid_thickness", "m", "Thickness", FLUID, "volume over area"),
    ("fluid_thickness_rate", "m/s", "ThicknessRate", FLUID,
     "mean rate of fluid_thickness over the last step"),
)  # fmt: skip

#: Fields of a unit of FMI 2 unless others are asked for: there every entry is a variable.
FIELDS_OF_FMI2 = (
    "thickness", "fibre_volume_fraction", "stack_thickness", "stack_fibre_volume_fraction",
)  # fmt: skip
#: Those that are added with a fluid.
FLUID_FIELDS_OF_FMI2 = (
    "volume_rate", "volume_rate_slope", "reference_pressure", "pore_resistance", "fluid_thickness",
)  # fmt: skip


class PlyAbilities(NamedTuple):
    """Abilities of a ply, which decide its variables; entries as in :class:`Abilities`."""

    name: str
    element_count: int
    edge_length: float
    has_thickness: bool
    has_fibre_volume_fraction: bool

    @property
    def prefix(self) -> str:
        """What the names of its variables begin with."""
        return f"{quoted(self.name)}."


class Abilities(NamedTuple):
    """What decides which variables a unit has.

    tools : name and kind of motion (:mod:`lcmchain.tools.motion`) of every tool.
    element_count : elements of the blank. edge_length : of the blank [m], the shortest one of a
        stack. title : of the scene.
    has_thickness : whether the elements predict a thickness, in a stack those of any ply.
    has_fibre_volume_fraction : whether they do, and the material states the density of its fibres.
    takes_pore_pressure : whether a fluid may act in the pores. surroundings : pressure around the
        sheet [Pa], in the scale of the fluid's.
    patch_count : values of a field at an interface coarser than the elements, 0 for one of each.
    plies : those of a stack, bottom first; none for one sheet.
    column_count : columns through a stack, which a fluid has its pressures in; 0 for one sheet.
    turning : names of the tools that turn. grippers : names of all grippers.
    """

    tools: Sequence[tuple[str, int]]
    element_count: int
    edge_length: float
    title: str
    has_thickness: bool
    has_fibre_volume_fraction: bool
    takes_pore_pressure: bool
    patch_count: int = 0
    surroundings: float = 0.0
    plies: Sequence[PlyAbilities] = ()
    column_count: int = 0
    turning: Sequence[str] = ()
    grippers: Sequence[str] = ()

    @property
    def field_size(self) -> int:
        """Number of values of a field."""
        return self.patch_count or self.element_count

    @property
    def fluid_size(self) -> int:
        """Number of values of a field that a fluid exchanges."""
        return self.column_count or self.field_size


def variables_of(
    scene: Scene,
    fields: Sequence[str] | None = None,
    *,
    pore_pressure: bool = False,
    patch_count: int = 0,
) -> tuple[Variable, ...]:
    """Return the interface of the unit that forms a scene."""
    settable = [parameter.variable for parameter in scene_parameters(scene)]
    abilities = abilities_of(scene, pore_pressure=pore_pressure, patch_count=patch_count)
    return forming_variables(abilities, settable, fields)


def abilities_of(scene: Scene, *, pore_pressure: bool = False, patch_count: int = 0) -> Abilities:
    """Return what decides the variables of the unit of a scene.

    Raises
    ------
    InputError : a pore pressure is asked for, but the elements have no thickness, or one of the
        plies is a film.
    """
    stack = scene.stack
    flat = next((ply.element.type for ply in stack if ply.element.type != "solid-shell"), None)
    if pore_pressure and flat is not None:
        raise InputError(
            f'a fluid acts in the thickness of the sheet, which element = "{flat}" '
            'does not predict; use element = "solid-shell"',
            key="element",
        )
    if pore_pressure and stack.films:
        raise InputError(
            f'lets a fluid act in all plies, but "{stack.films[0].name}" is a film, through which '
            "none flows; leave out --pore-pressure, or the film",
            key=f"{stack.films[0].key}.film",
        )
    meshes = meshes_of(scene)
    plies = [
        PlyAbilities(
            name=ply.name,
            element_count=mesh.element_count,
            edge_length=ply.blank.edge_length,
            has_thickness=ply.element.type == "solid-shell",
            has_fibre_volume_fraction=ply.element.type == "solid-shell"
            and ply.material.fibre_density is not None,
        )
        for ply, mesh in zip(stack, meshes, strict=True)
    ]
    return Abilities(
        tools=[(tool.name, tool.motion.kind) for tool in scene.tools],
        turning=[tool.name for tool in scene.tools if tool.motion.turns],
        grippers=[name for gripper in scene.grippers for name in gripper.names],
        element_count=sum(ply.element_count for ply in plies),
        edge_length=stack.shortest_edge,
        title=scene.title,
        has_thickness=any(ply.has_thickness for ply in plies),
        has_fibre_volume_fraction=any(ply.has_fibre_volume_fraction for ply in plies),
        takes_pore_pressure=pore_pressure,
        surroundings=surroundings_of(scene),
        patch_count=patch_count,
        plies=plies if len(plies) > 1 else (),
        column_count=meshes[largest_ply(meshes)].element_count
        if pore_pressure and len(plies) > 1
        else 0,
    )


def meshes_of(scene: Scene) -> list[SheetMesh]:
    """Return the meshes whose elements a unit counts: those of the model, bottom first."""
    return [family_of(ply.element).mesh_of(ply.build_blank()) for ply in scene.stack]


def surroundings_of(scene: Scene) -> float:
    """Return the pressure around the sheet [Pa]: that of the vents of a resin in it, or 0."""
    return 0.0 if scene.wet_forming is None else float(scene.wet_forming.vent_pressure)


# --- from the abilities to the variables ----------------------------------------------------------


def forming_variables(
    abilities: Abilities,
    scene_parameters: Iterable[Variable] = (),
    fields: Sequence[str] | None = None,
) -> tuple[Variable, ...]:
    """Return the interface of a unit that forms one scene, in the order of its value references.

    Parameters
    ----------
    abilities : of the scene.
    scene_parameters : entries of the scene that a master may set.
    fields : names of the fields, None for all that there are.

    Notes
    -----
    A tool that the scene moves (stroke, table) or guides takes inputs of motion, a guided one
    ``force_input`` as well; a fixed tool has no inputs.
    """
    inputs, outputs = _of_tools(abilities.tools, abilities.turning)
    scalars = [_output(*entry) for entry in SCALAR_OUTPUTS]
    scalars += _scalars_of_plies(abilities)
    if abilities.takes_pore_pressure:
        inputs.append(
            Variable(
                PORE_PRESSURE,
                Kind.REAL,
                "input",
                "continuous",
                f"pressure of the fluid in the {_where(abilities)}, of the surroundings at "
                f"{abilities.surroundings:g}",
                "Pa",
                "Pressure",
                abilities.surroundings,
                nominal=1e5,
                size=abilities.fluid_size,
            )  # fmt: skip
        )
        inputs.append(
            Variable(
                AT_REST,
                Kind.BOOLEAN,
                "input",
                "discrete",
                "true: pore_pressure is that at rest, and falls within a step with the rate of "
                "volume by pore_resistance, which lets steps be longer than the thickness wave",
                start=False,
            )  # fmt: skip
        )
    variables = (
        TIME,
        *_constants(abilities),
        *COMMON_PARAMETERS,
        *scene_parameters,
        *inputs,
        *outputs,
        *scalars,
        STEP_COUNT,
        *COMMON_OUTPUTS,
        *_fields(abilities, fields),
        STEP_OUTCOME,
        *_of_grippers(abilities.grippers),
        *_means_of_forces(abilities),
    )
    left_out = {f"{name}{end}" for name in _unknown(abilities) for end in ("", "_min", "_max")}
    return tuple(v for v in variables if v.name not in left_out)


def field_names(abilities: Abilities) -> list[str]:
    """Return the names of all fields that a unit can give.

    One name stands for the field on every ply of a stack.
    """
    unknown = _unknown(abilities)
    known = [field for field, variable in _all_fields(abilities) if variable.name not in unknown]
    return list(dict.fromkeys(known))


def _unknown(abilities: Abilities) -> set[str]:
    """Return the fields that the elements do not predict, by the names of their variables."""
    unknown = set(_unknown_of_sheet(abilities))
    for ply in abilities.plies:
        unknown |= {f"{ply.prefix}{name}" for name in _unknown_of_sheet(ply)}
        # a sum over the plies is not known where one of them is not
        unknown |= {f"stack_{name}" for name in _unknown_of_sheet(ply)}
    return unknown


def _unknown_of_sheet(sheet: Abilities | PlyAbilities) -> tuple[str, ...]:
    """Return the fields of :data:`FIELD_OUTPUTS` that the elements do not predict."""
    left_out = () if sheet.has_thickness else ("thickness", "thickness_rate")
    return left_out + (() if sheet.has_fibre_volume_fraction else ("fibre_volume_fraction",))


def _fields(abilities: Abilities, names: Sequence[str] | None) -> list[Variable]:
    return [v for field, v in _all_fields(abilities) if names is None or field in names]


def _all_fields(abilities: Abilities) -> list[tuple[str, Variable]]:
    """Return the variables of all fields, each behind the name that asks for it."""
    count, of_fluid = abilities.field_size, []
    if abilities.takes_pore_pressure:
        of_fluid = [(entry[0], _of_fluid(abilities, *entry)) for entry in FLUID_OUTPUTS]
    if not abilities.plies:
        return [(entry[0], _output(*entry, size=count)) for entry in FIELD_OUTPUTS] + of_fluid
    variables = [
        (entry[0], _of_ply(ply, entry, size=ply.element_count))
        for ply in abilities.plies
        for entry in FIELD_OUTPUTS
    ]
    variables += [(entry[0], _output(*entry, size=count)) for entry in STACK_FIELDS]
    return variables + of_fluid


def _where(abilities: Abilities) -> str:
    """Say what a fluid has one pressure in."""
    return "column through all plies" if abilities.column_count else "element's pores"


def _of_fluid(
    abilities: Abilities, name: str, unit: str, declared: str | None, group: str, text: str
) -> Variable:
    if abilities.column_count:
        text = text.replace("the element's mid-surface", "the column across")
        text = text.replace("of the element", "of the column through all plies")
    return _output(name, unit, declared, group, text, size=abilities.fluid_size)


def _scalars_of_plies(abilities: Abilities) -> list[Variable]:
    """Extrema of every ply, of what lies over each other, and of what is between the plies."""
    if not abilities.plies:
        return []
    variables = [
        _of_ply(ply, entry) for ply in abilities.plies for entry in (*PLY_SCALARS, *BETWEEN_SCALARS)
    ]
    return variables + [_output(*entry) for entry in (*STACK_SCALARS, *BETWEEN_SCALARS)]


def _of_ply(ply: PlyAbilities, entry: tuple[str, ...], size: int | None = None) -> Variable:
    name, unit, declared, group, text = entry
    return _output(
        f"{ply.prefix}{name}", unit, declared, group, f"ply {ply.name}: {text}", size=size
    )


def _of_tools(
    tools: Sequence[tuple[str, int]], turning: Sequence[str]
) -> tuple[list[Variable], list[Variable]]:
    inputs, outputs = [], []
    for tool, motion_kind in tools:
        prefix = quoted(tool)
        turns = tool in turning
        entries: tuple[tuple, ...] = TURN_INPUTS if turns else MOTION_INPUTS
        if motion_kind == FIXED:
            entries = ()
        entries += FORCE_INPUTS if motion_kind == GUIDED else ()
        for suffix, kind, variability, unit, declared, start, text in entries:
            name, description = f"{prefix}.{suffix}", text.format(tool=tool)
            inputs.append(
                Variable(name, kind, "input", variability, description, unit, declared, start)
            )
        for suffix, unit, declared, text in TURN_OUTPUTS if turns else TOOL_OUTPUTS:
            name, description = f"{prefix}.{suffix}", text.format(tool=tool)
            outputs.append(_output(name, unit, declared, TOOLS, description))
    return inputs, outputs


def _of_grippers(names: Sequence[str]) -> list[Variable]:
    """Force, way and hold of every gripper."""
    outputs = []
    for gripper in names:
        prefix = quoted(gripper)
        for suffix, unit, declared, text in GRIPPER_OUTPUTS:
            description = text.format(gripper=gripper)
            outputs.append(_output(f"{prefix}.{suffix}", unit, declared, GRIPPERS, description))
        outputs.append(
            Variable(
                f"{prefix}.{HOLDS}",
                Kind.BOOLEAN,
                "output",
                "discrete",
                f"whether {gripper} is at work and has not let go",
                group=GRIPPERS,
            )
        )
    return outputs


def _means_of_forces(abilities: Abilities) -> list[Variable]:
    """Forces and moments of tools and grippers as means over the last step of the master."""
    turning = abilities.turning
    own: list[tuple[str, tuple]] = [
        (tool, TURN_OUTPUTS if tool in turning else TOOL_OUTPUTS) for tool, _ in abilities.tools
    ]
    own += [(gripper, GRIPPER_OUTPUTS) for gripper in abilities.grippers]
    return [
        _output(
            f"{quoted(owner)}.mean_{suffix}", unit, declared, MEANS,
            f"mean over the last step: {text.format(tool=owner, gripper=owner)}",
        )
        for owner, entries in own
        for suffix, unit, declared, text in entries
        if unit in UNITS_WITH_MEAN
    ]  # fmt: skip


def _constants(abilities: Abilities) -> list[Variable]:
    """Return what was fixed when the unit was built: it decides how many values a field has."""

    def constant(name, kind, description, start, unit=None, declared=None):
        return Variable(name, kind, "local", "constant", description, unit, declared, start)

    return [
        constant("scene", Kind.STRING, "title of the scene", abilities.title),
        constant("edge_length", Kind.REAL, "edge length of the elements of the blank",
                 abilities.edge_length, "m", "Length"),
        constant("element_count", Kind.INTEGER, "elements of the blank", abilities.element_count),
        *(
            constant(f"{ply.prefix}{name}", kind, f"ply {ply.name}: {text}", *start)
            for ply in abilities.plies
            for name, kind, text, start in (
                ("edge_length", Kind.REAL, "edge length of the elements",
                 (ply.edge_length, "m", "Length")),
                ("element_count", Kind.INTEGER, "elements", (ply.element_count,)),
            )
        ),
    ]  # fmt: skip


def _output(name, unit, declared, group, description, size=None):
    return Variable(
        name, Kind.REAL, "output", "continuous", description, unit, declared, size=size,
        group=group,
    )  # fmt: skip
