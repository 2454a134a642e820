"""What a check says of a mesh so large that building it takes minutes: told without building it.

Everything that a check tells is had from the same scene with longer elements, and carried over:
counts with the area, the step with the length of the edges. Nothing large is built for it.
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass

from lcmchain.errors import InputError
from lcmchain.interfaces.in_frames import FRAME_ROWS
from lcmchain.mesh.blank import BlankMesh
from lcmchain.mesh.outline import check_element_count
from lcmchain.quantities.fields import BETWEEN_PLIES, FIELD_OF_VARIABLE, FIELDS
from lcmchain.scene import Scene

# --- memory of saved frames -----------------------------------------------------------------------


#: Numbers per node of a frame: positions, displacements and their like.
NUMBERS_PER_NODE = 9


def frame_bytes(element_count: int, node_count: int, *, is_stack: bool = False) -> int:
    """Return about how much memory one saved frame takes with all of its fields."""
    between = sum(len(FIELDS[name].variables) for name in BETWEEN_PLIES)
    of_elements = len(FIELD_OF_VARIABLE) - between
    of_nodes = NUMBERS_PER_NODE
    if is_stack:  # as they come, as fields of each ply, and as those of the whole stack
        of_nodes += 3 * FRAME_ROWS
    return 8 * (of_elements * element_count + of_nodes * node_count)


def require_frames_fit(
    frame_count: int,
    element_count: int,
    node_count: int,
    memory: int | None = None,
    *,
    is_stack: bool = False,
) -> None:
    """Stop when the frames of a run are larger than the memory [bytes], by default this machine's.

    Raises
    ------
    InputError : names process.frames, what they take, and how many fit into half of the memory.
    """
    memory = physical_memory() if memory is None else memory
    one = frame_bytes(element_count, node_count, is_stack=is_stack)
    needed = frame_count * one
    if needed <= memory:
        return
    fitting = max(memory // (2 * one), 2)
    raise InputError(
        f"{frame_count:,} frames of {element_count:,} elements take about "
        f"{needed / 1e9:.3g} GB, more than the {memory / 1e9:.3g} GB of this machine; save "
        f"{fitting:,} frames or fewer",
        key="process.frames",
    )


def physical_memory() -> int:
    """Return the memory of this machine [bytes]."""
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):  # not told by this system
        return 2**63


# --- a coarser mesh in place of a very large one --------------------------------------------------


#: Elements from which on a mesh is not built for a check, and about how many it has in its place.
LARGE = 200_000
ENOUGH = 40_000
#: Memory per element while model and state are built, saved frames aside (measured: 2,700) [bytes].
BUILDING_BYTES = 3000
#: Memory of the program: libraries, compiled loops, pictures (measured: 0.47 to 0.61 GB) [bytes].
PROGRAM_BYTES = 0.5e9


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

    def remarks(self, blanks: Sequence[BlankMesh]) -> list[str]:
        """Return the remarks on the plies that a check has built, or what they stand in for."""
        stack = self.scene.stack
        if not self.stands_in:
            each = zip(stack, blanks, strict=True)
            return list(dict.fromkeys(text for ply, mesh in each for text in ply.remarks(mesh)))
        count = sum(blank.element_count for blank in blanks)
        return [
            f"the mesh of {1e3 * self.given.stack.shortest_edge:.3g} mm, about "
            f"{self.in_run(count):,} elements, was not built for this check: cost, "
            f"gaps and effects are those of {count:,} elements of "
            f"{1e3 * stack.shortest_edge:.3g} mm, carried over to it"
        ]


def checked_mesh(scene: Scene) -> CheckedMesh:
    """Return what a check builds of a scene: the scene itself, or one with longer elements.

    Raises
    ------
    InputError : the blank has too many elements, or more than the memory of this machine holds.
    """
    stack = scene.stack
    count = 0.0
    for ply in stack:
        area, edge_length = ply.contours.area, float(ply.blank.edge_length)
        if area / edge_length**2 > LARGE:
            with ply.own_keys():
                check_element_count(ply.outline, area, edge_length)
        count += area / edge_length**2
    if not count > LARGE:
        return CheckedMesh(scene, scene)
    require_mesh_fits(
        round(count), physical_memory(), edge_length=stack.shortest_edge, key=stack.edge_entry
    )
    refinement = math.sqrt(count / ENOUGH)
    longer = scene.with_longer_edges(refinement)
    if not _can_be_meshed(longer):
        return CheckedMesh(scene, scene)  # details that only short elements can follow
    return CheckedMesh(scene, longer, refinement)


def require_mesh_fits(
    element_count: int, memory: int, *, edge_length: float, key: str = "blank.edge_length"
) -> None:
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
        key=key,
    )


def shortest_edges(scene: Scene) -> float:
    """Return the edge length [m] whose mesh takes half of this machine's memory to build."""
    area = sum(ply.contours.area for ply in scene.stack)
    return _edges_that_fit(area, physical_memory())


def _edges_that_fit(area: float, memory: int) -> float:
    """Return the edge length [m] of a blank [m2] that half of a memory [bytes] holds."""
    return math.sqrt(2.0 * BUILDING_BYTES * area / memory)


def _can_be_meshed(scene: Scene) -> bool:
    try:
        for ply in scene.stack:
            ply.build_blank()
    except InputError:
        return False
    return True
