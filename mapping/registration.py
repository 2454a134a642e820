"""How a target lies to the sheet, and the small rigid motion that would bring the two together."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from lcmchain.mapping.sheet import Sheet
from lcmchain.mapping.surfaces.search import SmoothSurface, closest_points
from lcmchain.mapping.target import TargetMesh
from lcmchain.thresholds import LARGEST_TARGET_DISTANCE

# Places of the target that are compared; of more, so many are drawn at random (the same ones each
# time). The motion has six components, found from the first of them.
COMPARED, FITTED = 20_000, 4_000

# Places farther from the sheet than this part of its size say nothing of how it lies.
REACH = 0.1

# Mean square of the sine of the angle between the target's path in a motion and the sheet. From the
# first on (6 degrees) distances determine the motion; from the second on (1 degree) only where the
# motion explains more of the distances than it leaves, because there a small difference in shape
# looks like a large motion; below, the target slides. Facets blur it by FACET_BLUR times the mean
# square of the angles at which they meet.
STEEP, SLIDING = 0.01, 3e-4
FACET_BLUR = 0.1
EXPLAINS = np.sqrt(0.5)

# Distances beyond so many standard deviations, as their median tells it, do not belong to the part
# that both have in common; the value keeps 95 % of the efficiency on normal noise.
OUTLYING = 4.685

# The fit has converged when a step moves the target by less than this part of the sheet's size.
SETTLED = 1e-10
MOST_STEPS = 60

# Share of the compared places that a motion has to keep over the sheet.
KEPT = 0.9

# A motion helps where it leaves less than this part of the distance, and less than a thickness.
HELPS = 0.5

# Rotations below this [rad], and shifts below this part of the distance that remains, are not worth
# a word.
SMALL_TURN = np.radians(0.005)


@dataclass(frozen=True)
class Registration:
    """Distances of a target from the sheet, and the motion that makes them least.

    Distances [m] are those of the nodes of a shell, weighted by their areas, or of the centroids of
    solid cells, positive on the upper side of the sheet. What lies beyond the edge of the sheet is
    left out. The motion turns the target about ``centre`` [m] by the rotation vector ``rotation``
    [rad] and shifts it by ``shift`` [m]; it has no part along which the target only slides.

    Parameters
    ----------
    signed_mean, root_mean_square : of the distances as the target lies [m].
    root_mean_square_after : once it is moved [m].
    compared : share of the target's places that lie over the sheet, 0 to 1.
    determined : how many of the six rigid motions the distances determine.
    thickness : mean thickness of the sheet [m]; a fifth of an edge length where it is unknown.
    """

    signed_mean: float
    root_mean_square: float
    root_mean_square_after: float
    compared: float
    centre: tuple[float, float, float]
    rotation: tuple[float, float, float]
    shift: tuple[float, float, float]
    determined: int
    thickness: float

    def as_dict(self) -> dict[str, Any]:
        """Plain values, ready for JSON."""
        return {
            name: list(value) if isinstance(value, tuple) else value
            for name, value in asdict(self).items()
        }

    @property
    def matrix(self) -> np.ndarray:
        """Rotation matrix of the motion, shape (3, 3)."""
        return Rotation.from_rotvec(self.rotation).as_matrix()

    @property
    def is_off(self) -> bool:
        """Whether the target lies more than half a thickness off the sheet."""
        return self.root_mean_square > LARGEST_TARGET_DISTANCE * self.thickness

    @property
    def helps(self) -> bool:
        """Whether the motion brings the target to the sheet, not only nearer."""
        return self.root_mean_square_after < min(HELPS * self.root_mean_square, self.thickness)

    def moved(self, points: np.ndarray) -> np.ndarray:
        """Move points [m], shape (N, 3)."""
        centre = np.array(self.centre)
        return (points - centre) @ self.matrix.T + centre + self.shift

    def restored(self, points: np.ndarray) -> np.ndarray:
        """Move points [m], shape (N, 3), back to where they were."""
        centre = np.array(self.centre)
        return (points - centre - self.shift) @ self.matrix + centre

    def distance_in_words(self) -> str:
        """Mean and root-mean-square distance, for the terminal."""
        side = "above" if self.signed_mean >= 0.0 else "below"
        return (
            f"{1e3 * abs(self.signed_mean):.3f} mm {side} the sheet on average, "
            f"{1e3 * self.root_mean_square:.3f} mm root mean square"
        )

    def motion_in_words(self) -> str:
        """The motion in mm and degrees, without what is too small to matter."""
        angle = float(np.linalg.norm(self.rotation))
        parts = []
        if angle > SMALL_TURN:
            axis = np.array(self.rotation) / angle
            parts.append(
                f"turned by {np.degrees(angle):.3f} degrees about {_row(axis, 3)} through "
                f"{_row(1e3 * np.array(self.centre), 1)} mm"
            )
        parts.append(f"shifted by {_row(1e3 * np.array(self.shift), 3)} mm")
        return " and ".join(parts)

    def warnings(self) -> list[str]:
        """What to say of a target that lies more than half a thickness off the sheet."""
        if not self.is_off:
            return []
        text = (
            f"the target lies {self.distance_in_words()}, more than half the sheet's thickness of "
            f"{1e3 * self.thickness:.3g} mm"
        )
        after = f"{1e3 * self.root_mean_square_after:.3f} mm"
        if self.helps:
            motion = self.motion_in_words()
            return [f"{text}. {motion[0].upper()}{motion[1:]}, it would lie {after} off (root mean "
                    "square): --register maps it there"]  # fmt: skip
        return [
            f"{text}, and no small motion brings them together ({after} at best): they have "
            "different shapes"
        ]


def registration_of(sheet: Sheet, target: TargetMesh) -> Registration | None:
    """Compare a target with the sheet and fit the small motion between them.

    The motion is found by iterated least squares of the distances to the tangent planes, robust to
    places that do not belong to the sheet. Components that the distances do not determine (sliding
    along a plane, turning about an axis of symmetry) are left out of every step, so that the target
    does not drift along them.

    Returns
    -------
    None where the target and the sheet have nothing to do with each other: fewer than three of the
    target's places lie over the sheet, within a tenth of its size.

    Source: Chen and Medioni, Image and Vision Computing 10 (1992) 145, for point to plane; Gelfand
    et al., 3-D Digital Imaging and Modeling (2003) 260, for what slides.
    """
    smooth = SmoothSurface(sheet.surface)
    points, shares = _places(target)
    reach = REACH * sheet.surface.size
    before = _Distances.of(smooth, points, shares, reach)
    if before.count < 3:
        return None
    found = Registration(
        signed_mean=before.mean,
        root_mean_square=before.root_mean_square,
        root_mean_square_after=before.root_mean_square,
        compared=before.compared,
        centre=_three(shares @ points / shares.sum()),
        rotation=(0.0, 0.0, 0.0),
        shift=(0.0, 0.0, 0.0),
        determined=0,
        thickness=_thickness(sheet),
    )
    few, median = slice(None, FITTED), before.median
    for least, part in ((STEEP, 1.0), (SLIDING, EXPLAINS)):
        motion = _fit(found, smooth, points[few], shares[few], reach, least)
        after = _Distances.of(smooth, motion.moved(points), shares, reach)
        # A motion that loses places beyond the edge of the sheet has not brought the two together.
        together = after.compared >= KEPT * before.compared
        if together and after.median <= part * median:
            found = replace(motion, root_mean_square_after=after.root_mean_square)
            median = after.median
        elif least == STEEP:  # it lies as well as it can
            found = replace(found, determined=motion.determined)
    return found


def registered(target: TargetMesh, registration: Registration) -> TargetMesh:
    """Return the target where the motion puts it."""
    return replace(target, points=registration.moved(target.points))


@dataclass(frozen=True)
class _Distances:
    """Weighted mean and root mean square of distances [m], and which places they are of."""

    mean: float
    root_mean_square: float
    median: float
    compared: float
    count: int

    @classmethod
    def of(
        cls, smooth: SmoothSurface, points: np.ndarray, shares: np.ndarray, reach: float
    ) -> _Distances:
        over, distance, _ = _signed_distances(smooth, points, reach)
        weights = shares[over]
        total = weights.sum()
        if not total > 0.0:
            return cls(0.0, 0.0, 0.0, 0.0, 0)
        return cls(
            float(weights @ distance / total),
            float(np.sqrt(weights @ distance**2 / total)),
            float(np.median(np.abs(distance))),
            float(total / shares.sum()),
            len(distance),
        )


def _signed_distances(
    smooth: SmoothSurface, points: np.ndarray, reach: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Numbers of the points over the sheet (K,), their distances [m] (K,) and normals (K, 3)."""
    closest = closest_points(smooth.surface, points, reach)
    over = np.flatnonzero((closest.face >= 0) & ~closest.beside)
    normal, height = smooth.at(closest.face[over], closest.foot[over])
    distance = np.einsum("ki,ki->k", points[over] - closest.foot[over], normal) - height
    return over, distance, normal


