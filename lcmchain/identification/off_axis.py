"""Moduli and shear law of a unidirectional fabric from off-axis tension at several angles.

In a strip that stretches evenly nothing but S11 acts, along the pull. With the fibres at an angle
of the cosine c and sine s, what acts along the fibres, across them and in shear is c² S, s² S and
c s S, and the strain along the pull is a sum of three, exactly, at any stretch λ:

    (λ² - 1)/2 = c⁴ a S + s⁴ b S + c s g,   w'(g) = c s S,   F = w0 t0 λ S,

with the compliances a = 1/E along the fibres and b across, and the shear law w' over g of
:mod:`lcmchain.materials.fibre_families`. The force at a measured stretch follows from one equation,
which rises with S; its derivatives by a, b and the shear polynomial are in closed form. Tests at
several angles tell the three apart. The fit minimises the misfit of the force (Gauss-Newton, with
the bounds of a scene kept exactly).

Sources: off-axis tests at 30, 45 and 60 degrees for such a fabric: Karlsruhe,
doi 10.5445/IR/1000174521; the even state: :mod:`lcmchain.coupons.analytic.off_axis`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import block_diag
from scipy.optimize import nnls

from lcmchain.errors import InputError
from lcmchain.identification.data import Column, CouponData
from lcmchain.identification.regression import (
    Fit,
    LackOfFit,
    coefficient_of_determination,
    falling_row,
    is_better_by_more_than_chance,
    lack_of_fit,
    least_squares_within,
    noise_scale,
)
from lcmchain.identification.result import (
    Band,
    Identification,
    Panel,
    Parameter,
    Points,
    accepted,
    general_warnings,
    mega_pascal,
)
from lcmchain.identification.shear import COEFFICIENT_COUNT, rising_stress
from lcmchain.quantities.units import ANGLE, FORCE, LENGTH

COLUMNS = (
    (Column("angle", ANGLE), Column("displacement", LENGTH, loading=1), Column("force", FORCE)),
)
MINIMUM_ROWS = 12
#: Angles of the fibres that differ by less are one [rad].
LEAST_APART = math.radians(3.0)
# Mean deviation of the tests at an angle, and along them, that matters: the law is there to tell
# angles apart.
TOLERANCE_OF_ANGLES = 0.05
# Chance that pure noise adds coefficients to the shear polynomial.
FALSE_COEFFICIENT = 1e-3
# A direction that is stiffer than this is inextensible [Pa].
STIFFEST = 1e12
# A strip whose fibres are nearer to the pull tells their modulus [rad].
NEARLY_ALONG = math.radians(15.0)
_NAMES = ("along", "across", *(f"s{k}" for k in range(COEFFICIENT_COUNT)))
# Strain g at which both directions lie on each other; beyond it the law goes on straight.
_LARGEST_SHEAR = 1.0
_PASSES, _HALVINGS = 60, 12


@dataclass(frozen=True)
class Strips:
    """Strips pulled off the axis of their fibres, shape [row_count] each.

    angle : of the fibres from the pull [rad]. stretch : λ. force : [N].
    section : w0 t0 [m²]. specimen : number of the specimen of each row.
    """

    angle: np.ndarray
    stretch: np.ndarray
    force: np.ndarray
    section: float
    specimen: np.ndarray

    @property
    def strain(self) -> np.ndarray:
        """Green-Lagrange strain along the pull."""
        return 0.5 * (self.stretch**2 - 1.0)

    @property
    def tell_along(self) -> bool:
        """Whether a strip is pulled so nearly along its fibres that it tells their modulus."""
        return float(self.angle.min()) < NEARLY_ALONG

    def keep(self, rows: np.ndarray) -> Strips:
        """Return some of the rows."""
        return Strips(
            self.angle[rows], self.stretch[rows], self.force[rows], self.section,
            self.specimen[rows],
        )  # fmt: skip

    def of_stress(self, stress: np.ndarray) -> np.ndarray:
        """Return the force [N] of a second Piola-Kirchhoff stress along the pull [Pa]."""
        return self.section * self.stretch * stress

    def parts(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return c⁴, s⁴ and c s, the last exactly zero along and across the fibres."""
        c, s = np.cos(self.angle), np.sin(self.angle)
        both = c * s
        return c**4, s**4, np.where(both > 1e-9, both, 0.0)


