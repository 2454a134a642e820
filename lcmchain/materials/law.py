"""What a material law gives to the elements, and how kernels find it.

A law is a flat NamedTuple of its parameters, numbers or arrays [SI]: a parallel loop takes no
nested tuples. The file of a law registers its answer to each function of the protocol below with
the decorator ``implements``. A kernel that is compiled for a law calls that law's own functions,
which are inlined. Nothing else in the program needs to know the law.

Strains and stresses are Green-Lagrange and second Piola-Kirchhoff in the reference fibre axes,
Voigt order 11, 22, 33, 12, 23, 13 with engineering shear strains. A stiffness has one of four forms
(:mod:`lcmchain.materials.stiffness`): a tuple of six moduli where it is diagonal, an
``Orthotropic`` where it couples the normal strains alone, an ``AlongFibres`` of moduli of
directions in the plane, each of which may depend on its own strain, else a tuple of six rows. A
fabric whose thickness depends on its shear answers the diagonal, and the one modulus beside it by
``tangent_coupling``.

A law with memory lists in ``remembers`` the numbers that each element keeps, any count of them,
zero at first. Kernels hand them to the law as a tuple, as they were after the last step. What the
law answers for a strain holds for the end of a step that leads there; :func:`evolved_history` gives
the numbers then. A law that says ``knows_step = True`` finds the :class:`Step` behind them: its
size and its time are the last two numbers of the tuple. Where no step is made, as when energies are
asked for, its size is 0, and the law answers as if no time passed. :func:`viscosity` tells what
resists a rate; it bounds the step.

Beside the law stands a :class:`Material`: the law with the constants of a sheet, in plain NumPy,
for the rest of the program. Both are written apart, so that each checks the other.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np
from numba.extending import overload
from numpy.typing import ArrayLike

from lcmchain.dispatch import implements, is_implemented, optional, required
from lcmchain.errors import InputError
from lcmchain.jit import INLINED
from lcmchain.materials.stiffness import product

__all__ = [
    "Material",
    "Remembered",
    "Step",
    "TangentCoupling",
    "bending_bound",
    "bending_excess",
    "bending_losses_of",
    "bending_response",
    "bending_stiffness",
    "bending_stress",
    "bending_stress_in_step",
    "bending_viscosity",
    "bends_at_reference_thickness",
    "bends_by_curves",
    "couples_shear",
    "evolved_bending",
    "evolved_history",
    "fibre_angles",
    "history_count",
    "hourglass_tangent",
    "implements",
    "is_film",
    "knows_step",
    "load_history",
    "load_past",
    "locking_angles",
    "membrane_response",
    "own_memory",
    "place_in_memory",
    "plane_bending_stiffness",
    "plane_response",
    "remembered",
    "serves_planes",
    "stabilising_tangent",
    "store_history",
    "stored_bending",
    "stress_in_step",
    "sum_text",
    "takes_fibre_share",
    "tangent_coupling",
    "tangent_coupling_of",
    "tangent_curvature",
    "tangent_slope",
    "tells_fibres",
    "unrolled",
    "viscosity",
    "viscosity_of",
    "with_bending_losses",
    "with_fibre_modulus",
]


class Remembered(NamedTuple):
    """A number that a law remembers in every element: its name as a field, unit, and meaning."""

    name: str
    unit: str
    meaning: str


#: The parameters of a law: a NamedTuple, whose class chooses what compiled code does.
Law = tuple[Any, ...]


class Step(NamedTuple):
    """The step at whose end a law is asked.

    size : time that passes for the sheet [s], 0 where none does. time : of the process then [s].
    """

    size: Any
    time: Any


class TangentCoupling(NamedTuple):
    """What couples the normal strain E33 with the shear g = 2 E12 in a tangent that is diagonal.

    modulus : dS33/dg of C^M. slope, mixed, curvature : dC33/dg, d²C33/dE33dg and d²C33/dg² of the
    stabilising tangent.
    """

    modulus: Any
    slope: Any
    mixed: Any
    curvature: Any


def remembered(law: object) -> tuple[Remembered, ...]:
    """Return what the law remembers, nothing for one without memory."""
    return getattr(law, "remembers", ())


def history_count(law: object) -> int:
    """Return how many numbers per element the law remembers."""
    return len(remembered(law))


def place_in_memory(law: object, entry: Remembered) -> int:
    """Return where an entry stands in what a law, or a class of laws, remembers."""
    return remembered(law).index(entry)


def own_memory(law: object, entries: Sequence[Remembered], history: np.ndarray) -> np.ndarray:
    """Return those of the numbers that a law remembers which stand for some entries in a row.

    Parameters
    ----------
    history : (history_count, ...), all that it remembers.
    """
    first = place_in_memory(law, entries[0])
    return history[first : first + len(entries)]


def knows_step(law: object) -> bool:
    """Tell whether a law finds the step behind the numbers that it remembers."""
    return bool(getattr(law, "knows_step", False))


# --- compiled -------------------------------------------------------------------------------------


@required
def membrane_response(law, E, history):
    """Return the stress S^M at the centre strain E (6), Eq. (19), and the tangent C^M."""


@required
def bending_stiffness(law):
    """Return C^B, Eq. (25), constant: the stiffness of the strains linear and quadratic in ζ."""


@optional
def bending_stress(law, C_B, E, inverse_height):
    """Return the stress S^ζ (6) of the strain E^ζ linear in ζ; E^ζ times 1/h is a curvature.

    It is stiffest at zero, where its slope is C^B: the step is bound by that.
    """
    return product(C_B, E)


@optional
def with_bending_losses(law, S, E, inverse_height, history):
    """Return S^ζ with what friction and rates of the bending add; as it is for a law without.

    The history is that of the start of a step, as for :func:`membrane_response`.
    """
    return S


@optional
def evolved_bending(law, E, inverse_height, history):
    """Return what a law remembers of its bending at the end of a step to E^ζ; nothing by default.

    It stands behind all that :func:`evolved_history` returns.
    """
    return ()


@optional
def stored_bending(law, history):
    """Return twice the energy that a law's memory of the bending stores, over h² [J/m³/m²]."""
    return 0.0


