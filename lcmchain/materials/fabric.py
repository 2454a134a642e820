"""Engineering textile with decoupled membrane, compaction and bending behaviour.

Sources: Schäfer, Mitsch, Kärger, Eqs. (19)-(25) and Tables B.1-B.3 (MD600). Voigt order
11, 22, 33, 12, 23, 13 with engineering shear strains; axis 1 and 2 are the reference fibre
directions, axis 3 the reference normal.
"""

from __future__ import annotations

import copy
import math
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field, model_validator

from lcmchain.jit import equation
from lcmchain.materials.features.bending_curve import (
    SIZE,
    BendingCurve,
    BendingCurveTable,
    bent_class,
    curve_energy,
    curve_response,
    with_curves,
)
from lcmchain.materials.features.bending_losses import BendingLosses, with_losses
from lcmchain.materials.features.compaction import (
    compaction_of,
    compaction_stress_and_tangent,
    compaction_tangent_curvature,
    compaction_tangent_slope,
    linear_class,
    linear_where_constant,
)
from lcmchain.materials.features.pressure_curves import (
    MOST_ANGLES,
    PressureCurveTable,
    read_pressure_curves,
)
from lcmchain.materials.features.pressure_table import PressureTable, tabled_class
from lcmchain.materials.features.relaxation import (
    OWN_MEMORY,
    CompactionRelaxation,
    evolved_relaxation,
    with_relaxation,
    with_relaxing,
)
from lcmchain.materials.features.shear import (
    ShearLocking,
    locking_class,
    rounded_shear_of,
    shear_stress_and_tangent,
    stabilising_shear_curvature,
    stabilising_shear_slope,
    stabilising_shear_tangent,
    with_locking,
)
from lcmchain.materials.features.shear_compaction import (
    Coupling,
    PowerCoupling,
    coupled_class,
    curvature_at_shear,
    mapped_coupling,
    mapped_curvature,
    mapped_pressure,
    mapped_slope,
    mapped_stabilising,
    shear_tangents,
    slope_at_shear,
    stabilising_at_shear,
    strain_of,
    thickening,
    with_thickening,
)
from lcmchain.materials.features.shear_friction import (
    ShearFriction,
    ShearFrictionTable,
    evolved_shear_friction,
    with_rubbing_shear,
    with_shear_friction,
)
from lcmchain.materials.features.temperature_field import (
    RATE_FACTOR,
    TemperatureField,
    kept_values,
    with_field,
)
from lcmchain.materials.features.unlike_sides import UnlikeSides, with_unlike_sides
from lcmchain.materials.features.viscous_shear import (
    ViscousShear,
    evolved_viscous_shear,
    stress_of_step,
    with_viscous,
    with_viscous_shear,
)
from lcmchain.materials.features.viscous_table import (
    BendingFrictionTable,
    BendingRateTable,
    ViscousTable,
    bending_losses,
)
from lcmchain.materials.law import (
    Step,
    TangentCoupling,
    bending_stiffness,
    evolved_history,
    history_count,
    hourglass_tangent,
    implements,
    membrane_response,
    own_memory,
    place_in_memory,
    plane_bending_stiffness,
    plane_response,
    tangent_coupling,
    tangent_curvature,
    tangent_slope,
)
from lcmchain.materials.table import ExponentialCompaction, FabricTable
from lcmchain.materials.twins import let_have_twins
from lcmchain.quantities.entry_types import (
    NOT_NEGATIVE,
    POSITIVE,
    AbsentMeans,
    AcuteAngle,
    ArealMass,
    Density,
    Number,
    OrFile,
    PositiveLength,
    PositiveStiffness,
    Quantity,
    Range,
    Row,
    SceneModel,
    Stiffness,
    Text,
    wrong,
)
from lcmchain.quantities.units import STIFFNESS


class FabricLaw(NamedTuple):
    """Parameters of the fabric law [Pa]; shear moduli act on engineering shear strains.

    ``s0 ... s4`` are the coefficients of the shear polynomial, Eq. (21), in powers of the tensor
    strain |E12|; ``c0, c1, c2`` those of the compaction law, Eq. (23); ``B..`` the bending
    stiffness, Eq. (25).
    """

    C11: float
    C22: float
    C23: float
    C13: float
    s0: float
    s1: float
    s2: float
    s3: float
    s4: float
    c0: float
    c1: float
    c2: float
    B11: float
    B22: float
    B33: float
    B12: float
    B23: float
    B13: float


@equation
def with_shear_losses(law, S12, C12, g, elastic, history):
    """Return S12 and dS12/dg with what resists the rate of the shear, and its friction."""
    S12, C12 = with_viscous_shear(law, S12, C12, g, history)
    return with_shear_friction(law, S12, C12, g, elastic, history)


@equation
def evolved_shear(law, g, history):
    """Return what the law remembers of its shear, behind the values that elements keep."""
    elastic = shear_stress_and_tangent(law, g)[0]
    of_rate = kept_values(law, history) + evolved_viscous_shear(law, g, history)
    return of_rate + evolved_shear_friction(law, g, elastic, history)


@implements(membrane_response, FabricLaw)
@equation
def fabric_response(law, E, history):
    """Return the stress S^M (Eq. 19, at the centre) and the diagonal of the tangent C^M."""
    elastic, C12 = shear_stress_and_tangent(law, E[3])
    sheared = thickening(law, E[2], E[3])
    strain = strain_of(sheared, E[2])
    S33, C33 = compaction_stress_and_tangent(law, strain)
    S33, C33 = with_relaxation(law, S33, C33, strain, history)
    S33, C33, S12, C12 = with_thickening(sheared, S33, C33, elastic, C12)
    S12, C12 = with_shear_losses(law, S12, C12, E[3], elastic, history)
    S = (law.C11 * E[0], law.C22 * E[1], S33, S12, law.C23 * E[4], law.C13 * E[5])
    return S, (law.C11, law.C22, C33, C12, law.C23, law.C13)