def _fit(
    start: Registration,
    smooth: SmoothSurface,
    points: np.ndarray,
    shares: np.ndarray,
    reach: float,
    least: float,
) -> Registration:
    """Add steps to a motion, of components that the distances determine by ``least`` or more."""
    centre = np.array(start.centre)
    length = float(np.sqrt(shares @ ((points - centre) ** 2).sum(axis=1) / shares.sum()))
    rotation, shift, determined = Rotation.from_rotvec(start.rotation), np.array(start.shift), 0
    least = max(least, FACET_BLUR * smooth.blur)
    for _ in range(MOST_STEPS):
        arms = (points - centre) @ rotation.as_matrix().T
        over, distance, normal = _signed_distances(smooth, arms + centre + shift, reach)
        if len(over) < 3:
            break
        weights = shares[over] * _trust(distance)
        weights /= weights.sum()
        rows = np.concatenate([np.cross(arms[over], normal) / length, normal], axis=1)
        values, vectors = np.linalg.eigh((rows * weights[:, None]).T @ rows)
        known = values > least
        determined = int(known.sum())
        gradient = vectors[:, known].T @ (rows.T @ (weights * distance))
        step = -vectors[:, known] @ (gradient / values[known])
        rotation = Rotation.from_rotvec(step[:3] / length) * rotation
        shift = shift + step[3:]
        if np.linalg.norm(step) < SETTLED * smooth.surface.size:
            break
    return replace(
        start, rotation=_three(rotation.as_rotvec()), shift=_three(shift), determined=determined
    )


