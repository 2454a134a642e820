"""What an identification hands back: parameters with intervals, and curves of the fit."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from lcmchain.errors import InputError
from lcmchain.identification.regression import residual_autocorrelation

#: SI unit -> unit shown to people and written into scene files, and the factor between them.
SHOWN_UNITS = {
    "Pa": ("MPa", 1e-6),
    "N*m": ("N*mm", 1e3),
    "N": ("N", 1.0),
    "1/m": ("1/m", 1.0),
    "J/m2": ("J/m2", 1.0),
    "rad": ("deg", 180.0 / math.pi),
    "m": ("mm", 1e3),
    "Pa*s": ("Pa*s", 1.0),
    "s": ("s", 1.0),
    "J/mol": ("kJ/mol", 1e-3),
    "1": ("", 1.0),
}
# Half an interval this large, relative to the value, leaves a parameter undetermined.
_UNDETERMINED = 0.5
# Correlation of neighbouring residuals above which the intervals are too narrow.
_CORRELATED = 0.4


@dataclass(frozen=True)
class Parameter:
    """An identified parameter in SI units with its 95 % confidence interval."""

    name: str
    value: float
    unit: str
    low: float
    high: float

    @property
    def is_determined(self) -> bool:
        """False if the interval is wider than the value, so that the number says little."""
        return not (self.high - self.low) > 2.0 * _UNDETERMINED * abs(self.value)


@dataclass(frozen=True)
class Band:
    """Curve of the fit, with its pointwise 95 % confidence band where one is known."""

    x: np.ndarray
    y: np.ndarray
    label: str
    low: np.ndarray | None = None
    high: np.ndarray | None = None
    dashed: bool = False


@dataclass(frozen=True)
class Points:
    """Measured points and the group (specimen) that each belongs to."""

    x: np.ndarray
    y: np.ndarray
    label: str
    group: np.ndarray | None = None


@dataclass(frozen=True)
class LeftOut:
    """Rows of a test that do not enter the fit.

    Attributes
    ----------
    why : in words, with numbers.
    specimen : name of it, empty where the file has only one.
    lines : of the rows in the file, shape [row_count].
    driven, load : displacement, thickness or angle, and force or pressure [SI], shape [row_count].
    """

    why: str
    specimen: str
    lines: np.ndarray
    driven: np.ndarray
    load: np.ndarray


@dataclass(frozen=True)
class Panel:
    """One diagram of the fit, in the units written on its axes.

    ``left_out``: measured points that did not enter the fit.
    """

    x_label: str
    y_label: str
    points: tuple[Points, ...] = ()
    curves: tuple[Band, ...] = ()
    log_x: bool = False
    log_y: bool = False
    is_residual: bool = False
    data_end: float | None = None
    left_out: tuple[Points, ...] = ()


@dataclass(frozen=True)
class Identification:
    """Parameters of one part of a fabric law, identified from coupon tests.

    Attributes
    ----------
    law : ``"shear"``, ``"viscous shear"``, ``"shear friction"``, ``"compaction"``, ``"bending"``,
        ``"bending friction"`` or ``"off-axis"``.
    method : how, in words.
    noise_model : what the intervals assume about the errors of the measurement.
    interval_method : how the intervals were found.
    inputs : (name, value as text, origin) of every geometry and option used.
    parameters : of the scene's law.
    derived : further quantities found on the way, which the scene does not take.
    scene_table : table of the scene file that takes the parameters, ``"material.membrane"``.
    scene_entries : key -> text as it stands in the scene file.
    correlation : of the parameters, shape [parameter_count, parameter_count].
    condition : condition number of the scaled Jacobian.
    relative_noise : estimated relative standard deviation of the measurements.
    r_squared : coefficient of determination.
    warnings : what the data do not tell.
    objections : why the law does not describe the data; such a fit is handed out only where it was
        accepted (:func:`accepted`).
    holds : over which range the law describes them, in words; empty without objections.
    panels : diagrams.
    left_out : rows that were asked to be left out.
    """

    law: str
    method: str
    noise_model: str
    interval_method: str
    inputs: tuple[tuple[str, str, str], ...]
    parameters: tuple[Parameter, ...]
    derived: tuple[Parameter, ...]
    scene_table: str
    scene_entries: dict[str, str]
    correlation: np.ndarray
    condition: float
    relative_noise: float
    r_squared: float
    point_count: int
    warnings: tuple[str, ...]
    panels: tuple[Panel, ...] = field(repr=False)
    objections: tuple[str, ...] = ()
    holds: str = ""
    left_out: tuple[LeftOut, ...] = ()

    def __getitem__(self, name: str) -> Parameter:
        for parameter in (*self.parameters, *self.derived):
            if parameter.name == name:
                return parameter
        raise KeyError(name)


class FitRefusedError(InputError):
    """A fit that does not describe its data, and that was not accepted (exit code 2).

    ``result`` is the :class:`Identification`, for those who want to look at it all the same.
    """

    def __init__(self, result: Identification, file: str) -> None:
        self.result = result
        super().__init__(
            f"the {result.law} law does not describe these data: {'; '.join(result.objections)}. "
            f"{result.holds[:1].upper()}{result.holds[1:]}. To take the fit as it is: --accept "
            "(in Python accept=True)",
            file=file,
        )


def accepted(result: Identification, file: str, accept: bool) -> Identification:
    """Return a result that describes its data, or that the user takes as it is.

    Parameters
    ----------
    result : of the fit, with its objections.
    file : of the data, for the message.
    accept : whether the user takes a fit with objections; they then lead its warnings.

    Raises
    ------
    FitRefusedError : there are objections, and the user has not accepted them.
    """
    if not result.objections:
        return result
    if not accept:
        raise FitRefusedError(result, file)
    told = (*(f"accepted although {text}" for text in result.objections), result.holds)
    return replace(result, warnings=(*told, *result.warnings))


def mega_pascal(*values: float) -> str:
    """Write stiffnesses [Pa] as scene text, ten digits."""
    return " ".join(f"{value * 1e-6:.10g}" for value in values) + " MPa"


def general_warnings(
    parameters: Sequence[Parameter], residuals: np.ndarray, group: np.ndarray
) -> list[str]:
    """Return what any fit can be warned of: loose parameters, residuals that are not noise."""
    found = []
    loose = [p.name for p in parameters if not p.is_determined]
    if loose:
        found.append(
            f"the data do not determine {', '.join(loose)} "
            "(95 % interval wider than the value); test over a wider range or more specimens"
        )
    correlation = residual_autocorrelation(residuals, group)
    if len(residuals) >= 20 and correlation > _CORRELATED:
        found.append(
            f"neighbouring residuals are correlated ({correlation:.2f}): the law misses a trend of "
            "the data, or the errors are not independent; the true intervals are wider"
        )
    return found