@equation
def stabilising_compaction(sheared, law, C33):
    """Return the stabilising C33 of a law whose own is C33."""
    if sheared is None:
        return C33
    return stabilising_at_shear(sheared, C33, compaction_stress_and_tangent(law, sheared.strain)[1])


@implements(hourglass_tangent, FabricLaw)
@equation
def fabric_hourglass_tangent(law, E, C_M, history):
    C33 = stabilising_compaction(thickening(law, E[2], E[3]), law, C_M[2])
    return (C_M[0], C_M[1], C33, stabilising_shear_tangent(law, E[3]), C_M[4], C_M[5])


@equation
def compaction_slope(sheared, law, E33):
    """Return dC33/dE33 of the compaction at the strain that it sees."""
    if sheared is None:
        return compaction_tangent_slope(law, E33)
    return slope_at_shear(sheared, compaction_tangent_slope(law, sheared.strain))


@equation
def compaction_curvature(sheared, law, E33):
    """Return d²C33/dE33² of the compaction at the strain that it sees."""
    if sheared is None:
        return compaction_tangent_curvature(law, E33)
    slope33 = compaction_tangent_slope(law, sheared.strain)
    curvature33 = compaction_tangent_curvature(law, sheared.strain)
    return curvature_at_shear(sheared, slope33, curvature33)


@implements(tangent_slope, FabricLaw)
@equation
def fabric_tangent_slope(law, E, history):
    sheared = thickening(law, E[2], E[3])
    return (
        None,
        None,
        compaction_slope(sheared, law, E[2]),
        stabilising_shear_slope(law, E[3]),
        None,
        None,
    )


@implements(tangent_curvature, FabricLaw)
@equation
def fabric_tangent_curvature(law, E, history):
    sheared = thickening(law, E[2], E[3])
    return (
        None,
        None,
        compaction_curvature(sheared, law, E[2]),
        stabilising_shear_curvature(law, E[3]),
        None,
        None,
    )


@equation
def compaction_coupling(sheared, law):
    """Return the answer of ``tangent_coupling`` for the compaction at the strain that it sees."""
    if sheared is None:
        return None
    S33, C33 = compaction_stress_and_tangent(law, sheared.strain)
    slope33 = compaction_tangent_slope(law, sheared.strain)
    curvature33 = compaction_tangent_curvature(law, sheared.strain)
    return shear_tangents(sheared, S33, C33, slope33, curvature33)


@implements(tangent_coupling, FabricLaw)
@equation
def fabric_tangent_coupling(law, E, history):
    return compaction_coupling(thickening(law, E[2], E[3]), law)


@implements(evolved_history, FabricLaw)
@equation
def fabric_evolved(law, E, history):
    return evolved_relaxation(law, E, history) + evolved_shear(law, E[3], history)


@implements(bending_stiffness, FabricLaw)
@equation
def fabric_bending_stiffness(law):
    """Return the diagonal of C^B, Eq. (25)."""
    return (law.B11, law.B22, law.B33, law.B12, law.B23, law.B13)


@implements(plane_response, FabricLaw)
@equation
def fabric_plane_response(law, E11, E22, g12):
    S12, C12 = shear_stress_and_tangent(law, g12)
    return (law.C11 * E11, law.C22 * E22, S12), (law.C11, law.C22, C12)


@implements(plane_bending_stiffness, FabricLaw)
@equation
def fabric_plane_bending_stiffness(law):
    return (law.B11, law.B22, law.B12)


def name_twins(law_class: type, module: dict[str, Any]) -> None:
    """Make the twins of a law of fabrics that have names of their own, as globals of its module.

    They are made of each other in this order: with a coupling or a table of pressures, with
    locking, with a constant C33, with curves of bending. Of all of them twins with friction, or
    that depend on rates, can be made on demand (:mod:`lcmchain.materials.twins`).

    Parameters
    ----------
    module : the globals of the module of the class, where compiled kernels on disk look them up.
    """
    classes = [law_class, coupled_class(law_class), tabled_class(law_class)]
    for twin in (locking_class, linear_class, bent_class):
        classes += [twin(base) for base in classes]
    module.update({base.__name__: base for base in classes})
    let_have_twins(*classes)


name_twins(FabricLaw, globals())


