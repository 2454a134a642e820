"""From a coupon file and the sizes of the specimen to identified parameters.

Sizes that are not given are those of MD600 and its published tests; the result lists the origin of
every one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Protocol

from lcmchain.coupons.analytic import BiasExtension, PictureFrame, load_parameter_at_chord_angle
from lcmchain.errors import InputError
from lcmchain.identification import (
    bending,
    cantilever_tests,
    compaction,
    off_axis,
    shear,
    sheared_compaction,
    viscous_shear,
)
from lcmchain.identification.data import Column, CouponData, read_coupon
from lcmchain.identification.entering_rows import (
    WITHOUT,
    Axes,
    RowChoice,
    entering_rows,
    found_drops,
    with_left_out,
)
from lcmchain.identification.loops import bending as bending_loop
from lcmchain.identification.loops import shear as shear_loop
from lcmchain.identification.result import FitRefusedError, Identification
from lcmchain.quantities.units import (
    ANGLE,
    AREAL_MASS,
    DENSITY,
    LENGTH,
    Dimension,
    QuantityError,
    parse_quantity,
)
from lcmchain.scene.presets import MD600
from lcmchain.tools.motion import STANDARD_GRAVITY

#: Size -> dimension, default and where the default comes from.
SIZES: dict[str, tuple[Dimension, str, str]] = {
    "length": (LENGTH, "320 mm", "default, paper section 3.2.1"),
    "width": (LENGTH, "160 mm", "default, paper section 3.2.1"),
    "strip_length": (LENGTH, "160 mm", "default, lcmchain coupon off-axis"),
    "strip_width": (LENGTH, "40 mm", "default, lcmchain coupon off-axis"),
    "side": (LENGTH, "200 mm", "default, lcmchain coupon picture-frame"),
    "thickness": (LENGTH, MD600["thickness"], "default, MD600"),
    "areal_mass": (AREAL_MASS, MD600["areal_mass"], "default, MD600"),
    "fibre_density": (DENSITY, MD600["fibre_density"], "default, MD600"),
    "angle": (ANGLE, "41.5 deg", "default, ISO 9073-7"),
}

NOTHING_ASKED = RowChoice()
#: Tests that tell the shear polynomial, and the sizes of their specimens.
TESTS = {
    "bias-extension": ("length", "width", "thickness"),
    "picture-frame": ("side", "thickness"),
}


def identify_shear_file(
    path: Path,
    sizes: Mapping[str, str | None],
    *,
    columns: str | None = None,
    method: str = "force",
    convention: str = "engineering",
    noise_floor: float = 0.01,
    accept: bool = False,
    rows: RowChoice = NOTHING_ASKED,
    test: str = "bias-extension",
    measured_angle: bool = False,
) -> Identification:
    """Identify the shear polynomial from a file; ``sizes``: length, width, thickness as text.

    ``test``: ``"bias-extension"``, or ``"picture-frame"`` with the sizes side and thickness.
    ``measured_angle`` takes a column ``shear angle`` also where there is a displacement.
    ``rows``: zeros, slip and tear, and range (:mod:`lcmchain.identification.entering_rows`).

    ``accept`` takes the fit as it is where the law does not describe the data.

    Raises
    ------
    InputError : a wrong file, size or choice.
    FitRefusedError : the law does not describe the data, and ``accept`` is not given.
    """
    _require_choice("--method", method, shear.METHODS)
    _require_choice("--convention", convention, ("engineering", "tensor"))
    _require_fraction("--noise-floor", noise_floor)
    _require_choice("--test", test, TESTS)
    _require_sizes_of(TESTS[test], sizes)
    values, inputs = _sizes(sizes, TESTS[test])
    specimen: shear.Specimen
    if test == "picture-frame":
        specimen = PictureFrame(**values)
        if method != "force":
            raise InputError("a picture frame needs no recursion", key="--method")
    else:
        try:
            specimen = BiasExtension(**values)
        except InputError as error:
            raise InputError(error.message, key="--length and --width") from None
    inputs.append(("convention", _CONVENTION[convention], f"--convention {convention}"))
    layouts = shear.ANGLE_COLUMNS if measured_angle else (*shear.COLUMNS, *shear.ANGLE_COLUMNS)
    data = read_coupon(path, layouts, minimum_rows=shear.MINIMUM_ROWS, columns=columns)
    axes = Axes(*(shear.COLUMNS if "displacement" in data else shear.ANGLE_COLUMNS)[0])
    return _fitted(
        lambda kept, told: shear.identify_shear(
            kept, specimen, method=method, convention=convention, noise_floor=noise_floor,
            inputs=told, accept=accept,
        ),
        data, _with_file(inputs, data), rows, axes, shear.MINIMUM_ROWS,
    )  # fmt: skip


def identify_viscous_file(
    path: Path,
    sizes: Mapping[str, str | None],
    *,
    columns: str | None = None,
    noise_floor: float = 0.01,
    accept: bool = False,
    rows: RowChoice = NOTHING_ASKED,
) -> Identification:
    """Identify shear polynomial and viscosity from a file; ``sizes``: side, thickness as text.

    ``accept`` takes the fit as it is where the law does not describe the data.

    Raises
    ------
    InputError : a wrong file or size.
    FitRefusedError : the law does not describe the data, and ``accept`` is not given.
    """
    values, data, inputs = _test(
        path, sizes, ("side", "thickness"), viscous_shear, noise_floor, columns
    )
    driven, load = viscous_shear.COLUMNS[1][:2]
    return _fitted(
        lambda kept, told: viscous_shear.identify_viscous_shear(
            kept, PictureFrame(**values), noise_floor=noise_floor, inputs=told, accept=accept
        ),
        data, inputs, rows, Axes(driven, load, remembers=True), viscous_shear.MINIMUM_ROWS,
    )  # fmt: skip


def identify_off_axis_file(
    path: Path,
    sizes: Mapping[str, str | None],
    *,
    columns: str | None = None,
    noise_floor: float = 0.01,
    accept: bool = False,
    rows: RowChoice = NOTHING_ASKED,
) -> Identification:
    """Identify a unidirectional fabric from off-axis tension, as :func:`identify_shear_file`.

    ``sizes``: strip_length, strip_width and thickness as text.

    Raises
    ------
    InputError : a wrong file or size.
    FitRefusedError : the law does not describe the data, and ``accept`` is not given.
    """
    names = ("strip_length", "strip_width", "thickness")
    values, data, inputs = _test(path, sizes, names, off_axis, noise_floor, columns)
    return _fitted(
        lambda kept, told: off_axis.identify_off_axis(
            kept, length=values["strip_length"], width=values["strip_width"],
            thickness=values["thickness"], noise_floor=noise_floor, inputs=told, accept=accept,
        ),
        data, inputs, rows, Axes(*off_axis.COLUMNS[0][1:]), off_axis.MINIMUM_ROWS,
    )  # fmt: skip


def identify_compaction_file(
    path: Path,
    sizes: Mapping[str, str | None],
    *,
    columns: str | None = None,
    noise_floor: float = 0.001,
    table: bool = False,
    accept: bool = False,
    rows: RowChoice = NOTHING_ASKED,
) -> Identification:
    """Identify the compaction law; ``sizes``: thickness, areal_mass, fibre_density as text.

    A file with a column ``shear angle`` tells the shear-compaction coupling too: one exponent, or
    with ``table`` pressures at every angle. A file with a column ``time`` whose tests hold their
    gap in the end tells what relaxes. A column ``fibre volume fraction`` may stand in place of the
    thickness.

    ``accept`` takes the fit as it is where the law does not describe the data.

    Raises
    ------
    InputError : a wrong file or size.
    FitRefusedError : the law does not describe the data, and ``accept`` is not given.
    """
    _require_fraction("--noise-floor", noise_floor)
    values, inputs = _sizes(sizes, ("thickness", "areal_mass", "fibre_density"))
    layouts = (
        *sheared_compaction.SHEARED_COLUMNS, *compaction.COLUMNS, *compaction.FRACTION_COLUMNS,
    )  # fmt: skip
    data = read_coupon(path, layouts, minimum_rows=compaction.MINIMUM_ROWS, columns=columns)
    solid_height = values["areal_mass"] / values["fibre_density"]
    axes = Axes(*compaction.COLUMNS[0])
    if "thickness" not in data:
        data = compaction.with_thickness(data, solid_height)
        drawn = ("thickness", lambda fraction: solid_height / fraction)
        axes = Axes(*compaction.FRACTION_COLUMNS[0], drawn=drawn)
    identify, remembers = compaction.identify_compaction, False
    if sheared_compaction.SHEAR_ANGLE in data:
        identify = sheared_compaction.identify_sheared_compaction
        if table:
            identify = sheared_compaction.identify_pressure_table
    elif compaction.held_rows(data).any():
        identify, remembers = compaction.identify_relaxing_compaction, True
    if table and sheared_compaction.SHEAR_ANGLE not in data:
        raise InputError(
            "needs tests of sheared fabric: a column as shear angle [deg]", key="--table", file=path
        )
    return _fitted(
        lambda kept, told: identify(
            kept, thickness=values["thickness"], solid_height=solid_height,
            noise_floor=noise_floor, inputs=told, accept=accept,
        ),
        data, _with_file(inputs, data), rows, axes._replace(remembers=remembers),
        compaction.MINIMUM_ROWS,
    )  # fmt: skip


def identify_bending_file(
    path: Path,
    sizes: Mapping[str, str | None],
    *,
    columns: str | None = None,
    off_axis: str = "free-strip",
    curve: bool = False,
    accept: bool = False,
) -> Identification:
    """Identify the bending stiffness; ``sizes``: thickness, areal_mass, angle as text.

    ``curve`` finds moments over curvature from deflection curves, beside the constants.
    ``accept`` takes the fit as it is where the law does not describe the data.

    Raises
    ------
    InputError : a wrong file, size or choice.
    FitRefusedError : the law does not describe the data, and ``accept`` is not given.
    """
    _require_choice("--off-axis", off_axis, bending.ASSUMPTIONS)
    values, inputs = _sizes(sizes, ("thickness", "areal_mass", "angle"))
    try:
        load_parameter_at_chord_angle(values["angle"])
    except ValueError as error:
        raise InputError(str(error), key="--angle") from None
    inputs.append(("off-axis strip", bending.ASSUMPTIONS[off_axis], f"--off-axis {off_axis}"))
    data = read_coupon(path, cantilever_tests.COLUMNS, columns=columns)
    identify = bending.identify_bending_curve if curve else bending.identify_bending
    return identify(
        data, thickness=values["thickness"],
        areal_weight=STANDARD_GRAVITY * values["areal_mass"], angle=values["angle"],
        off_axis=off_axis, inputs=_with_file(inputs, data), accept=accept,
    )  # fmt: skip


def identify_bending_loop_file(
    path: Path,
    sizes: Mapping[str, str | None],
    *,
    columns: str | None = None,
    fibre: int = 1,
    noise_floor: float = 0.5,
    accept: bool = False,
) -> Identification:
    """Identify bending with friction along a fibre direction from loops; ``sizes``: thickness.

    ``accept`` takes the fit as it is where the law does not describe the data.

    Raises
    ------
    InputError : a wrong file, size or choice.
    FitRefusedError : the law does not describe the data, and ``accept`` is not given.
    """
    _require_choice("--fibre", str(fibre), ("1", "2"))
    values, data, inputs = _test(path, sizes, ("thickness",), bending_loop, noise_floor, columns)
    return bending_loop.identify_bending_loop(
        data, thickness=values["thickness"], fibre=fibre, noise_floor=noise_floor, inputs=inputs,
        accept=accept,
    )  # fmt: skip


def identify_shear_loop_file(
    path: Path,
    sizes: Mapping[str, str | None],
    *,
    columns: str | None = None,
    noise_floor: float = 0.5,
    accept: bool = False,
) -> Identification:
    """Identify shear polynomial and friction from loops; ``sizes``: side, thickness as text.

    ``accept`` takes the fit as it is where the law does not describe the data.

    Raises
    ------
    InputError : a wrong file or size.
    FitRefusedError : the law does not describe the data, and ``accept`` is not given.
    """
    values, data, inputs = _test(
        path, sizes, ("side", "thickness"), shear_loop, noise_floor, columns
    )
    return shear_loop.identify_shear_loop(
        data, PictureFrame(**values), noise_floor=noise_floor, inputs=inputs, accept=accept
    )


_CONVENTION = {
    "engineering": "S12 = C12 * 2 E12",
    "tensor": "S12 = C12 * E12",
}


class _Kind(Protocol):
    """Module that identifies from a kind of tests."""

    @property
    def COLUMNS(self) -> tuple[tuple[Column, ...], ...]:
        """What a file may hold; the first that fits is taken."""

    @property
    def MINIMUM_ROWS(self) -> int:
        """Fewest rows that can be evaluated."""


def _test(
    path: Path,
    sizes: Mapping[str, str | None],
    names: tuple[str, ...],
    kind: _Kind,
    noise_floor: float,
    columns: str | None,
) -> tuple[dict[str, float], CouponData, tuple]:
    """Return the sizes in SI units, the data, and the table of inputs of a kind of tests."""
    _require_fraction("--noise-floor", noise_floor)
    values, inputs = _sizes(sizes, names)
    data = read_coupon(path, kind.COLUMNS, minimum_rows=kind.MINIMUM_ROWS, columns=columns)
    return values, data, _with_file(inputs, data)


def _fitted(
    fit: Callable[[CouponData, tuple], Identification],
    data: CouponData,
    inputs: tuple,
    choice: RowChoice,
    axes: Axes,
    fewest: int,
) -> Identification:
    """Return what ``fit`` finds in the rows that enter it, for data and table of inputs."""
    rows = entering_rows(data, axes, choice, fewest)
    drops = []
    if choice.without is None and axes.load.name == "force" and not axes.remembers:
        drops = found_drops(rows.data, axes)
    told = [f"{words}: {WITHOUT} {kind} leaves that out" for kind, words in drops]
    try:
        result = fit(rows.data, (*inputs, *rows.told))
    except FitRefusedError as error:
        if not told:
            raise
        holds = "; ".join([error.result.holds, *told])
        raise FitRefusedError(replace(error.result, holds=holds), data.file) from None
    if told:
        result = replace(result, warnings=(*result.warnings, *told))
    return with_left_out(result, rows.left_out, axes)


def _sizes(
    texts: Mapping[str, str | None], names: Sequence[str]
) -> tuple[dict[str, float], list[tuple[str, str, str]]]:
    """Return the sizes in SI units and their rows of the table of inputs."""
    values: dict[str, float] = {}
    rows = []
    for name in names:
        dimension, default, origin = SIZES[name]
        option = "--" + name.replace("_", "-")
        text = texts.get(name)
        try:
            values[name] = parse_quantity(default if text is None else text, dimension)
        except QuantityError as error:
            raise InputError(str(error), key=option) from None
        if values[name] <= 0.0:
            raise InputError("must be positive", key=option)
        rows.append(
            (name.replace("_", " "), default if text is None else text,
             origin if text is None else f"given, {option}")
        )  # fmt: skip
    return values, rows


def _with_file(rows: Sequence[tuple[str, str, str]], data: CouponData) -> tuple:
    file = ("data", data.file, f"{len(data.lines)} rows")
    unused = [("not used", header, "column of the file") for header in data.unused]
    return (file, *unused, *rows)


def _require_choice(option: str, value: str, choices: Iterable[str]) -> None:
    if value not in choices:
        raise InputError(f'"{value}" must be one of {", ".join(choices)}', key=option)


def _require_sizes_of(names: tuple[str, ...], sizes: Mapping[str, str | None]) -> None:
    for name, text in sizes.items():
        if text is not None and name not in names:
            raise InputError("is no size of this --test", key="--" + name.replace("_", "-"))


def _require_fraction(option: str, value: float) -> None:
    if not 0.0 <= value < 1.0:
        raise InputError("must lie between 0 and 1", key=option)