@optional
def bending_bound(law):
    """Return C^B that bounds the step, with all that may stiffen the strains linear in ζ."""
    return bending_stiffness(law)


@optional
def bending_viscosity(law):
    """Return two viscosities [Pa s], of S11 and S22 over the rate of E^ζ; ``None`` for none."""
    return None


@optional
def bending_excess(law, E, inverse_height):
    """Return 2 W^B - S^ζ:E^ζ [J/m³], by which twice the energy exceeds stress times strain."""
    return 0.0


@optional
def hourglass_tangent(law, E, C_M, history):
    """Return the tangent of Eq. (18) that stabilises the element: C^M, or one without its kinks."""
    return C_M


@optional
def tangent_slope(law, E, history):
    """Return the six dC_ii/dE_i of the stabilising tangent; ``None`` where it is always zero."""
    return (None, None, None, None, None, None)


@optional
def tangent_curvature(law, E, history):
    """Return the six d²C_ii/dE_i² of the stabilising tangent; ``None`` where always zero."""
    return (None, None, None, None, None, None)


@optional
def tangent_coupling(law, E, history):
    """Return the :class:`TangentCoupling` of the normal strain and the shear; ``None`` for none."""
    return None


@optional
def evolved_history(law, E, history):
    """Return the history at the end of a step that leads to the centre strain E."""
    return history


@optional
def viscosity(law, E, history):
    """Return six viscosities [Pa s], bounds of dS_ii over dE_i/dt at E; ``None`` for one without.

    A viscosity may be ``None`` where a component resists no rate.
    """
    return None


@required
def plane_response(law, E11, E22, g12):
    """Return (S11, S22, S12) and the moduli (C11, C22, C12) of a sheet without thickness.

    For the 2D approach; a law that does not answer serves solid-shells only.
    """


@required
def plane_bending_stiffness(law):
    """Return the moduli (C11^B, C22^B, C12^B) of the curvatures, for the 2D approach."""