class Fabric:
    """A fabric as the rest of the program sees it: the law, its energy, and its constants.

    Parameters
    ----------
    law : parameters in SI.
    thickness : initial thickness [m].
    areal_mass : mass per area [kg/m²].
    fibre_density : density of the fibres [kg/m³], for the fibre volume fraction.
    name : as in the scene.
    shear_range : shear angle [rad] up to which the law was measured, None where nobody says.
    locking : beyond a shear angle, None for a law that does not lock.
    in_plane_bending : stiffness of the fibres against bending within the plane, over that against
        bending out of it.
    coupling : how the thickness depends on the shear, None where it does not.
    bending_curves : moment over curvature along the fibres 1 and 2, in place of B11 and B22.
    viscous : what resists the rate of the shear, None without.
    relaxation : the part of the compaction that relaxes, None without.
    temperature : over the blank, which shifts the times of both; None where it is one.
    bending_losses : friction and resistance to rates of the bending, None without.
    shear_friction : friction of the shear, None without.
    unlike_sides : how the shear to the negative side differs, None where both are alike.
    """

    is_diagonal = True
    constant_tangent = False
    couples_thickness = False
    fibre_modulus_factor = 1.0
    # of a law that has none of them, as that of fibre families
    locking: ShearLocking | None = None
    coupling: Coupling | None = None
    viscous: ViscousShear | None = None
    relaxation: CompactionRelaxation | None = None
    temperature: TemperatureField | None = None
    bending_losses: BendingLosses | None = None
    shear_friction: ShearFriction | None = None
    unlike_sides: UnlikeSides | None = None

    def __init__(
        self,
        law: FabricLaw,
        *,
        thickness: float,
        areal_mass: float,
        fibre_density: float | None,
        name: str = "fabric",
        shear_range: float | None = None,
        locking: ShearLocking | None = None,
        in_plane_bending: float = 0.0,
        coupling: Coupling | None = None,
        bending_curves: tuple[BendingCurve | None, BendingCurve | None] = (None, None),
        viscous: ViscousShear | None = None,
        relaxation: CompactionRelaxation | None = None,
        temperature: TemperatureField | None = None,
        bending_losses: BendingLosses | None = None,
        shear_friction: ShearFriction | None = None,
        unlike_sides: UnlikeSides | None = None,
    ) -> None:
        law = law if coupling is None else coupling.law_of(law)
        law = linear_where_constant(with_locking(law, locking))
        law = with_unlike_sides(with_curves(law, bending_curves, thickness), unlike_sides)
        law = with_relaxing(law, relaxation)
        law = with_viscous(with_field(law, temperature), viscous)
        law = with_rubbing_shear(law, shear_friction)
        self.law = law = with_losses(law, bending_losses)
        self.viscous, self.relaxation, self.temperature = viscous, relaxation, temperature
        self.shear_friction, self.unlike_sides = shear_friction, unlike_sides
        self.bending_losses = bending_losses
        self.coupling = coupling
        inertia = in_plane_bending * thickness**3 / 12.0
        self.fibre_bending = (law.B11 * inertia, law.B22 * inertia)
        self.locking = locking
        self.shear_range = shear_range
        self.thickness = thickness
        self.areal_mass = areal_mass
        self.density = areal_mass / thickness
        self.fibre_density = fibre_density
        self.name = name

    @property
    def compacts(self) -> bool:
        return bool(self.law.c1 != 0.0)

    @property
    def locks(self) -> bool:
        return self.locking is not None

    @property
    def locking_angles(self) -> tuple[float | None, ...]:
        """Shear angle from which on the fabric locks [rad], None where it never does."""
        return (None if self.locking is None else math.asin(self.locking.locking_strain),)

    @property
    def couples_shear(self) -> bool:
        return self.coupling is not None

    @property
    def bends_by_curves(self) -> bool:
        return hasattr(self.law, "curves")

    def with_fibre_modulus(self, factor: float) -> Self:
        """Return the fabric with C11 and C22 of the membrane times a factor."""
        changed = copy.copy(self)
        changed.law = self.law._replace(C11=factor * self.law.C11, C22=factor * self.law.C22)
        changed.fibre_modulus_factor = factor * self.fibre_modulus_factor
        return changed

    def stress_and_tangent(self, E: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """Return S^M (..., 6) and the tangent C^M (..., 6, 6) for strains E (..., 6).

        Plain NumPy, written separately from the compiled law so that each checks the other.
        """
        E = np.asarray(E)
        law = self.law
        S = np.zeros_like(E)
        C = np.zeros((*E.shape, 6))
        for row, stiffness in ((0, law.C11), (1, law.C22), (4, law.C23), (5, law.C13)):
            S[..., row] = stiffness * E[..., row]
            C[..., row, row] = stiffness
        S[..., 3], C[..., 3, 3] = self._shear(E[..., 3])
        S33, C33 = self._compaction(self._seen(E))
        S[..., 2], C[..., 2, 2] = S33, C33
        if self.coupling is not None:
            strain_map = self.coupling.at(E[..., 2], E[..., 3])
            S[..., 2], C[..., 2, 2], S[..., 3], C[..., 3, 3] = mapped_pressure.py_func(
                strain_map, S33, C33, S[..., 3], C[..., 3, 3]
            )
            C[..., 2, 3] = C[..., 3, 2] = self.tangent_couplings(E)[0]
        return S, C

    def stabilising_tangent(self, E: ArrayLike) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return a diagonal tangent (..., 6, 6), its slope and curvature (..., 6).

        C^M, but for the shear: its modulus is that of the rounded strain, without pressure; and for
        C33 of a fabric with a table (:mod:`.features.shear_compaction`).
        """
        E = np.array(E, dtype=float)
        diagonal = np.arange(6)
        C = np.zeros((*E.shape, 6))
        C[..., diagonal, diagonal] = self.stress_and_tangent(E)[1][..., diagonal, diagonal]
        slope, curvature = self.tangent_slope(E), self.tangent_curvature(E)
        size, first, second = rounded_shear_of(E[..., 3])
        shear_slope, shear_curvature = self._shear_slope(size), self._shear_curvature(size)
        C[..., 3, 3] = self._shear(size)[1]
        if self.coupling is not None:
            strain_map, _, C33, *_ = self._mapped(E)
            C[..., 2, 2] = mapped_stabilising.py_func(strain_map, None, C33)
        slope[..., 3] = first * shear_slope
        curvature[..., 3] = first**2 * shear_curvature + second * shear_slope
        if self.unlike_sides is not None:
            of_side = self.unlike_sides.stabilising(E[..., 3])
            C[..., 3, 3] += of_side[0]
            slope[..., 3] += of_side[1]
            curvature[..., 3] += of_side[2]
        return C, slope, curvature

    def tangent_slope(self, E: ArrayLike) -> np.ndarray:
        """Return dC_ii/dE_i (..., 6) of the tangent without pressure on sheared fabric."""
        E = np.asarray(E)
        slope = np.zeros_like(E)
        slope[..., 3] = self._shear_slope(E[..., 3])
        slope[..., 2] = self._compaction_slope(self._seen(E))
        if self.coupling is not None:
            strain_map, _, _, slope33, _ = self._mapped(E)
            slope[..., 2] = mapped_slope.py_func(strain_map, slope33)
        return slope

    def tangent_curvature(self, E: ArrayLike) -> np.ndarray:
        """Return d²C_ii/dE_i² (..., 6), as :meth:`tangent_slope`."""
        E = np.asarray(E)
        curvature = np.zeros_like(E)
        curvature[..., 3] = self._shear_curvature(E[..., 3])
        curvature[..., 2] = self._compaction_curvature(self._seen(E))
        if self.coupling is not None:
            strain_map, _, _, *derivatives = self._mapped(E)
            curvature[..., 2] = mapped_curvature.py_func(strain_map, *derivatives)
        return curvature

    def tangent_couplings(self, E: ArrayLike) -> TangentCoupling:
        """Return dS33/dg, dC33/dg, d²C33/dE33dg and d²C33/dg² (...) at strains E (..., 6)."""
        return mapped_coupling.py_func(*self._mapped(np.asarray(E)))

    def tangent_coupling(self, E: ArrayLike) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return dC33/dg, d²C33/dE33dg and d²C33/dg² (...) at strains E (..., 6)."""
        return self.tangent_couplings(E)[1:]

    def _mapped(self, E):
        """Return the map of the coupling, and S33 and C33 with the derivatives of C33 there."""
        assert self.coupling is not None
        strain_map = self.coupling.at(E[..., 2], E[..., 3])
        S33, C33 = self._compaction(strain_map.strain)
        slope33 = self._compaction_slope(strain_map.strain)
        return strain_map, S33, C33, slope33, self._compaction_curvature(strain_map.strain)

    def bending_matrix(self) -> np.ndarray:
        """Return C^B (6, 6), Eq. (25)."""
        law = self.law
        return np.diag([law.B11, law.B22, law.B33, law.B12, law.B23, law.B13])

    def bending_response(
        self, E: np.ndarray, height: ArrayLike
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return S^ζ (..., 6), its tangent (..., 6, 6) and 2 W^B - S^ζ:E^ζ (...)."""
        C_B, h = self.bending_matrix(), np.asarray(height)
        S, C = E @ C_B.T, np.broadcast_to(C_B, (*E.shape, 6)).copy()
        excess = np.zeros(E.shape[:-1])
        bent: Any = self.law  # the twin that bends by curves
        for i in (0, 1):
            curve = bent.curves[i * SIZE : (i + 1) * SIZE]
            size, slope = curve_response(curve, E[..., i] / h)
            S[..., i], C[..., i, i] = h * size, slope
            excess += 2.0 * h * h * curve_energy(curve, E[..., i] / h) - S[..., i] * E[..., i]
        return S, C, excess

    def _shear(self, g):
        """Return S12 and dS12/dg without pressure, Eq. (21) and locking."""
        law = self.law
        e12 = 0.5 * np.abs(g)
        coefficients = np.array([law.s0, law.s1, law.s2, law.s3, law.s4])
        modulus = np.polynomial.polynomial.polyval(e12, coefficients)
        slope = np.polynomial.polynomial.polyval(e12, coefficients[1:] * np.arange(1, 5))
        stress, tangent = modulus * g, modulus + e12 * slope
        if self.locking is not None:
            locked = self.locking.response(g)
            stress, tangent = stress + locked[0], tangent + locked[1]
        if self.unlike_sides is not None:
            other = self.unlike_sides.response(g)
            stress, tangent = stress + other[0], tangent + other[1]
        return stress, tangent

    def _shear_slope(self, g):
        law = self.law
        tangent = np.array([law.s0, law.s1, law.s2, law.s3, law.s4]) * np.arange(1, 6)
        derivative = np.polynomial.polynomial.polyval(
            0.5 * np.abs(g), tangent[1:] * np.arange(1, 5)
        )
        slope = 0.5 * np.where(g >= 0.0, derivative, -derivative)
        if self.locking is not None:
            slope = slope + self.locking.slope_and_curvature(g)[0]
        if self.unlike_sides is not None:
            slope = slope + self.unlike_sides.slope_and_curvature(g)[0]
        return slope

    def _shear_curvature(self, g):
        law = self.law
        tangent = np.array([law.s0, law.s1, law.s2, law.s3, law.s4]) * np.arange(1, 6)
        second = tangent[2:] * np.array([2.0, 6.0, 12.0])
        curvature = 0.25 * np.polynomial.polynomial.polyval(0.5 * np.abs(g), second)
        if self.locking is not None:
            curvature = curvature + self.locking.slope_and_curvature(g)[1]
        if self.unlike_sides is not None:
            curvature = curvature + self.unlike_sides.slope_and_curvature(g)[1]
        return curvature

    def _seen(self, E):
        """Return the strain that the compaction law sees."""
        if self.coupling is None:
            return E[..., 2]
        return self.coupling.at(E[..., 2], E[..., 3]).strain

    def _compaction(self, E33):
        """Return S33 and dS33/dE33 of the unsheared fabric, Eq. (23)."""
        law = self.law
        return compaction_of(law.c0, law.c1, law.c2, E33)

    def _compaction_slope(self, E33):
        law = self.law
        e33 = np.maximum(-E33, 1e-16)
        exponent = law.c1 * e33**law.c2
        return (
            -law.c0 * np.exp(exponent) * law.c2 * exponent / e33
            * (1.0 + law.c2 + law.c2 * exponent)
        )  # fmt: skip

    def _compaction_curvature(self, E33):
        law = self.law
        compressed = E33 < 0.0
        e33 = np.where(compressed, -E33, 1.0)
        exponent = law.c1 * e33**law.c2
        # with x = c1 e^c2 the tangent is c0 exp(x) (1 + c2 x) and e dx/de = c2 x
        cubic = exponent * (
            (law.c2 - 1.0) * (1.0 + law.c2) + exponent * law.c2 * (3.0 * law.c2 + exponent * law.c2)
        )
        cubic *= law.c0 * law.c2 / e33**2
        curvature = np.where(compressed, np.exp(np.where(compressed, exponent, 0.0)), 0.0)
        return curvature * np.where(compressed, cubic, 0.0)

    def membrane_energy(self, E: ArrayLike, history: np.ndarray | None = None) -> np.ndarray:
        """Return the stored energy density W^M [J/m³] of the centre strain E (..., 6).

        Maxwell elements store what their moments in the history (history_count, ...) say.
        """
        stored = self._energy_in_plane(E) + self._compaction_energy(self._seen(np.asarray(E)))
        return stored + self._remembered_energy(history)

    def _remembered_energy(self, history: np.ndarray | None) -> Any:
        """Return what Maxwell elements, friction and relaxing compaction store [J/m³]."""
        stored: Any = 0.0
        if history is None:
            return stored
        if self.viscous is not None:
            stored += self.viscous.stored(own_memory(self.law, self.viscous.memory, history)[3:])
        if self.shear_friction is not None:
            moment = own_memory(self.law, self.shear_friction.memory, history)[1]
            stored += moment**2 / (2.0 * self.shear_friction.modulus)
        return stored + self._stored_by_relaxation(history)

    def _stored_by_relaxation(self, history: np.ndarray) -> np.ndarray | float:
        if self.relaxation is None:
            return 0.0
        memory = own_memory(self.law, self.relaxation.memory, history)
        return self.relaxation.stored(memory, self.law, self._compaction_energy)

    def dissipated_energy(self, history: np.ndarray) -> np.ndarray:
        """Return what friction has dissipated [J/m³]; for rates see :meth:`viscous_energy`."""
        lost = self._lost_in_bending("bending_friction_loss", history)
        friction = self.shear_friction
        return (
            lost if friction is None else lost + own_memory(self.law, friction.memory, history)[2]
        )

    def viscous_energy(self, history: np.ndarray) -> np.ndarray:
        """Return what rates have dissipated [J/m³]; history (history_count, ...)."""
        lost = self._lost_in_bending("viscous_bending_loss", history)
        if self.viscous is not None:
            lost = lost + own_memory(self.law, self.viscous.memory, history)[2]
        if self.relaxation is not None:
            lost = lost + history[len(OWN_MEMORY) - 1] - self._stored_by_relaxation(history)
        return lost

    def _lost_in_bending(self, name: str, history: np.ndarray) -> np.ndarray:
        if self.bending_losses is None:
            return np.zeros(np.shape(history)[1:])
        return self.bending_losses.lost(
            name, own_memory(self.law, self.bending_losses.memory, history)
        )

    def rate_stress(self, E: np.ndarray, history: np.ndarray, step: Step) -> np.ndarray:
        """Return the part of S^M (..., 6) that depends on the step that leads to E (..., 6)."""
        S = np.zeros(np.shape(E))
        if self.temperature is not None:
            step = step._replace(size=step.size * history[place_in_memory(self.law, RATE_FACTOR)])
        if self.relaxation is not None:
            memory = own_memory(self.law, self.relaxation.memory, history)
            S += self.relaxing_stress(E, self.relaxed(E, memory, step.size))
        if self.viscous is not None:
            S += stress_of_step(
                self.viscous, E, own_memory(self.law, self.viscous.memory, history), step
            )
        if self.shear_friction is not None:
            memory, g = (
                own_memory(self.law, self.shear_friction.memory, history),
                np.asarray(E)[..., 3],
            )
            moment = self.shear_friction.in_step(g, memory, self._shear(g)[0])[1]
            S[..., 3] += self.shear_friction.stress_of(memory[0], g, moment)
        return S

    def initial_history(self, points: np.ndarray) -> np.ndarray:
        """Return what elements keep before anything has happened (history_count, E).

        Parameters
        ----------
        points : their centres in the undeformed blank (E, 3) [m].
        """
        history = np.zeros((history_count(self.law), len(points)))
        if self.temperature is not None:
            factor = self.temperature.rate_factor(self.temperature.at(points))
            history[place_in_memory(self.law, RATE_FACTOR)] = factor
        return history

    def relaxing_stress(self, E: np.ndarray, memory: np.ndarray) -> np.ndarray:
        """Return what relaxes of S^M (..., 6) at E, with the memory there."""
        S = np.zeros(np.shape(E))
        S[..., 2] = memory[len(OWN_MEMORY) :].sum(axis=0)
        if self.coupling is not None:
            mapped = self.coupling.at(E[..., 2], E[..., 3])
            S[..., 3] = mapped.g * S[..., 2]
            S[..., 2] *= mapped.E
        return S

    def relaxed(self, E: np.ndarray, memory: np.ndarray, size: ArrayLike) -> np.ndarray:
        """Return what a fabric remembers of its relaxation after a step to E (..., 6).

        Parameters
        ----------
        memory : before it, as :class:`CompactionRelaxation` tells. size : of the step [s].
        """
        assert self.relaxation is not None
        strain = self._seen(E)
        return self.relaxation.in_step(strain, self._compaction(strain)[0], memory, size)

    def viscosity(self, E: np.ndarray) -> np.ndarray:
        """Return the viscosities (..., 6) [Pa s] that bound the step at E (..., 6)."""
        viscosities = np.zeros(np.shape(E))
        if self.viscous is not None:
            slowest = 1.0 if self.temperature is None else self.temperature.slowest
            viscosities[..., 3] = slowest * self.viscous.bound(np.asarray(E)[..., 3])
        return viscosities

    def _energy_in_plane(self, E: ArrayLike) -> np.ndarray:
        """Return W^M without that of the compaction."""
        E = np.asarray(E)
        law = self.law
        e12 = 0.5 * np.abs(E[..., 3])
        s = (law.s0, law.s1, law.s2, law.s3, law.s4)
        shear = sum(4.0 * si * e12 ** (i + 2) / (i + 2) for i, si in enumerate(s))
        if self.locking is not None:
            shear += self.locking.energy(E[..., 3])
        if self.unlike_sides is not None:
            shear += self.unlike_sides.energy(E[..., 3])
        linear = 0.5 * (
            law.C11 * E[..., 0] ** 2
            + law.C22 * E[..., 1] ** 2
            + law.C23 * E[..., 4] ** 2
            + law.C13 * E[..., 5] ** 2
        )
        return linear + shear

    def _compaction_energy(self, E33: np.ndarray) -> np.ndarray:
        """Return the integral of c0 exp(u) E33 with u = c1 |E33|^c2, by its series in u.

        c0 E33² Σ u^k / (k! (2 + c2 k)): all terms are positive, and their sum converges for any u.
        """
        law = self.law
        u = law.c1 * np.maximum(-E33, 0.0) ** law.c2
        term = np.ones_like(u)
        total = 0.5 * term
        order = 0
        while np.any(term > 1e-17 * total):
            order += 1
            term = term * u / order
            total = total + term / (2.0 + law.c2 * order)
        return law.c0 * E33**2 * total

    def compaction_pressure(
        self,
        thickness_stretch: ArrayLike,
        history: np.ndarray | None = None,
        shear_strain: ArrayLike = 0.0,
    ) -> np.ndarray:
        """Return the pressure p = λ |S33| [Pa] of plates on the area at the start; 0 if thicker.

        shear_strain : g = sin γ at which the thickness stretch λ is held.
        """
        stretch = np.asarray(thickness_stretch, dtype=float)
        if self.coupling is None:
            return self._pressure(stretch, history)
        return self.coupling.pressure(
            lambda seen: self._pressure(seen, history), stretch, shear_strain
        )

    def _pressure(self, stretch: np.ndarray, history: np.ndarray | None) -> np.ndarray:
        stress, _ = self._compaction(0.5 * (stretch**2 - 1.0))
        return np.where(stretch < 1.0, -stretch * stress, 0.0)

    def wave_stiffness(self) -> tuple[float, float]:
        """Return the largest stiffness in the plane and over the thickness, undeformed [Pa]."""
        law, bending = self.law, np.array([self.law.B11, self.law.B22])
        if self.bending_losses is not None:
            bending = bending + self.bending_losses.glassy_moduli()
        normal = self.stress_and_tangent(np.zeros(6))[1][2, 2]
        return max(law.C11, law.C22, *bending), max(normal, law.B33)


# --- scene ----------------------------------------------------------------------------------------


class FabricMembrane(SceneModel):
    """Membrane and transverse shear stiffness of a fabric (paper section 3.2)."""

    C11: PositiveStiffness = Field(description="Stiffness along fibre direction 1.")
    C22: PositiveStiffness = Field(description="Stiffness along fibre direction 2.")
    shear_polynomial: Annotated[
        tuple[Stiffness, Stiffness, Stiffness, Stiffness, Stiffness],
        Row('"0.1919 -2.3637 14.7593 -40.7199 42.3208 MPa"', count=5, entries="coefficients"),
    ] = Field(description="s0 ... s4 of the shear stiffness C12(|E12|), Eq. (21).")
    shear_polynomial_negative: Annotated[
        tuple[Stiffness, Stiffness, Stiffness, Stiffness, Stiffness] | None,
        Row('"0.4 -2.4 14.8 -40.7 42.3 MPa"', count=5, entries="coefficients"),
        AbsentMeans("shear is alike to both sides"),
    ] = Field(
        default=None,
        description="s0 ... s4 where the shear angle is negative, the angle from fibres 1 to 2 "
        "above 90 deg; shear_polynomial is then that of the positive side.",
    )
    C23: PositiveStiffness = Field(description="Transverse shear stiffness 23.")
    C13: PositiveStiffness = Field(description="Transverse shear stiffness 13.")
    shear_convention: Literal["engineering", "tensor"] = Field(
        default="engineering",
        description="S12 = C12 * 2 E12 (engineering) or S12 = C12 * E12 (tensor).",
    )
    shear_range: Annotated[AcuteAngle | None, AbsentMeans("no warning beyond a range")] = Field(
        default=None,
        description="Shear angle up to which the shear law was measured; beyond it a run warns.",
    )
    friction: Annotated[ShearFrictionTable | None, AbsentMeans("sheared back as sheared")] = Field(
        default=None, description="Friction of the shear, beside the shear polynomial."
    )
    locking_angle: Annotated[AcuteAngle | None, AbsentMeans("the fabric does not lock")] = Field(
        default=None, description="Shear angle from which on the fabric locks."
    )
    locking_stiffness: Annotated[
        Annotated[float, Quantity(STIFFNESS, POSITIVE, "100 MPa")] | None,
        AbsentMeans("the fabric does not lock"),
    ] = Field(
        default=None,
        description="Shear stiffness dS12/d(2 E12) gained by locking up to a shear of 90 deg.",
    )

    @property
    def engineering_factor(self) -> float:
        """What makes shear moduli of the scene's convention act on engineering strains.

        The paper does not say whether its moduli act on 2 E12 or on E12: S12 = C12 (2 E12) in the
        engineering reading, C12 E12 in the tensor reading. The bias-extension force at 30 mm is
        6.8 N with the first and 3.4 N with the second.
        """
        return 1.0 if self.shear_convention == "engineering" else 0.5

    @property
    def unlike_sides(self) -> UnlikeSides | None:
        """How the shear to the negative side differs, None where both are alike."""
        if self.shear_polynomial_negative is None:
            return None
        sides = zip(self.shear_polynomial_negative, self.shear_polynomial, strict=True)
        return UnlikeSides(*(self.engineering_factor * (other - own) for other, own in sides))

    @property
    def locking(self) -> ShearLocking | None:
        """What the fabric does beyond its locking angle."""
        if self.locking_angle is None or self.locking_stiffness is None:
            return None
        return ShearLocking.from_angle(self.locking_angle, self.locking_stiffness)

    @model_validator(mode="after")
    def _check_locking(self) -> Self:
        given = {"locking_angle": self.locking_angle, "locking_stiffness": self.locking_stiffness}
        if None in given.values() and set(given.values()) != {None}:
            missing = next(name for name, value in given.items() if value is None)
            other = next(name for name, value in given.items() if value is not None)
            raise wrong(f"is needed together with {other}", field=missing)
        return self

    @model_validator(mode="after")
    def _check_shear_law(self) -> Self:
        # S12 ~ C12(E) E with E = sin(shear angle) / 2: monotone up to 90 deg means d(C12 E)/dE > 0.
        strain = np.linspace(0.0, 0.5, 2001)
        for field in ("shear_polynomial", "shear_polynomial_negative"):
            polynomial = getattr(self, field) or self.shear_polynomial
            tangent = np.sum([(k + 1) * s * strain**k for k, s in enumerate(polynomial)], axis=0)
            if tangent.min() <= 0.0:
                first = float(strain[np.argmax(tangent <= 0.0)])
                angle = math.degrees(math.asin(min(1.0, 2 * first)))
                raise wrong(
                    f"gives a falling shear stress from a shear angle of {angle:.1f} deg "
                    f"(tangent {float(tangent.min()) * 1e-6:.3g} MPa); the stress must rise up to "
                    "90 deg, check signs, order (s0 first) and units",
                    field=field,
                )
        return self


class FabricCompaction(ExponentialCompaction):
    """Compaction stiffness C33 = c0 exp(c1 |E33|^c2) (paper Eq. (23))."""

    shear_coupling: Annotated[float, Number(1.0, Range(0.0, 2.0))] = Field(
        default=0.0,
        description="Exponent β: fabric sheared by γ is thicker by 1/cos(γ)^β without pressure; "
        "0: shear does not thicken it, 1: the fibre volume fraction governs.",
    )
    table: Annotated[
        tuple[PressureCurveTable, ...],
        Row(
            '[{ shear_angle = "0 deg", stretch = [1.0, 0.9, 0.8], pressure = "0 0.01 0.1 MPa" }]',
            maximum_count=MOST_ANGLES,
            entries="curves",
            units=False,
        ),
        OrFile("compaction.csv", read_pressure_curves),
    ] = Field(
        default=(),
        description="Measured compaction at several shear angles, in place of shear_coupling; c0, "
        "c1, c2 lead between its points and beyond. Or a CSV file with the header `shear angle "
        "[deg],stretch [1],pressure [MPa]`; relative to the scene file.",
    )

    @property
    def coupling(self) -> Coupling | None:
        """How the thickness depends on the shear, None where it does not."""
        if self.table:
            return self._pressure_table()
        return PowerCoupling(self.shear_coupling) if self.shear_coupling else None

    def _pressure_table(self) -> PressureTable:
        return PressureTable([entry.curve for entry in self.table], self.c0, self.c1, self.c2)

    @model_validator(mode="after")
    def _check_table(self) -> Self:
        if not self.table:
            return self
        if self.shear_coupling:
            raise wrong("cannot stand beside table, which holds it; leave one out", field="table")
        if fault := self._pressure_table().fault():
            raise wrong(fault, field="table")
        return self


class FabricBending(SceneModel):
    """Bending stiffness C^B, independent of the membrane (paper Eq. (25))."""

    C11: PositiveStiffness = Field(description="Bending stiffness along fibre direction 1.")
    C22: PositiveStiffness = Field(description="Bending stiffness along fibre direction 2.")
    curve_1: Annotated[BendingCurveTable | None, AbsentMeans("C11 is constant")] = Field(
        default=None, description="Measured bending along fibre direction 1, in place of C11."
    )
    curve_2: Annotated[BendingCurveTable | None, AbsentMeans("C22 is constant")] = Field(
        default=None, description="Measured bending along fibre direction 2, in place of C22."
    )
    friction_1: Annotated[BendingFrictionTable | None, AbsentMeans("bent back as bent")] = Field(
        default=None, description="Friction of bending along fibre direction 1, beside C11."
    )
    friction_2: Annotated[BendingFrictionTable | None, AbsentMeans("bent back as bent")] = Field(
        default=None, description="Friction of bending along fibre direction 2, beside C22."
    )
    viscous_1: Annotated[BendingRateTable | None, AbsentMeans("no rate is resisted")] = Field(
        default=None, description="What resists the rate of bending along fibre direction 1."
    )
    viscous_2: Annotated[BendingRateTable | None, AbsentMeans("no rate is resisted")] = Field(
        default=None, description="What resists the rate of bending along fibre direction 2."
    )
    C33: PositiveStiffness = Field(description="Stiffness against a gradient of compaction.")
    C12: PositiveStiffness = Field(description="Torsional stiffness.")
    C23: PositiveStiffness = Field(description="Transverse shear stiffness 23.")
    C13: PositiveStiffness = Field(description="Transverse shear stiffness 13.")
    in_plane: Annotated[float, Number(0.1, NOT_NEGATIVE)] = Field(
        default=0.1,
        description="Stiffness of the fibres against bending within the plane, over that against "
        "bending out of it: a regularisation that gives shear bands a width, no measured property; "
        "0: none, as published.",
    )

    @property
    def curves(self) -> tuple[BendingCurve | None, BendingCurve | None]:
        """Measured bending along both directions."""
        first, second = (
            None if table is None else table.curve for table in (self.curve_1, self.curve_2)
        )
        return first, second

    @property
    def rubs(self) -> bool:
        """Whether there is friction along either direction."""
        return self.friction_1 is not None or self.friction_2 is not None

    @property
    def resists_rates(self) -> bool:
        """Whether the bending along either direction depends on its rate."""
        return self.viscous_1 is not None or self.viscous_2 is not None

    def losses(self, thickness: float) -> BendingLosses | None:
        """What the bending of a sheet of a thickness [m] loses."""
        return bending_losses(
            (self.friction_1, self.friction_2), (self.viscous_1, self.viscous_2), thickness
        )


#: The published fabrics of :mod:`lcmchain.scene.presets`, which knows this law.
PresetName = Literal["MD600", "glass-plain-600", "carbon-twill-200"]


class FabricMaterial(FabricTable):
    """Biaxial fabric: shear polynomial, exponential compaction, decoupled bending."""

    families: ClassVar[tuple[str, ...]] = ("solid-shell", "membrane-shell", "kinematic")

    law: Literal["fabric"] = "fabric"
    preset: Annotated[PresetName | None, AbsentMeans("")] = Field(
        default=None, description="Published fabric whose values fill all keys not given."
    )
    name: Annotated[str, Text("MD600")] = Field(
        default="fabric", description="Name of the fabric in reports."
    )
    thickness: PositiveLength = Field(description="Thickness t0 of the unloaded fabric.")
    areal_mass: ArealMass = Field(description="Fibre mass per area.")
    fibre_density: Density = Field(description="Density of the fibres themselves.")
    membrane: FabricMembrane
    compaction: FabricCompaction
    bending: FabricBending
    viscous: Annotated[ViscousTable | None, AbsentMeans("nothing depends on a rate")] = Field(
        default=None,
        description="What resists the rate of the shear, in wet fabric, and relaxes of compaction.",
    )

    @property
    def locks(self) -> bool:
        return self.membrane.locking is not None

    @property
    def couples_shear(self) -> bool:
        return self.compaction.coupling is not None

    def without_shear_coupling(self) -> Self:
        """Return the fabric whose thickness does not depend on its shear, that of c0, c1, c2."""
        return self._with("compaction", shear_coupling=0.0, table=())

    def without_locking(self) -> Self:
        """Return the fabric whose shear law goes on beyond the locking angle."""
        return self._with("membrane", locking_angle=None, locking_stiffness=None)

    @property
    def resists_rates(self) -> bool:
        return self.viscous is not None

    @property
    def resists_shear_rates(self) -> bool:
        return self.viscous is not None and self.viscous.resists

    @property
    def relaxes(self) -> bool:
        return self.viscous is not None and bool(self.viscous.compaction)

    @property
    def temperature_varies(self) -> bool:
        return self.viscous is not None and self.viscous.field is not None

    def without_rates(self) -> Self:
        """Return the fabric of which nothing depends on a rate."""
        return self.model_copy(update={"viscous": None})

    def without_viscosity(self) -> Self:
        """Return the fabric whose shear does not depend on its rate."""
        left = self.viscous.without_shear() if self.relaxes and self.viscous else None
        return self.model_copy(update={"viscous": left})

    def without_relaxation(self) -> Self:
        """Return the fabric whose compaction does not relax."""
        if self.viscous is None or not self.resists_shear_rates:
            return self.without_rates()
        return self.model_copy(
            update={"viscous": self.viscous.model_copy(update={"compaction": ()})}
        )

    @property
    def shear_rubs(self) -> bool:
        return self.membrane.friction is not None

    def without_shear_friction(self) -> Self:
        """Return the fabric that is sheared back as it was sheared."""
        return self._with("membrane", friction=None)

    @property
    def bending_rubs(self) -> bool:
        return self.bending.rubs

    def without_bending_friction(self) -> Self:
        """Return the fabric that is bent back as it was bent."""
        return self._with("bending", friction_1=None, friction_2=None)

    @property
    def bending_resists_rates(self) -> bool:
        return self.bending.resists_rates

    def without_viscous_bending(self) -> Self:
        """Return the fabric whose bending does not depend on its rate."""
        return self._with("bending", viscous_1=None, viscous_2=None)

    def law_parameters(self) -> FabricLaw:
        """Return the parameters in SI."""
        m, c, b = self.membrane, self.compaction, self.bending
        f = m.engineering_factor
        law = FabricLaw(  # type: ignore[call-arg]
            m.C11, m.C22, f * m.C23, f * m.C13,
            *(f * s for s in m.shear_polynomial),
            c.c0, c.c1, c.c2,
            b.C11, b.C22, b.C33, f * b.C12, f * b.C23, f * b.C13,
        )  # fmt: skip
        return FabricLaw(*(float(p) for p in law))

    def build(self) -> Fabric:
        """Return the fabric."""
        return Fabric(self.law_parameters(), **self.sheet_parameters())

    def sheet_parameters(self) -> dict[str, Any]:
        """Return what :class:`Fabric` takes beside the law."""
        return {
            "thickness": self.thickness,
            "areal_mass": self.areal_mass,
            "fibre_density": self.fibre_density,
            "name": self.name,
            "shear_range": self.membrane.shear_range,
            "locking": self.membrane.locking,
            "in_plane_bending": self.bending.in_plane,
            "coupling": self.compaction.coupling,
            "bending_curves": self.bending.curves,
            "viscous": None if self.viscous is None else self.viscous.viscous,
            "relaxation": None if self.viscous is None else self.viscous.relaxation,
            "temperature": None if self.viscous is None else self.viscous.field,
            "bending_losses": self.bending.losses(self.thickness),
            "unlike_sides": self.membrane.unlike_sides,
            "shear_friction": None
            if self.membrane.friction is None
            else self.membrane.friction.friction,
        }
