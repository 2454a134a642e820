"""What a check says of a mesh so large that building it takes minutes: told without building it.

Everything that a check tells is had from the same scene with longer elements, and carried over:
counts with the area, the step with the length of the edges. Nothing large is built for it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from lcmchain.check.saved_frames import physical_memory
from lcmchain.errors import InputError
from lcmchain.mesh.blank import Blank, BlankMesh, build_blank
from lcmchain.mesh.outline import check_element_count, outline_of, polygon_area
from lcmchain.scene import Scene

#: Elements from which on a mesh is not built for a check, and about how many it has in its place.
LARGE = 200_000
ENOUGH = 40_000
#: Memory per element while model and state are built, saved frames aside (measured: 2,700) [bytes].
BUILDING_BYTES = 3000


@dataclass(frozen=True)
class CheckedMesh:
    """The scene whose mesh a check builds, and how much finer the one of a run is.

    Parameters
    ----------
    given : the scene of the run.
    scene : the same, or with a longer ``blank.edge_length``.
    refinement : edge length of that scene over the given one, 1 where it is the given one.
    """

    given: Scene
    scene: Scene
    refinement: float = 1.0

    @property
    def stands_in(self) -> bool:
        """Whether the mesh is not that of the run."""
        return self.refinement != 1.0

    def in_run(self, count: int) -> int:
        """Return how many elements or nodes a run has, for those that the check has built."""
        return round(count * self.refinement**2)

    def remarks(self, blank: BlankMesh) -> list[str]:
        """Return the remarks on the blank that a check has built, or what it stands in for."""
        if not self.stands_in:
            return blank.remarks()
        return [
            f"the mesh of {1e3 * self.given.blank.edge_length:.3g} mm, about "
            f"{self.in_run(blank.element_count):,} elements, was not built for this check: cost, "
            f"gaps and effects are those of {blank.element_count:,} elements of "
            f"{1e3 * self.scene.blank.edge_length:.3g} mm, carried over to it"
        ]


def checked_mesh(scene: Scene) -> CheckedMesh:
    """Return what a check builds of a scene: the scene itself, or one with longer elements.

    Raises
    ------
    InputError : the blank has too many elements, or more than the memory of this machine holds.
    """
    blank = scene.blank
    outline, _ = outline_of(blank)
    area = polygon_area(outline)
    count = area / float(blank.edge_length) ** 2
    if not count > LARGE:
        return CheckedMesh(scene, scene)
    check_element_count(outline, area, float(blank.edge_length))
    require_mesh_fits(round(count), physical_memory(), edge_length=float(blank.edge_length))
    refinement = math.sqrt(count / ENOUGH)
    longer = blank.model_copy(update={"edge_length": refinement * blank.edge_length})
    if not _can_be_meshed(longer, scene.material.thickness):
        return CheckedMesh(scene, scene)  # details that only short elements can follow
    return CheckedMesh(scene, scene.model_copy(update={"blank": longer}), refinement)


def require_mesh_fits(element_count: int, memory: int, *, edge_length: float) -> None:
    """Stop where building the mesh takes more than a memory [bytes].

    Raises
    ------
    InputError : names what it takes, and the edge length [m] that half of the memory holds.
    """
    needed = element_count * BUILDING_BYTES
    if needed <= memory:
        return
    fitting = _edges_that_fit(element_count * edge_length**2, memory)
    raise InputError(
        f"{edge_length:g} m makes about {element_count:,} elements, which take about "
        f"{needed / 1e9:.3g} GB, more than the {memory / 1e9:.3g} GB of this machine; choose "
        f"{fitting:.2g} m or more",
        key="blank.edge_length",
    )


def shortest_edges(scene: Scene) -> float:
    """Return the edge length [m] whose mesh takes half of this machine's memory to build."""
    return _edges_that_fit(polygon_area(outline_of(scene.blank)[0]), physical_memory())


def _edges_that_fit(area: float, memory: int) -> float:
    """Return the edge length [m] of a blank [m2] that half of a memory [bytes] holds."""
    return math.sqrt(2.0 * BUILDING_BYTES * area / memory)


def _can_be_meshed(blank: Blank, thickness: float) -> bool:
    try:
        build_blank(blank, thickness)
    except InputError:
        return False
    return True