def serves_planes(law: object) -> bool:
    """Tell whether a law answers for sheets without thickness."""
    return is_implemented(plane_response, type(law))


# The history of one lane is spread over rows of LANES numbers. The compiler must know the length of
# a tuple: a function is written for each count of numbers.


@functools.cache
def _loader(count: int, with_step: bool, arguments: str) -> Callable[..., tuple]:
    """Return a function that loads so many numbers, and puts the step behind them or not."""
    numbers = [f"data[i + {k} * stride], " for k in range(count)]
    if with_step:
        numbers.append("step.size, step.time" if "step" in arguments else "0.0, 0.0")
    return written(f"lambda {arguments}: ({''.join(numbers)})")


@functools.cache
def _storer(count: int) -> Callable[..., None]:
    """Return a function that stores so many numbers."""
    lines = [f"    data[i + {k} * stride] = values[{k}]\n" for k in range(count)] or ["    pass\n"]
    names: dict[str, Any] = {"__name__": __name__}
    exec("def store(law, values, data, i, stride):\n" + "".join(lines), names)
    return names["store"]


def written(text: str, **names: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function from its text, for what is written out for a count of numbers.

    names : what the text calls.
    """
    return eval(text, {"__name__": __name__, **names})


def sum_text(terms: list[str]) -> str:
    """Return the text of a sum, for what is written out."""
    return " + ".join(terms) or "0.0"


_WITHOUT_STEP, _WITH_STEP = "law, data, i, stride", "law, data, i, stride, step"


def unrolled(
    text_of: Callable[..., str], **names: Callable[..., Any]
) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Make a function whose text is written out for what a class of laws has a count of.

    Parameters
    ----------
    text_of : returns the text for a class. names : what it calls. The decorated function gives its
        name and arguments, the law first.
    """

    def register(stub: Callable[..., Any]) -> Callable[..., Any]:
        @functools.wraps(stub)
        def function(law, *others):
            return written(text_of(type(law)), **names)(law, *others)

        def choose(law, *others):
            return written(text_of(law.instance_class), **names)

        overload(function, jit_options=INLINED, strict=False)(choose)
        return function

    return register


def load_history(law: object, data: np.ndarray, i: int, stride: int) -> tuple:
    """Return the history at ``data[i + k * stride]`` as a tuple, for a law asked in no step."""
    return _loader(history_count(law), knows_step(law), _WITHOUT_STEP)(law, data, i, stride)


@overload(load_history, jit_options=INLINED)
def _choose_loader(law, data, i, stride):
    law_class = law.instance_class
    return _loader(history_count(law_class), knows_step(law_class), _WITHOUT_STEP)


def load_past(law: object, data: np.ndarray, i: int, stride: int, step: Step) -> tuple:
    """Return what :func:`load_history` does, for a law asked at the end of a step."""
    return _loader(history_count(law), knows_step(law), _WITH_STEP)(law, data, i, stride, step)


@overload(load_past, jit_options=INLINED)
def _choose_loader_of_step(law, data, i, stride, step):
    law_class = law.instance_class
    return _loader(history_count(law_class), knows_step(law_class), _WITH_STEP)


def store_history(law: object, values: tuple, data: np.ndarray, i: int, stride: int) -> None:
    """Write what :func:`load_history` reads."""
    _storer(history_count(law))(law, values, data, i, stride)


@overload(store_history, jit_options=INLINED)
def _choose_storer(law, values, data, i, stride):
    return _storer(history_count(law.instance_class))


# --- plain Python ---------------------------------------------------------------------------------


class Material(Protocol):
    """A law with the constants of a sheet, as everything outside the kernels sees it.

    law : NamedTuple of the parameters. name : as in the scene.
    thickness : initial [m]. areal_mass [kg/m²]. density [kg/m³]. fibre_density [kg/m³] or None.
    is_diagonal : whether C^M and C^B are diagonal in the fibre axes; ``tangent_coupling`` may
        couple 33 and 12 in C^M even so.
    constant_tangent : whether C^M never changes.
    compacts : whether the stiffness over the thickness grows with the compaction.
    shear_range : shear angle [rad] up to which the law was measured, None where nobody says.
    fibre_bending : stiffness per width of the fibres 1 and 2 against bending within the plane
        [N m]; zeros without.
    locks : whether the shear tangent may come to that of the fibres.
    couples_thickness : whether C^B couples the normal stress 33 with other strains than 33.
    """

    law: Any  # of the material's own class of laws
    name: str
    thickness: float
    areal_mass: float
    density: float
    fibre_density: float | None
    is_diagonal: bool
    constant_tangent: bool
    shear_range: float | None
    fibre_bending: tuple[float, float]

    @property
    def compacts(self) -> bool: ...

    @property
    def locks(self) -> bool: ...

    @property
    def couples_thickness(self) -> bool: ...

    def stress_and_tangent(self, E: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return S^M (..., 6) and C^M (..., 6, 6) of centre strains E (..., 6), first loading."""

    def tangent_slope(self, E: np.ndarray) -> np.ndarray:
        """Return dC_ii/dE_i (..., 6) of C^M."""

    def tangent_curvature(self, E: np.ndarray) -> np.ndarray:
        """Return d²C_ii/dE_i² (..., 6) of C^M."""

    def bending_matrix(self) -> np.ndarray:
        """Return C^B (6, 6)."""

    def membrane_energy(self, E: np.ndarray, history: np.ndarray | None = None) -> np.ndarray:
        """Return the stored energy density W^M [J/m³] of centre strains E (..., 6).

        history : (history_count, ...), of a law with memory.
        """

    def compaction_pressure(
        self, thickness_stretch: ArrayLike, history: np.ndarray | None = None
    ) -> np.ndarray:
        """Return the tool pressure p = λ |S33| [Pa] of plate-to-plate compaction; 0 if thicker."""

    def wave_stiffness(self) -> tuple[float, float]:
        """Return the largest stiffness in the plane and over the thickness, undeformed [Pa]."""


def stabilising_tangent(
    material: Material, E: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the tangent (..., 6, 6) that stabilises the element, its slope and curvature (..., 6).

    A material whose law implements :func:`hourglass_tangent` offers a method of this name; that of
    the others is C^M.
    """
    method = getattr(material, "stabilising_tangent", None)
    if method is not None:
        return method(E)
    tangent = material.stress_and_tangent(E)[1]
    return tangent, material.tangent_slope(E), material.tangent_curvature(E)


def bending_response(
    material: Material, E: np.ndarray, height: ArrayLike
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return S^ζ (..., 6), its tangent (..., 6, 6) and 2 W^B - S^ζ:E^ζ (...) at E^ζ (..., 6).

    height : half the thickness of the element in the reference (...) [m]. A material whose law
    implements :func:`bending_stress` says so by ``bends_by_curves`` and offers a method of this
    name.
    """
    if bends_by_curves(material):
        return material.bending_response(E, height)  # type: ignore[attr-defined]
    C_B = material.bending_matrix()
    return E @ C_B.T, np.broadcast_to(C_B, (*E.shape, 6)), np.zeros(E.shape[:-1])


def bends_by_curves(material: Material) -> bool:
    """Tell whether the bending stiffness of a material changes with the curvature."""
    return bool(getattr(material, "bends_by_curves", False))


def bending_losses_of(material: Material) -> Any:
    """Return what the bending of a material loses; None without.

    See :class:`.features.bending_losses.BendingLosses`.
    """
    return getattr(material, "bending_losses", None)


def bends_at_reference_thickness(material: Material) -> bool:
    """Tell whether the bending of a material is always that of its initial thickness.

    So are measured moments: curves, friction, and what resists the rate.
    """
    return bends_by_curves(material) or bending_losses_of(material) is not None


def tangent_coupling_of(
    material: Material, E: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Return dC33/dg, d²C33/dE33dg and d²C33/dg² (...) of the stabilising tangent at E (..., 6).

    ``None`` for a material whose C33 does not depend on the shear; one where it does says so by
    ``couples_shear`` and offers a method ``tangent_coupling``.
    """
    if not couples_shear(material):
        return None
    return material.tangent_coupling(E)  # type: ignore[attr-defined]


def takes_fibre_share(material: Material) -> bool:
    """Tell whether elements may stabilise the fibres of a material with a share of them."""
    return material.is_diagonal or hasattr(material, "stabilising_terms")


def fibre_angles(material: Material) -> tuple[float, ...]:
    """Return the angle [rad] of every family of fibres from the first axis of the ply.

    By default two families along both axes.
    """
    return getattr(material, "fibre_angles", (0.0, 0.5 * np.pi))


def locking_angles(material: Material) -> tuple[float | None, ...]:
    """Return the shear angle [rad] beyond which each pair of families locks, None where none does.

    In the order of the fields ``shear_angle``, ``shear_angle_23``, ``shear_angle_31``. By default
    no pair locks.
    """
    return getattr(material, "locking_angles", (None,))


def is_film(material: Material) -> bool:
    """Tell whether a sheet is a film, which is taken off the preform after forming."""
    return bool(getattr(material, "is_film", False))


def tells_fibres(material: Material) -> bool:
    """Tell whether the axes and the mass of a sheet are those of fibres."""
    return bool(getattr(material, "has_directions", True)) and not is_film(material)


def couples_shear(material: Material) -> bool:
    """Tell whether the thickness of a material depends on its shear."""
    return bool(getattr(material, "couples_shear", False))


def viscosity_of(material: Material, E: np.ndarray) -> np.ndarray:
    """Return the viscosities (..., 6) [Pa s] that bound the step at E; zeros for most materials.

    A material whose law implements :func:`viscosity` offers a method of this name.
    """
    method = getattr(material, "viscosity", None)
    return np.zeros(np.shape(E)) if method is None else method(E)


def stress_in_step(
    material: Material, E: np.ndarray, history: np.ndarray | None, step: Step | None
) -> tuple[np.ndarray, np.ndarray]:
    """Return S^M (..., 6) and C^M (..., 6, 6) at the end of a step that leads to E (..., 6).

    history : (history_count, ...) at its start. A material offers a method
    ``rate_stress(E, history, step)`` with the part of the stress that depends on both.
    """
    S, C = material.stress_and_tangent(E)
    method = getattr(material, "rate_stress", None)
    if history is None or method is None:
        return S, C
    return S + method(E, history, Step(0.0, 0.0) if step is None else step), C


def bending_stress_in_step(
    material: Material,
    E: np.ndarray,
    height: float,
    history: np.ndarray | None,
    step: Step | None,
) -> np.ndarray:
    """Return what friction and rates add to S^ζ (6,) at the end of a step that leads to E^ζ (6,).

    height : half the thickness of the element [m]. history : (history_count,) at the start of the
    step. A material whose law implements :func:`with_bending_losses` has ``bending_losses``.
    """
    S, losses = np.zeros(6), bending_losses_of(material)
    if losses is None or history is None:
        return S
    before = own_memory(material.law, losses.memory, history)
    after = losses.in_step(E[:2] / height, before, 0.0 if step is None else step.size)
    S[:2] = height * losses.per_stiffness * losses.moments(after)
    return S


def with_fibre_modulus(material: Material, factor: float) -> Material:
    """Return the material with the moduli of its fibres in the membrane times a factor.

    A material with fibres offers a method of this name, and keeps ``fibre_modulus_factor``.

    Raises
    ------
    InputError : the law does not tell fibres from the rest.
    """
    if factor == 1.0:
        return material
    method = getattr(material, "with_fibre_modulus", None)
    if method is None:
        raise InputError(
            f"is {factor:g}, but the law of {material.name} has no fibres whose modulus could be "
            "lowered; leave it out",
            key="process.fibre_modulus_factor",
        )
    return method(factor)


class MaterialWithMemory(Material, Protocol):
    """What a :class:`Material` offers too if its law remembers anything."""

    def dissipated_energy(self, history: np.ndarray) -> np.ndarray:
        """Return the energy density [J/m³] that a law with memory has dissipated so far."""
