"""The interface of the infiltration unit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

from lcmchain.fmu.variables import (
    COMMON_OUTPUTS,
    COMMON_PARAMETERS,
    STEP_OUTCOME,
    TIME,
    Causality,
    Kind,
    Variability,
    Variable,
    quoted,
)

# Groups: outputs that are computed together.
PLACES, SUMS, FIELDS = "places", "sums", "fields"

#: How the master moves the preform: not at all, by its thickness, or by the rate of its volume.
Motion = Literal["none", "thickness", "volume"]
MOTIONS: tuple[Motion, ...] = ("none", "thickness", "volume")

#: Values of the output ``front``, by the outcome of a filling.
FRONT = {"reached": 0, "filled": 1, "gelled": 2, "no_source": 3, "trapped": 4}

# Suffix, kind, variability, unit, type, description.
GATE_INPUTS: tuple[tuple[str, Kind, Variability, str | None, str | None, str], ...] = (
    ("drive", Kind.BOOLEAN, "discrete", None, None,
     "true: {name} is open and follows its input instead of the scene"),
    ("pressure_input", Kind.REAL, "continuous", "Pa", "Pressure",
     "pressure of {name} while drive is true"),
    ("flow_rate_input", Kind.REAL, "continuous", "m3/s", "VolumeFlowRate",
     "flow rate of {name} while drive is true"),
    ("closed", Kind.BOOLEAN, "discrete", None, None, "true: {name} is shut, whatever else is set"),
)  # fmt: skip
GATE_OUTPUTS: tuple[tuple[str, str, str, str], ...] = (
    ("pressure", "Pa", "Pressure", "pressure of {name}, 0 while it is closed"),
    ("flow_rate", "m3/s", "VolumeFlowRate", "flow rate of {name}, 0 while it is closed"),
    ("injected_volume", "m3", "Volume", "resin that has entered through {name}"),
)
VENT_OUTPUTS: tuple[tuple[str, str, str, str], ...] = (
    ("flow_rate", "m3/s", "VolumeFlowRate",
     "mean rate over the last step of resin leaving through {name}"),
    ("vented_volume", "m3", "Volume", "resin that has left through {name}"),
)  # fmt: skip

# Name, kind, unit, type, description.
SUM_OUTPUTS: tuple[tuple[str, Kind, str | None, str | None, str], ...] = (
    ("fill_fraction", Kind.REAL, "1", "Fraction", "resin over pore volume of the whole part"),
    ("injected_volume", Kind.REAL, "m3", "Volume", "resin that has entered through all gates"),
    ("vented_volume", Kind.REAL, "m3", "Volume", "resin that has left through all vents"),
    ("stored_volume", Kind.REAL, "m3", "Volume", "resin in the part"),
    ("balance_error", Kind.REAL, "m3", "Volume",
     "what entered and did not leave, less what is stored"),
    ("pressure_max", Kind.REAL, "Pa", "Pressure", "largest pressure of all nodes"),
    ("pressure_force", Kind.REAL, "N", "Force", "integral of the pressure over the part"),
    ("front", Kind.INTEGER, None, None,
     "what the front does: 0 it moves or waits, 1 all is filled, 2 the resin has gelled, 3 no gate "
     "is open, 4 what is dry cannot be reached"),
    ("dry_spot_count", Kind.INTEGER, None, None, "pockets of air that the front has enclosed"),
    ("step_count", Kind.INTEGER, None, None, "time steps of the filling so far"),
)  # fmt: skip

# Name, unit, type, description; per cell, or per patch of cells.
FIELD_OUTPUTS: tuple[tuple[str, str, str, str], ...] = (
    ("pore_pressure", "Pa", "Pressure", "pressure of the resin, of the air where there is none"),
    (
        "pressure_at_rest",
        "Pa",
        "Pressure",
        "pore_pressure, and pore_resistance times the rate of volume",
    ),
    ("fill_factor", "1", "Fraction", "share of the pores that resin fills"),
    ("preform_thickness", "m", "Thickness", "thickness of the preform"),
    ("preform_volume", "m3", "Volume", "volume of the preform"),
)
#: Fields of a unit of FMI 2 unless others are asked for: there every entry is a variable.
FIELDS_OF_FMI2 = ("pore_pressure", "fill_factor")

# By motion: name, unit, type, nominal, description.
FIELD_INPUTS: dict[Motion, tuple[tuple[str, str, str | None, float, str], ...]] = {
    "none": (),
    "thickness": (
        ("thickness", "m", "Thickness", 1e-3,
         "thickness at the end of a step; 0: where thickness_rate leads"),
        ("thickness_rate", "m/s", "ThicknessRate", 1e-5,
         "mean rate of thickness over a step, where thickness is 0"),
    ),
    "volume": (
        ("volume_rate", "m3/s", "VolumeFlowRate", 1e-9, "mean rate of volume over a step"),
        ("volume_rate_slope", "m3/(s.Pa)", None, 1e-14,
         "derivative of volume_rate by the pressure, for the fixed-stress split; 0: none"),
        ("reference_pressure", "Pa", "Pressure", 1e5, "pressure that volume_rate belongs to"),
        ("pore_resistance", "Pa.s/m3", None, 1e12,
         "by which the solid lets pressure_at_rest fall with the rate of volume; 0: none"),
    ),
}  # fmt: skip


@dataclass(frozen=True)
class Abilities:
    """What decides which variables a unit has.

    gates : name of every gate, and whether a rate is prescribed for it. vents : names.
    size : values of a field. cell_count : cells of the part. title : of the part.
    motion : how the master moves the preform.
    """

    gates: Sequence[tuple[str, bool]]
    vents: Sequence[str]
    size: int
    cell_count: int
    title: str
    motion: Motion


def infiltration_variables(
    abilities: Abilities, fields: Sequence[str] | None = None
) -> tuple[Variable, ...]:
    """Return the interface of a unit that fills one part, in the order of its value references.

    fields : names of the fields, None for all that there are.
    """
    per = "cell" if abilities.size == abilities.cell_count else "patch of cells"
    inputs, outputs = _of_places(abilities)
    for name, unit, declared, nominal, text in FIELD_INPUTS[abilities.motion]:
        inputs.append(
            Variable(
                name,
                Kind.REAL,
                "input",
                "continuous",
                f"{text}, per {per}",
                unit,
                declared,
                0.0,
                nominal=nominal,
                size=abilities.size,
            )  # fmt: skip
        )
    return (
        TIME,
        *_constants(abilities),
        *COMMON_PARAMETERS,
        *inputs,
        *outputs,
        *(_output(*entry, SUMS) for entry in SUM_OUTPUTS),
        *COMMON_OUTPUTS,
        *(
            _output(name, Kind.REAL, unit, declared, f"{text}, per {per}", FIELDS, abilities.size)
            for name, unit, declared, text in FIELD_OUTPUTS
            if fields is None or name in fields
        ),
        STEP_OUTCOME,
        _output("front_state", Kind.INTEGER, None, "FrontState", "front, as an enumeration", SUMS),
    )


def _of_places(abilities: Abilities) -> tuple[list[Variable], list[Variable]]:
    inputs, outputs = [], []
    places = [(name, "flow_rate_input" if by_rate else "pressure_input", GATE_OUTPUTS)
              for name, by_rate in abilities.gates]  # fmt: skip
    places += [(name, "pressure_input", VENT_OUTPUTS) for name in abilities.vents]
    for name, own, told in places:
        for suffix, kind, variability, unit, declared, text in GATE_INPUTS:
            if suffix.endswith("_input") and suffix != own:
                continue
            start: Any = False if kind is Kind.BOOLEAN else 0.0
            description = text.format(name=name)
            inputs.append(
                Variable(
                    f"{quoted(name)}.{suffix}",
                    kind,
                    "input",
                    variability,
                    description,
                    unit,
                    declared,
                    start,
                )  # fmt: skip
            )
        for suffix, unit, declared, text in told:
            outputs.append(
                _output(
                    f"{quoted(name)}.{suffix}",
                    Kind.REAL,
                    unit,
                    declared,
                    text.format(name=name),
                    PLACES,
                )  # fmt: skip
            )
    return inputs, outputs


def _constants(abilities: Abilities) -> list[Variable]:
    """Return what was fixed when the unit was built: it decides how many values a field has."""
    constant: tuple[Causality, Variability] = ("local", "constant")
    return [
        Variable("scene", Kind.STRING, *constant, "title of the part", start=abilities.title),
        Variable("cell_count", Kind.INTEGER, *constant, "cells of the part",
                 start=abilities.cell_count),
        Variable("interface_size", Kind.INTEGER, *constant, "values of every field",
                 start=abilities.size),
    ]  # fmt: skip


def _output(
    name: str,
    kind: Kind,
    unit: str | None,
    declared: str | None,
    description: str,
    group: str,
    size: int | None = None,
) -> Variable:
    variability: Variability = "continuous" if kind is Kind.REAL else "discrete"
    return Variable(
        name, kind, "output", variability, description, unit, declared, size=size, group=group
    )
