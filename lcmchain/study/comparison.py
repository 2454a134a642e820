"""How far the result of a run lies from that of another, quantity by quantity.

Fields are compared on the undeformed sheet, where every place is a place of the material: the value
of a cell in one run is compared with that of the same material in the other. The faces of one mesh
are carried onto those of the other by the mapping of the project (:mod:`lcmchain.mapping`), overlap
weights of second order.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from lcmchain.study.outcome import Outcome


@dataclass(frozen=True)
class Quantity:
    """A quantity that runs are compared by.

    Parameters
    ----------
    name : for files. title : for texts; short : for narrow tables. unit : of its error.
    scale : from SI to that unit. aliases : what a user may call it.
    relative : whether the error is a part of the quantity itself.
    usual_order : by which its error falls with the edge length, as studies of accuracy find it
        (``lcmchain docs accuracy-table``): shear and contour follow the interpolation of the
        element, thickness the edges of contact.
    """

    name: str
    title: str
    short: str
    unit: str
    scale: float
    aliases: tuple[str, ...] = ()
    relative: bool = False
    usual_order: float = 1.5

    def text(self, error: float) -> str:
        """Return an error in SI, or as a part, with its unit."""
        return "-" if math.isnan(error) else f"{self.scale * error:.2g} {self.unit}"


#: What studies compare, in the order of their tables. A forming run has a punch, a coupon clamps.
QUANTITIES = (
    Quantity(
        "shear_angle", "shear angle", "shear", "°", 180.0 / math.pi, ("shear", "angle"),
        usual_order=1.5,
    ),
    Quantity(
        "thickness", "thickness", "t", "%", 100.0, ("thick",), relative=True, usual_order=1.0
    ),
    Quantity(
        "fibre_volume_fraction", "fibre volume fraction", "v_f", "%", 100.0,
        ("vf", "v_f", "fvf", "fibre volume content"), relative=True, usual_order=1.0,
    ),
    Quantity("contour", "contour", "contour", "mm", 1e3, ("outline", "draw-in")),
    Quantity("punch_force", "punch force", "force", "%", 100.0, ("force",), relative=True),
    Quantity("clamp_force", "clamp force", "force", "%", 100.0, (), relative=True),
    Quantity("forming_work", "forming work", "work", "%", 100.0, ("work", "energy"), relative=True),
)  # fmt: skip
#: Entries of ``Outcome.numbers`` of the quantities that are a number.
NUMBERS = {
    "punch_force": "punch_force_max_N",
    "clamp_force": "clamp_force_max_N",
    "forming_work": "forming_work_J",
}
BY_NAME = {quantity.name: quantity for quantity in QUANTITIES}


@dataclass(frozen=True)
class Difference:
    """Difference of one quantity of two runs, in SI or as a part of the quantity.

    Parameters
    ----------
    typical : root mean square over the sheet, or the size of the difference of a number.
    high : what 95 % of the sheet stay below. largest : anywhere. Of a number the same as typical.
    """

    typical: float
    high: float
    largest: float

    @classmethod
    def of_number(cls, value: float) -> Difference:
        """Return the difference of a number."""
        return cls(abs(value), abs(value), abs(value))

    @classmethod
    def of_field(cls, values: np.ndarray, areas: np.ndarray) -> Difference:
        """Return the difference of a field with values (F,) over areas (F,)."""
        size, there = np.abs(values), np.isfinite(values) & (areas > 0.0)
        size, areas = size[there], areas[there]
        if size.size == 0:
            return NONE
        order = np.argsort(size)
        covered = np.cumsum(areas[order])
        high = size[order][np.searchsorted(covered, 0.95 * covered[-1])]
        typical = math.sqrt(np.sum(areas * size**2) / covered[-1])
        return cls(typical, float(high), float(size.max()))


NONE = Difference(math.nan, math.nan, math.nan)


def differences(outcome: Outcome, reference: Outcome) -> dict[str, Difference]:
    """Return the differences of a run from a reference by the names of ``QUANTITIES``.

    Quantities that either does not have (a rung without thickness, a scene without tools) are not
    a number; so are all of a run that failed, or of stacks of unlike numbers of plies.
    """
    unlike = len(outcome.plies) != len(reference.plies)
    if outcome.failure or reference.failure or unlike:
        return dict.fromkeys(BY_NAME, NONE)
    by_name = dict.fromkeys(BY_NAME, NONE)
    names = [name for name in reference.values if name in outcome.values]
    carried, areas = carry(outcome, reference, names)
    for name, values in carried.items():
        difference = values - reference.values[name]
        if BY_NAME[name].relative:
            difference = difference / reference.values[name]
        by_name[name] = Difference.of_field(difference, areas)
    by_name["contour"] = contour_difference(outcome, reference)
    for name, number in NUMBERS.items():
        value, other = (o.numbers.get(number, math.nan) for o in (outcome, reference))
        if math.isfinite(value) and math.isfinite(other) and other != 0.0:
            by_name[name] = Difference.of_number(value / other - 1.0)
    return by_name


def quantities_of(outcome: Outcome) -> list[str]:
    """Return the names of the ``QUANTITIES`` that a run has."""
    numbers = {
        name
        for name, number in NUMBERS.items()
        if math.isfinite(outcome.numbers.get(number, math.nan))
    }
    there = {*outcome.values, *numbers, *(["contour"] if len(outcome.faces) else [])}
    return [name for name in BY_NAME if name in there]


def carry(
    outcome: Outcome, onto: Outcome, names: list[str]
) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Carry fields of a run onto the undeformed faces of another, place by place of the material.

    Every ply of a stack is carried onto the same ply.

    Returns
    -------
    Means over the faces (F,) by name, and the areas of the faces that the other sheet covers [m²].
    """
    from lcmchain.mapping.fields import covered_areas, transfer_average
    from lcmchain.mapping.sheet import Sheet
    from lcmchain.mapping.surfaces.surface import Surface
    from lcmchain.mapping.transfer import compute_weights
    from lcmchain.mapping.verify import as_target

    carried = {name: np.full(len(onto.faces), np.nan) for name in names}
    areas = np.zeros(len(onto.faces))
    for mine, others in zip(outcome.plies, onto.plies, strict=True):
        values = {name: outcome.values[name][mine] for name in names}
        sheet = Sheet(Surface(outcome.reference, outcome.faces[mine]), values, {})
        target, face = as_target(Surface(onto.reference, onto.faces[others]))
        weights = compute_weights(sheet, target)
        rows = others[face]  # the target orders its cells by type
        for name in names:
            carried[name][rows] = transfer_average(sheet, weights, values[name])
        areas[rows] = covered_areas(weights)
    return carried, areas