def _trust(distance: np.ndarray) -> np.ndarray:
    """Weights of distances: zero beyond ``OUTLYING`` standard deviations (Tukey's biweight)."""
    size = np.abs(distance)
    limit = OUTLYING * 1.4826 * np.median(size)
    if limit == 0.0:
        return np.ones(len(size))
    return np.maximum(1.0 - (size / limit) ** 2, 0.0) ** 2


def _places(target: TargetMesh) -> tuple[np.ndarray, np.ndarray]:
    """Places of the target that are compared, shape (P, 3) [m], and their weights (P,)."""
    points = target.centroids
    weights: np.ndarray = np.ones(target.cell_count)
    if not target.is_solid:
        corners = target.corners
        there = corners >= 0
        per_corner = target.surface.areas / there.sum(axis=1)
        shares = np.broadcast_to(per_corner[:, None], corners.shape)[there]
        of_nodes = np.bincount(corners[there], weights=shares, minlength=len(target.points))
        used = of_nodes > 0.0
        points, weights = target.points[used], of_nodes[used]
    drawn = np.random.default_rng(0).permutation(len(points))[:COMPARED]
    return points[drawn], weights[drawn]


def _thickness(sheet: Sheet) -> float:
    if "thickness" not in sheet.scalars:
        return 0.2 * sheet.surface.edge_length
    return float(np.average(sheet.scalars["thickness"], weights=sheet.surface.areas))


def _three(values: np.ndarray) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in values)
    return x, y, z


def _row(values: np.ndarray, digits: int) -> str:
    rounded = np.round(values, digits) + 0.0  # no minus before a zero
    return "(" + ", ".join(f"{value:.{digits}f}" for value in rounded) + ")"