def shear_response(s: np.ndarray, g: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return w' and w'' [Pa] of a shear polynomial at shear strains g from 0 on."""
    inside = np.minimum(g, _LARGEST_SHEAR)
    powers = np.arange(COEFFICIENT_COUNT)
    e = 0.5 * inside[..., None]
    stress, tangent = (e**powers) @ s * inside, ((powers + 1) * e**powers) @ s
    return stress + tangent * (g - inside), tangent


def predicted(strips: Strips, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the forces [N] of a law, and their derivatives by its numbers [row_count, 7].

    theta : compliances along and across [1/Pa], s0 ... s4 [Pa].
    """
    a, b, s = theta[0], theta[1], theta[2:]
    along, across, both = strips.parts()
    # along with the shear strain the stress is explicit, S = w'/(c s), but where there is no shear
    plain = strips.strain / np.maximum(along * a + across * b, 1e-300)
    factor = (along * a + across * b) / np.where(both > 0.0, both, 1.0)
    low, high = np.zeros_like(plain), strips.strain / np.where(both > 0.0, both, 1.0)
    for _ in range(60):
        middle = 0.5 * (low + high)
        w, _ = shear_response(s, middle)
        above = factor * w + both * middle > strips.strain
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    g = 0.5 * (low + high)
    w, tangent = shear_response(s, g)
    stress = np.where(both > 0.0, w / np.where(both > 0.0, both, 1.0), plain)
    powers = np.arange(COEFFICIENT_COUNT)
    inside = np.minimum(g, _LARGEST_SHEAR)[:, None]
    # of g by s_k at one stress; the straight end beyond the largest shear belongs to it
    by_s = (0.5 * inside) ** powers * (inside + (powers + 1) * (g[:, None] - inside))
    by_s = -by_s / tangent[:, None] * both[:, None]
    slope = along * a + across * b + both**2 / tangent
    by = -np.column_stack([along * stress, across * stress, by_s]) / slope[:, None]
    return strips.of_stress(stress), strips.of_stress(by.T).T


@dataclass(frozen=True)
class StripFit:
    """A law fitted to strips.

    theta : compliances along and across [1/Pa], s0 ... s4 [Pa]. names : of those that were fitted.
    fit : of these; the compliance along the fibres is that of fibres that do not stretch where no
    strip tells it, and coefficients that the tests do not ask for are 0.
    """

    theta: np.ndarray
    names: tuple[str, ...]
    fit: Fit

    @property
    def misfit(self) -> float:
        return float(np.sum(self.fit.residuals**2))


def fit_strips(strips: Strips, noise_floor: float, order: int | None = None) -> StripFit:
    """Fit compliances and shear polynomial to the forces; none is negative, and the shear rises.

    ``order``: count of coefficients of the polynomial. By default the least to which no more would
    describe the tests better by more than chance (F test).
    """
    if order is not None:
        return _fit_order(strips, noise_floor, order)
    fits = [_fit_order(strips, noise_floor, k + 1) for k in range(COEFFICIENT_COUNT)]
    for k, less in enumerate(fits):
        if not any(_needs(more, less) for more in fits[k + 1 :]):
            return less
    return fits[-1]


def _needs(more: StripFit, less: StripFit) -> bool:
    return is_better_by_more_than_chance(
        less.misfit, more.misfit, len(more.names) - len(less.names), more.fit.degrees_of_freedom,
        FALSE_COEFFICIENT,
    )  # fmt: skip


def _fit_order(strips: Strips, noise_floor: float, order: int) -> StripFit:
    theta = _start(strips, noise_floor)
    secant = theta[2]
    fitted = np.array([strips.tell_along, True, *(k < order for k in range(COEFFICIENT_COUNT))])
    # in units of the start, so that all numbers are of one size
    unit = np.array([1.0 / secant, 1.0 / secant, *[secant] * COEFFICIENT_COUNT])
    rows, least = _bounds(secant, int(fitted[:2].sum()), order)
    bounds = (rows * unit[fitted], least)
    model, slopes = predicted(strips, theta)
    for _ in range(_PASSES):
        scale = noise_scale(model, strips.force, noise_floor)
        linear = slopes[:, fitted] * unit[fitted] / scale[:, None]
        target = (strips.force - model + slopes[:, fitted] @ theta[fitted]) / scale
        step = np.zeros(len(theta))
        step[fitted] = least_squares_within(linear, target, bounds) * unit[fitted] - theta[fitted]
        before = np.sum(((strips.force - model) / scale) ** 2)
        for half in range(_HALVINGS):
            tried = theta + 0.5**half * step
            model, slopes = predicted(strips, tried)
            if np.sum(((strips.force - model) / scale) ** 2) <= before * (1.0 + 1e-12):
                break
        change = np.max(np.abs(tried - theta) / unit)
        theta = tried
        if change < 1e-9:
            break
    scale = noise_scale(model, strips.force, noise_floor)
    held = bool(np.any(rows @ theta[fitted] < least * (1.0 + 1e-6)))
    fit = Fit(
        theta[fitted], model, (strips.force - model) / scale, scale,
        slopes[:, fitted] / scale[:, None], held,
    )  # fmt: skip
    return StripFit(theta, tuple(np.array(_NAMES)[fitted].tolist()), fit)


def _bounds(secant: float, compliances: int, order: int) -> tuple[np.ndarray, np.ndarray]:
    """Return rows and least values: no direction is stiffer than can be, and the shear rises."""
    tangent, least = rising_stress(secant)
    rows = block_diag(np.eye(compliances), tangent[:, :order])
    return rows, np.append([1.0 / STIFFEST] * compliances, least)


def _start(strips: Strips, noise_floor: float) -> np.ndarray:
    """Return compliances and a constant shear stiffness, in which the strain is linear."""
    along, across, both = strips.parts()
    stress = strips.force / (strips.section * strips.stretch)
    design = np.column_stack([along * strips.tell_along, across, both**2]) * stress[:, None]
    scale = noise_scale(strips.strain, strips.strain, noise_floor)
    unit = np.abs(design).max()
    found = nnls(design / scale[:, None] / unit, strips.strain / scale)[0] / unit
    shear = 1.0 / max(float(found[2]), 1e-2 * float(found.max()), 1.0 / STIFFEST)
    compliances = np.maximum(found[:2], 1.0 / STIFFEST)
    return np.array([*compliances, shear, *[0.0] * (COEFFICIENT_COUNT - 1)])


def identify_off_axis(
    data: CouponData,
    *,
    length: float,
    width: float,
    thickness: float,
    noise_floor: float = 0.01,
    inputs: tuple = (),
    accept: bool = False,
) -> Identification:
    """Identify what a unidirectional fabric resists along and across its fibres, and in shear.

    Parameters
    ----------
    data : columns angle [rad] of the fibres from the pull, displacement [m] and force [N].
    length, width, thickness : of the strips between the clamps [m].
    noise_floor : smallest noise of the force relative to the largest force.
    inputs : rows of the table of inputs.
    accept : take the fit as it is where it does not describe the data.

    Raises
    ------
    InputError : angles beyond 0 to 90°, too few of them, or no force.
    FitRefusedError : the law does not describe the data, and ``accept`` is not given.
    """
    data = _loaded_rows(data)
    angles = tested_angles(data["angle"])
    strips = Strips(
        data["angle"], 1.0 + data["displacement"] / length, data["force"], width * thickness,
        data.specimen,
    )  # fmt: skip
    law = fit_strips(strips, noise_floor)
    lack, objections = _judge(data, strips, law.fit)
    fit = replace(law.fit, blocks=lack.blocks)
    law = replace(law, fit=fit)
    parameters = _parameters(law)
    others = _by_the_others(strips, angles, noise_floor, law)
    warnings = general_warnings(parameters, fit.residuals, strips.specimen)
    warnings += _warnings(strips, law, parameters, others)
    shear = _shear_strain(strips, law.theta)
    result = Identification(
        law="off-axis",
        method="least squares of the force of evenly stretched strips, with compliances along and "
        "across the fibres and s0 ... s4",
        noise_model="independent errors of the force, relative to it, at least "
        f"{100 * noise_floor:g} % of the largest force",
        interval_method="Student's t from the Jacobian, in the compliances",
        inputs=inputs,
        parameters=parameters,
        derived=(),
        scene_table="material",
        scene_entries={
            "across.tension": f'"{mega_pascal(1.0 / law.theta[1])}"',
            "across.shear_polynomial": f'"{mega_pascal(*law.theta[2:])}"',
            "membrane.shear_range": f'"{np.degrees(np.arcsin(min(shear.max(), 1.0))):.4g} deg"',
        },
        correlation=fit.correlation(),
        condition=fit.condition,
        relative_noise=fit.scale,
        r_squared=coefficient_of_determination(strips.force, fit.model),
        point_count=len(strips.force),
        warnings=tuple(warnings),
        panels=_panels(data, strips, law, shear, others),
        objections=tuple(objections),
        holds="smaller displacements may follow the law; stitching that is slack at first needs "
        "material.across.tension_curve, which is not fitted"
        if objections
        else "",
    )
    return accepted(result, data.file, accept)


def _loaded_rows(data: CouponData) -> CouponData:
    """Return the rows of stretched strips; refuse what no law could be told from."""
    wrong = np.flatnonzero((data["angle"] < 0.0) | (data["angle"] > 0.5 * math.pi + 1e-9))
    if wrong.size:
        raise data.wrong("angle", wrong[0], "lies outside 0 to 90 deg from the pull")
    data = data.keep(data["displacement"] > 0.0)
    count = len(tested_angles(data["angle"]))
    if len(data.lines) < MINIMUM_ROWS or count < 2:
        raise InputError(
            f"has {len(data.lines)} rows of {count} angles: at least {MINIMUM_ROWS} of two "
            "are needed to tell shear from what is across the fibres; test at 30, 45 and 60 deg",
            file=data.file,
        )
    if np.sum(data["force"]) <= 0.0:
        raise InputError("the force is not positive; tension counts as positive", file=data.file)
    return data


def tested_angles(angle: np.ndarray) -> np.ndarray:
    """Return the angles of the tests [rad], each once."""
    found: list[float] = []
    for one in np.sort(angle):
        if not found or one > found[-1] + LEAST_APART:
            found.append(float(one))
    return np.array(found)


def _at(angle: np.ndarray, one: float) -> np.ndarray:
    """Return which rows are at one of the tested angles."""
    return (angle >= one) & (angle <= one + LEAST_APART)


def _judge(data: CouponData, strips: Strips, fit: Fit) -> tuple[LackOfFit, list[str]]:
    """Return the misfit over the angles and over the stretch at each, and what is wrong."""
    objections = []
    fallen = falling_row(strips.force, strips.specimen)
    if fallen is not None:
        objections.append(
            f"the force falls at line {data.lines[fallen]}: the strip tore, slipped or was "
            "unloaded; keep only the loading branch"
        )
    over = lack_of_fit(
        strips.angle, strips.force, fit.model, strips.specimen, tolerance=TOLERANCE_OF_ANGLES
    )
    if over.is_systematic:
        objections.append(over.text("the law", "the angle", "deg", 180.0 / math.pi))
    for angle in tested_angles(strips.angle):
        at_angle = _at(strips.angle, angle)
        lack = lack_of_fit(
            data["displacement"][at_angle], strips.force[at_angle], fit.model[at_angle],
            strips.specimen[at_angle],
            tolerance=TOLERANCE_OF_ANGLES,
        )  # fmt: skip
        if lack.is_systematic:
            name = f"the law at {np.degrees(angle):.3g} deg"
            objections.append(lack.text(name, "the displacement", "mm", 1e3))
    return over, objections


def _parameters(law: StripFit) -> tuple[Parameter, ...]:
    """Return moduli in place of compliances; the interval of one may have no end."""
    found = []
    for name, value, half in zip(law.names, law.fit.parameters, law.fit.half_widths(), strict=True):
        value, half = float(value), float(half)
        if name in ("along", "across"):
            high = 1.0 / (value - half) if value > half else math.inf
            found.append(Parameter(name, 1.0 / value, "Pa", 1.0 / (value + half), high))
        else:
            found.append(Parameter(name, value, "Pa", value - half, value + half))
    return tuple(found)


@dataclass(frozen=True)
class _LeftOut:
    """Strips at an angle [rad], and their forces by the law of all others [N]."""

    angle: float
    rows: np.ndarray
    force: np.ndarray


def _by_the_others(
    strips: Strips, angles: np.ndarray, noise_floor: float, law: StripFit
) -> list[_LeftOut]:
    """Return what the law of all other angles says of each; nothing for less than three.

    An angle that alone tells the fibres' modulus cannot be left out.
    """
    found = []
    for angle in angles if len(angles) > 2 else ():
        at_angle = _at(strips.angle, angle)
        rest = strips.keep(~at_angle)
        if rest.tell_along == strips.tell_along:
            other = fit_strips(rest, noise_floor, len(law.names) - 1 - strips.tell_along)
            force = predicted(strips.keep(at_angle), other.theta)[0]
            found.append(_LeftOut(float(angle), at_angle, force))
    return found


def _warnings(
    strips: Strips, law: StripFit, parameters: tuple[Parameter, ...], others: list[_LeftOut]
) -> list[str]:
    across = next(p for p in parameters if p.name == "across")
    found = []
    if not strips.tell_along:
        found.append(
            "the fibres are taken as inextensible: no strip is pulled nearly along them, which "
            "would tell their modulus (a test at 0 deg)"
        )
    if not across.is_determined and across.high == math.inf:
        found.append(
            f"the tension across the fibres is above {1e-6 * across.low:.3g} MPa, and these tests "
            "do not tell by how much: test at larger angles"
        )
    for left in others:
        measured = strips.force[left.rows]
        off = float(np.mean((left.force - measured) / np.max(measured)))
        if abs(off) > TOLERANCE_OF_ANGLES:
            found.append(
                f"the law of the other angles is {100 * abs(off):.0f} % of the largest force "
                f"{'above' if off > 0.0 else 'below'} the tests at "
                f"{np.degrees(left.angle):.3g} deg"
            )
    if law.fit.constrained:
        found.append("a bound of the scene holds the fit: a rising stress, or a stiff direction")
    found.append(
        "compression across, bending and torsion are not told by these tests, nor compression of "
        "the fibres: state them in [material.across] and [[material.fibres]]"
    )
    return found


def _shear_strain(strips: Strips, theta: np.ndarray) -> np.ndarray:
    """Return the shear strain g that the measured stretches leave to the shear."""
    a, b = theta[:2]
    along, across, both = strips.parts()
    stress = strips.force / (strips.section * strips.stretch)
    rest = strips.strain - (a * along + b * across) * stress
    return np.where(both > 0.0, rest / np.where(both > 0.0, both, 1.0), 0.0)


def _panels(
    data: CouponData, strips: Strips, law: StripFit, shear: np.ndarray, others: list[_LeftOut]
) -> tuple[Panel, ...]:
    u, points, curves, left_out = 1e3 * data["displacement"], [], [], []
    for angle in tested_angles(strips.angle):
        at_angle = _at(strips.angle, angle)
        order = np.argsort(u[at_angle], kind="stable")
        name = f"{np.degrees(angle):.3g} deg"
        points.append(Points(u[at_angle], strips.force[at_angle], name, strips.specimen[at_angle]))
        curves.append(Band(u[at_angle][order], law.fit.model[at_angle][order], ""))
        left_out += [
            Band(u[at_angle][order], one.force[order], "by the law of the others", dashed=True)
            for one in others
            if one.angle == angle
        ]
    g = np.linspace(0.0, max(float(shear.max()), 1e-3), 101)
    sheared = strips.parts()[2] > 0.0
    stress = strips.parts()[2] * strips.force / (strips.section * strips.stretch)
    curve = shear_response(law.theta[2:], g)[0]
    names = left_out[:1] + [replace(band, label="") for band in left_out[1:]]
    return (
        Panel("displacement [mm]", "force [N]", tuple(points), (*curves, *names)),
        Panel(
            "shear strain g", "shear stress [MPa]",
            (Points(shear[sheared], 1e-6 * stress[sheared], "measured", strips.specimen[sheared]),),
            (Band(g, 1e-6 * curve, "law"),),
        ),
        Panel(
            "displacement [mm]", "residual [%]",
            (Points(u, 100.0 * law.fit.residuals, "measured", strips.specimen),), is_residual=True,
        ),
    )  # fmt: skip