def contour_difference(outcome: Outcome, reference: Outcome) -> Difference:
    """Return how far the formed edges lie from each other, both ways [m]; ply by ply of a stack."""
    distances, lengths = [], []
    for mine, others in zip(outcome.plies, reference.plies, strict=True):
        edges = [boundary(outcome.faces[mine]), boundary(reference.faces[others])]
        if min(len(e) for e in edges) == 0:
            return NONE
        for (a, own), (b, far) in (
            ((outcome, edges[0]), (reference, edges[1])),
            ((reference, edges[1]), (outcome, edges[0])),
        ):
            middles = a.formed[own].mean(axis=1)
            distances.append(distances_to_segments(middles, b.formed[far]))
            length = np.linalg.norm(a.formed[own[:, 1]] - a.formed[own[:, 0]], axis=1)
            lengths.append(length / length.sum())
    return Difference.of_field(np.concatenate(distances), np.concatenate(lengths))


def boundary(faces: np.ndarray) -> np.ndarray:
    """Return the edges (E, 2) that belong to one face only, of faces (F, 4) with -1 for none."""
    last = np.where(faces[:, 3] < 0, faces[:, 2], faces[:, 3])
    closed = np.column_stack([faces[:, :3], last, faces[:, 0]])
    edges = np.concatenate([closed[:, k : k + 2] for k in range(4)])
    edges = edges[edges[:, 0] != edges[:, 1]]
    _, first, count = np.unique(
        np.sort(edges, axis=1), axis=0, return_index=True, return_counts=True
    )
    return edges[np.sort(first[count == 1])]


def distances_to_segments(points: np.ndarray, segments: np.ndarray) -> np.ndarray:
    """Return the distances [m] of points (P, 3) from the nearest of segments (S, 2, 3)."""
    start, along = segments[:, 0], segments[:, 1] - segments[:, 0]
    squared = np.maximum(np.einsum("si,si->s", along, along), np.finfo(float).tiny)
    nearest = np.empty(len(points))
    for k, point in enumerate(points):
        relative = point - start
        share = np.clip(np.einsum("si,si->s", relative, along) / squared, 0.0, 1.0)
        nearest[k] = np.linalg.norm(relative - share[:, None] * along, axis=1).min()
    return nearest
