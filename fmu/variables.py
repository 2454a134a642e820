"""The interface of the forming unit as data: one definition, for FMI 2 and FMI 3.

A field over the elements is one variable with a ``size``. FMI 3 passes it as one array; FMI 2 has
no arrays, so that there every element becomes a scalar variable ``name[i]``. Indices start at 1 as
in all structured FMI names: ``thickness[1]`` belongs to element 0 (face 0 of ``forming.nc``).
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import Enum

from lcmchain.tools.motion import FIXED, GUIDED


class Kind(Enum):
    """Type of a variable."""

    REAL = "Real"
    INTEGER = "Integer"
    BOOLEAN = "Boolean"
    STRING = "String"


class Group(Enum):
    """Outputs that are computed together, and only when a master asks for one of them."""

    TOOLS = "tools"
    ENERGY = "energy"
    FIELDS = "fields"
    SOLVER = "solver"


@dataclass(frozen=True)
class Variable:
    """One entry of the interface.

    Parameters
    ----------
    name : structured FMI name.
    kind, causality, variability : as in the FMI standard.
    unit : key of :data:`UNITS`, None where a unit has no meaning.
    start : value before the first step; None for outputs, which are computed.
    size : number of elements of a field, None for a scalar.
    group : outputs that are computed with it.
    """

    name: str
    kind: Kind
    causality: str
    variability: str
    description: str
    unit: str | None = None
    start: float | int | bool | str | None = None
    size: int | None = None
    group: Group | None = None

    def scalars(self) -> Iterator[tuple[str, str]]:
        """Yield name and description of every scalar that stands for the variable in FMI 2."""
        if self.size is None:
            yield self.name, self.description
            return
        for element in range(self.size):
            yield f"{self.name}[{element + 1}]", f"{self.description}, element {element}"


#: Units and their exponents of the SI base units.
UNITS: dict[str, dict[str, int]] = {
    "m": {"m": 1},
    "m/s": {"m": 1, "s": -1},
    "N": {"kg": 1, "m": 1, "s": -2},
    "J": {"kg": 1, "m": 2, "s": -2},
    "s": {"s": 1},
    "rad": {"rad": 1},
    "1": {},
}

PARAMETERS = (
    Variable(
        "threads",
        Kind.INTEGER,
        "parameter",
        "fixed",
        "threads of the compiled loops, 0 = all cores; the results do not depend on it",
        start=0,
    ),
    Variable(
        "out_dir",
        Kind.STRING,
        "parameter",
        "fixed",
        "folder for forming.nc, written when the simulation is terminated; empty = write nothing",
        start="",
    ),
)

# Suffix, kind, variability, unit, start, description; held constant over a communication step.
MOTION_INPUTS = (
    ("drive", Kind.BOOLEAN, "discrete", None, False, "true: {tool} follows velocity_input"),
    (
        "velocity_input",
        Kind.REAL,
        "continuous",
        "m/s",
        0.0,
        "velocity of {tool} along its direction while drive is true",
    ),
)
FORCE_INPUTS = (
    (
        "force_input",
        Kind.REAL,
        "continuous",
        "N",
        0.0,
        "force on {tool} along its direction, added to that of the scene",
    ),
)

# Suffix, unit, description.
TOOL_OUTPUTS = (
    ("travel", "m", "travel of {tool} along its direction"),
    ("velocity", "m/s", "velocity of {tool} along its direction"),
    ("force", "N", "force of the blank on {tool} along its direction (negative: it resists)"),
    ("force_x", "N", "force of the blank on {tool}, x component"),
    ("force_y", "N", "force of the blank on {tool}, y component"),
    ("force_z", "N", "force of the blank on {tool}, z component"),
)

# Name, unit, group, description.
SCALAR_OUTPUTS = (
    ("thickness_min", "m", Group.FIELDS, "smallest thickness of all elements"),
    ("thickness_max", "m", Group.FIELDS, "largest thickness of all elements"),
    (
        "fibre_volume_fraction_min",
        "1",
        Group.FIELDS,
        "smallest fibre volume fraction of all elements",
    ),
    (
        "fibre_volume_fraction_max",
        "1",
        Group.FIELDS,
        "largest fibre volume fraction of all elements",
    ),
    ("shear_angle_max", "rad", Group.FIELDS, "largest size of the shear angle of all elements"),
    ("kinetic_energy", "J", Group.ENERGY, "kinetic energy of the blank and of guided tools"),
    ("internal_energy", "J", Group.ENERGY, "strain energy of the blank"),
    ("hourglass_energy", "J", Group.ENERGY, "strain energy of the hourglass stabilisation"),
    ("external_work", "J", Group.ENERGY, "work of tools, forces and gravity so far"),
    (
        "energy_balance_error",
        "J",
        Group.ENERGY,
        "energy that appeared from nowhere (negative: was lost) so far",
    ),
    ("critical_time_step", "s", Group.SOLVER, "stable time step of the explicit solver"),
)
STEP_COUNT = Variable(
    "step_count",
    Kind.INTEGER,
    "output",
    "discrete",
    "time steps of the explicit solver so far",
    group=Group.SOLVER,
)

# Name, unit, description.
FIELD_OUTPUTS = (
    ("thickness", "m", "thickness"),
    ("fibre_volume_fraction", "1", "fibre volume fraction"),
)


def forming_variables(
    tools: Sequence[tuple[str, int]],
    element_count: int,
    *,
    has_thickness: bool = True,
    has_fibre_volume_fraction: bool,
) -> tuple[Variable, ...]:
    """Return the interface of a unit that forms one scene, in the order of its value references.

    Parameters
    ----------
    tools : name and kind of motion (:mod:`lcmchain.tools.motion`) of every tool.
    element_count : elements of the blank.
    has_thickness : whether the elements predict a thickness.
    has_fibre_volume_fraction : whether they do, and the material states the density of its fibres.

    Notes
    -----
    A tool that the scene moves (stroke, table) or guides takes ``drive`` and ``velocity_input``, a
    guided one ``force_input`` as well; a fixed tool has no inputs.
    """
    inputs, outputs = [], []
    for tool, motion_kind in tools:
        prefix = quoted(tool)
        entries: tuple[tuple, ...] = () if motion_kind == FIXED else MOTION_INPUTS
        entries += FORCE_INPUTS if motion_kind == GUIDED else ()
        for suffix, kind, variability, unit, start, text in entries:
            name, description = f"{prefix}.{suffix}", text.format(tool=tool)
            inputs.append(Variable(name, kind, "input", variability, description, unit, start))
        for suffix, unit, text in TOOL_OUTPUTS:
            outputs.append(_output(f"{prefix}.{suffix}", unit, Group.TOOLS, text.format(tool=tool)))
    scalars = [_output(*entry) for entry in SCALAR_OUTPUTS]
    fields = [
        _output(name, unit, Group.FIELDS, text, element_count) for name, unit, text in FIELD_OUTPUTS
    ]
    variables = (*PARAMETERS, *inputs, *outputs, *scalars, STEP_COUNT, *fields)
    left_out: tuple[str, ...] = () if has_fibre_volume_fraction else ("fibre_volume_fraction",)
    left_out += () if has_thickness else ("thickness",)
    return tuple(v for v in variables if not v.name.startswith(left_out))


def quoted(name: str) -> str:
    """Return a name as an identifier of the structured naming convention, quoted if need be."""
    return name if re.fullmatch(r"[A-Za-z_]\w*", name, re.ASCII) else f"'{name}'"


def _output(name: str, unit: str, group: Group, description: str, size: int | None = None):
    return Variable(
        name, Kind.REAL, "output", "continuous", description, unit, size=size, group=group
    )
