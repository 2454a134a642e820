"""Faces of the plies as points and facets, and which plies may touch: all that stays constant.

Every node of a ply of solid-shells lies on one of its two faces and is a point of contact; every
element has a facet on either face. A point carries half the contact stiffness of its area, since
the points of both faces that meet press on each other's facets.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from lcmchain.compilation.processor import aligned
from lcmchain.effects.contact_depth import LEAST_DAMPED_TIMES, stiffening_of
from lcmchain.elements.blocks import NODE_CHUNK, SPAN
from lcmchain.elements.family import Body
from lcmchain.errors import InputError
from lcmchain.interfaces.law import MOST_LAWS, NO_LAW
from lcmchain.interfaces.rows import row_count
from lcmchain.interfaces.table import Interface
from lcmchain.mesh.cells import by_node
from lcmchain.quantities.readable import millimetres

#: No facet, no neighbour, no interface.
NONE = -1

# Rim edges nearer to the middle of a facet than this multiple of its own half diagonal and of the
# largest edge of all facets can cover points that face it.
RIM_RADIUS = 1.5
# Lips of a cut lie at each other before forming, up to this part of an edge.
SAME_PLACE = 1e-6

# Damping of the springs, as a part of critical, where two plies of equal meshes vibrate on them.
# Surfaces that are taken anew now and then feed vibrations by parts of their energy, each time;
# this takes it away again. It costs a hundredth of the step.
DAMPING_RATIO = 0.03

# A point slides by this part of an edge of its facet until the next refresh, at most.
SLIDE = 0.04
# Steps between two renewals of the slopes, and the part of the way to the present ones that they go
# then: together some periods of the slowest vibration of the mesh's own wavelength, which is an
# element's bending and lasts some tens of steps, and short beside the time in which a sheet takes
# its shape. Taken in full, a ply that is dragged under pressure is fed twice as much vibration, and
# five times as much where it sticks.
STEPS_PER_SLOPES, SLOPE_PART = 250, 0.3
# Steps over which the depth of a point goes to zero, up to what is left of it, in parts of half the
# thickness: thickness is then right within 0.1 %, and plies that only lie on each other are left.
# Heavy plies on springs that a light one makes soft need longer, as in tools: an offset that is
# faster than the damping calms the mass on the springs feeds its vibration.
STEPS_PER_DEPTH, DEPTH_LEFT = 500.0, 1e-3

# Points are found up to this multiple of the gap at which laws act.
REACH_MARGIN = 1.2

# An overlap at the start deeper than this part of the thinner ply is an error.
DEEPEST_START = 0.5
# It is told where middles of facets lie over each other, less far aside than this part of an edge:
# a ply that begins where another one ends does not.
ASIDE = 0.45


class InterfaceData(NamedTuple):
    """Constants of the contact between plies; lengths are those of the undeformed plies.

    place : (3, node_count) undeformed positions [m].
    ply : (node_count,) int32, body of every node, which is a point. partner : (node_count,) int32
        node on the other face of the ply. spacing : (node_count,) edge length around it [m].
    ring, ring_corner : (node_count, valence) int32, facets that have the node as a corner, and
        which one; -1 where there are fewer. ring_part : (node_count, valence) part of the node's
        area that lies on each, 0 where there are fewer.
    facet_node : (facet_count, 4) int32, counterclockwise seen from outside; a triangle repeats its
        last node. facet_ply : (facet_count,) int32. facet_edge : (facet_count,) its shortest [m].
    neighbour : (facet_count, 4) int32, facet across the edge from corner k to the next one.
    rim_start : (facet_count + 1,) int32, entries of ``rim`` near each facet.
    rim : (n, 2) int32, nodes of edges without a neighbour, the facet on the left seen from outside.
    lane : (node_count,) int32, place of every node where chunks begin at whole spans of 16.
    row_size : numbers of a span in ``State.ply_rows``.
    interface : (ply_count, ply_count) int32, number of the interface, -1 where two plies do not
        touch. interface_count : how many there are.
    penalty : of each interface [Pa/m]. stiffer : its stiffest spring over that of the pressure.
    depth : (ply_count, ply_count) half the thickness of the thinner of two plies [m].
    near, far : (ply_count, ply_count) gap below which a law acts, and up to which points are found.
    area : (node_count,) of the points [m²].
    reach, nearest : largest of ``far``, and smallest of plies that touch [m].
    thinnest : half the thickness of the thinnest ply [m]. widest : longest edge of all facets [m].
    inner : (node_count, n) int32, nodes inside of a node at a rim, -1 where there are fewer.
    omega2 : of plies of equal meshes in full contact on the stiffest law [1/s²].
    damping_time : damping over stiffness of the springs along their normals [s].
    sliding_rate : damping over mass of what resists sliding by its speed, at most [1/s].
    slide : part of an edge by which points slide until their springs are renewed.
    slope_steps : between two renewals of the facets' slopes. slope_part : of the way to the present
        ones that they go then.
    depth_steps : over which depths go to zero, but for ``depth_left``, a part of the thickness.
    depth_time : (ply_count, ply_count) the time that this takes at least [s].
    stiffening : of the plies relative to the springs, for each depth of these [1/m].
    """

    place: np.ndarray
    ply: np.ndarray
    partner: np.ndarray
    spacing: np.ndarray
    ring: np.ndarray
    ring_corner: np.ndarray
    ring_part: np.ndarray
    facet_node: np.ndarray
    facet_ply: np.ndarray
    facet_edge: np.ndarray
    neighbour: np.ndarray
    rim_start: np.ndarray
    rim: np.ndarray
    lane: np.ndarray
    row_size: int
    interface: np.ndarray
    interface_count: int
    penalty: np.ndarray
    stiffer: np.ndarray
    depth: np.ndarray
    near: np.ndarray
    far: np.ndarray
    area: np.ndarray
    reach: float
    nearest: float
    thinnest: float
    widest: float
    inner: np.ndarray
    omega2: float
    damping_time: float
    sliding_rate: float
    slide: float
    slope_steps: int
    slope_part: float
    depth_steps: float
    depth_time: np.ndarray
    depth_left: float
    stiffening: float


class PlyContact(NamedTuple):
    """The contact between the plies of a model.

    data : its constants. laws : of the interfaces, with :data:`lcmchain.interfaces.law.NO_LAW` in
    the places that are left.
    """

    data: InterfaceData
    laws: tuple[Any, ...]


def interfaces_of_stages(
    stages: Sequence[Sequence[Interface]],
    bodies: Sequence[Body],
    automatic_penalties: Sequence[float],
    there: Sequence[Sequence[bool]] = (),
) -> list[PlyContact]:
    """Return the contact between plies in every stage; nothing where none ever touch.

    All stages have the same laws and interfaces; they differ in which interface two plies have, and
    what follows from it.

    Parameters
    ----------
    stages : tables of a scene for every stage; of two that name the same plies the last one holds.
    bodies : the plies. automatic_penalties : the contact stiffness of each [Pa/m].
    there : of every stage, whether each ply is there; one that is not touches none. All are
        without it.

    Raises
    ------
    InputError : an unknown ply, an interface of a ply with itself, elements without two faces, or
        plies that overlap at the start by more than half a thickness.
    """
    of_stages, entries = _interfaces(stages, [body.name for body in bodies])
    for number, plies in enumerate(there):
        of_stages[number][~np.outer(plies, plies)] = NONE
    if not entries:
        return []
    _require_two_faces(bodies)
    penalties = np.array(
        [
            min(automatic_penalties[a], automatic_penalties[b])
            if it.penalty is None
            else it.penalty
            for it, a, b in entries
        ]
    )
    tables = [it.all_laws() for it, _, _ in entries]
    laws = _gathered(tables)
    thickness = np.array([body.mesh.thickness for body in bodies])
    depth = 0.5 * np.minimum(thickness, thickness[:, np.newaxis])
    reaches = np.array([max((law.reach() for law in own), default=0.0) for own in tables])
    slopes = np.array([max((law.stiffness() for law in own), default=0.0) for own in tables])
    viscosity = max(sum(law.slip_viscosity() for law in own) for own in tables)
    stiffer = np.maximum(slopes / penalties, 1.0)
    damping_time = 2.0 * DAMPING_RATIO / np.sqrt(omega2_of_equal_plies(penalties, bodies))
    constants: dict[str, Any] = {
        **_faces_of_bodies(bodies),
        "row_size": row_count(laws) * SPAN,
        "interface_count": len(entries),
        "penalty": penalties.astype(float),
        "stiffer": stiffer,
        "depth": depth,
        "thinnest": 0.5 * float(thickness.min()),
        "omega2": omega2_of_equal_plies(penalties * stiffer, bodies),
        "damping_time": damping_time,
        "sliding_rate": 2.0 * viscosity * largest_area_by_mass(bodies),
        "slide": SLIDE,
        "slope_steps": STEPS_PER_SLOPES,
        "slope_part": SLOPE_PART,
        "depth_steps": STEPS_PER_DEPTH,
        "depth_left": DEPTH_LEFT,
        "stiffening": min(stiffening_of(body.material) for body in bodies),
    }
    found = []
    for pairs in of_stages:
        near, far = _reaches_of_pairs(pairs, reaches, depth)
        data = InterfaceData(
            **constants,
            interface=pairs,
            near=near,
            far=far,
            reach=float(far.max()),
            nearest=_nearest(pairs, far),
            depth_time=_depth_times(damping_time * penalties, pairs, bodies),
        )
        found.append(PlyContact(data, laws))
    _require_apart(found[0].data, [body.name for body in bodies])
    return found


def _require_two_faces(bodies: Sequence[Body]) -> None:
    """Refuse plies without faces on which another one could lie."""
    for body in bodies:
        if not body.mesh.has_thickness or body.contact_offset != 0.0:
            raise InputError(
                f'of the ply {body.name} is "{body.type}": elements without two faces, on which no '
                'other ply could lie; use element = "solid-shell"',
                key="element",
            )


def _faces_of_bodies(bodies: Sequence[Body]) -> dict[str, Any]:
    """Return the entries of :class:`InterfaceData` that the undeformed faces of the plies give."""
    faces = [_faces_of(body) for body in bodies]
    facet_node = np.concatenate([face for pair in faces for face in pair])
    counts = np.array([body.mesh.element_count for body in bodies])
    surface = np.repeat(np.arange(2 * len(bodies)), np.repeat(counts, 2))
    position = np.concatenate([body.mesh.node_positions for body in bodies])
    edges = _edge_lengths(position[facet_node])
    first_facet = 2 * (np.cumsum(counts) - counts)
    neighbour = np.concatenate([_neighbours(*own) for own in zip(bodies, first_facet, strict=True)])
    node_count = len(position)
    ring, ring_corner = _rings(facet_node, node_count)
    rim_start, rim = _rims(position, facet_node, neighbour, surface, edges.max())
    node_counts = [body.mesh.node_count for body in bodies]
    return {
        "place": aligned(np.ascontiguousarray(position.T)),
        "ply": np.repeat(np.arange(len(bodies)), node_counts).astype(np.int32),
        "partner": np.concatenate([_partners(body) for body in bodies]).astype(np.int32),
        "spacing": aligned(edges.max(axis=1)[ring[:, 0]]),
        "ring": ring,
        "ring_corner": ring_corner,
        "ring_part": _parts_of_area(position[facet_node], ring),
        "facet_node": facet_node.astype(np.int32),
        "facet_ply": (surface // 2).astype(np.int32),
        "facet_edge": aligned(np.where(edges > 0.0, edges, np.inf).min(axis=1)),
        "neighbour": neighbour,
        "rim_start": rim_start,
        "rim": rim,
        "lane": _lanes(node_counts),
        "area": aligned(np.concatenate([body.node_area for body in bodies])),
        "widest": float(edges.max()),
        "inner": _inner_nodes(facet_node, neighbour, node_count),
    }


def _reaches_of_pairs(
    interface: np.ndarray, reaches: np.ndarray, depth: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return up to which gap laws act and points are found (ply_count, ply_count) each [m].

    interface : of every pair, -1 without. reaches : of each interface [m]. depth : of every pair.
    """
    near = np.where(interface == NONE, 0.0, np.append(reaches, 0.0)[interface])
    # points are found before they touch, and before a law acts on them
    return near, np.maximum(2.0 * depth, REACH_MARGIN * near)


def _nearest(interface: np.ndarray, far: np.ndarray) -> float:
    """Return the smallest gap at which points of plies that touch are found [m]."""
    return float(np.min(far, where=interface != NONE, initial=far.max()))


def _gathered(tables: Sequence[Sequence[Any]]) -> tuple[Any, ...]:
    """Return the laws of all interfaces from the tables of each.

    Raises
    ------
    InputError : more kinds of laws than the loop has places for, or one twice on an interface.
    """
    kinds = list(dict.fromkeys(type(table) for own in tables for table in own))
    if len(kinds) > MOST_LAWS:
        names = ", ".join(kind.__name__ for kind in kinds)
        raise InputError(
            f"use {len(kinds)} kinds of laws together ({names}); a model has at most {MOST_LAWS}",
            key="interfaces",
        )
    gathered = []
    for kind in kinds:
        of_kind = [[table for table in own if type(table) is kind] for own in tables]
        for number, own in enumerate(of_kind):
            if len(own) > 1:
                raise InputError(
                    f"has the law {own[0].type} {len(own)} times; give it once",
                    key=f"interfaces[{number}].laws",
                )
        gathered.append(kind.gathered([own[0] if own else None for own in of_kind]))
    return (*gathered, *[NO_LAW] * (MOST_LAWS - len(gathered)))


def _lanes(node_counts: Sequence[int]) -> np.ndarray:
    """Return the place of every node where the chunks of every body begin at whole spans."""
    places, first = [], 0
    for count in node_counts:
        places.append(first + np.arange(count))
        first += -(-count // NODE_CHUNK) * NODE_CHUNK
    return np.concatenate(places).astype(np.int32)


def _require_apart(data: InterfaceData, names: Sequence[str]) -> None:
    """Refuse plies that touch and overlap at the start by more than half the thinner one.

    Told from the nearest facet that looks the other way, up to one and a half thicknesses deep:
    further on lies the other face of plies that touch as they should.
    """
    corner = data.place.T[data.facet_node]
    middle = corner.mean(axis=1)
    normal = np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1])
    normal /= np.linalg.norm(normal, axis=1)[:, np.newaxis]
    for point_ply, facet_ply in zip(*np.nonzero(data.interface != NONE), strict=True):
        if point_ply == facet_ply:
            continue  # a ply does not touch itself as long as it is not formed
        own = np.flatnonzero(data.facet_ply == point_ply)
        points, outwards = middle[own], normal[own]
        facets = np.flatnonzero(data.facet_ply == facet_ply)
        lower, upper = np.array_split(facets, 2)
        thickness = 2.0 * float(data.depth[point_ply, facet_ply])
        for face in (lower, upper):
            near = face[cKDTree(middle[face]).query(points)[1]]
            away = points - middle[near]
            gap = np.einsum("ij,ij->i", away, normal[near])
            beside = np.linalg.norm(away - gap[:, np.newaxis] * normal[near], axis=1)
            faces = np.einsum("ij,ij->i", outwards, normal[near]) < 0.0
            depth = np.where(faces & (beside < ASIDE * data.facet_edge[near]), -gap, 0.0)
            depth[depth > 1.5 * thickness] = 0.0
            worst = int(np.argmax(depth))
            if depth[worst] > DEEPEST_START * thickness * (1.0 + 1e-9):
                first, second = sorted((point_ply, facet_ply))
                raise InputError(
                    f"the plies {names[first]} and {names[second]} overlap by "
                    f"{1e3 * depth[worst]:.3f} mm at {millimetres(points[worst])} at the "
                    f"start, more than half of the thinner one ({1e3 * thickness:.3f} mm); lay "
                    "the upper one higher",
                    key="interfaces",
                )


def largest_area_by_mass(bodies: Sequence[Body]) -> float:
    """Return the largest area over mass of a node [m²/kg]."""
    return max(float(np.max(body.node_area / body.inertial_mass)) for body in bodies)


def _depth_times(damping: np.ndarray, interface: np.ndarray, bodies: Sequence[Body]) -> np.ndarray:
    """Return the time in which depths between two plies may go to zero (ply_count, ply_count) [s].

    damping : of each interface [Pa s/m].
    """
    heaviest = np.array([float(np.max(body.inertial_mass / body.node_area)) for body in bodies])
    of_pair = np.append(damping, np.inf)[interface]  # without contact no time
    return LEAST_DAMPED_TIMES * np.maximum(heaviest, heaviest[:, np.newaxis]) / of_pair


def omega2_of_equal_plies(penalties: np.ndarray, bodies: Sequence[Body]) -> float:
    """Return ω² [1/s²] of plies of equal meshes in full contact, on the stiffest interface."""
    return 2.0 * float(penalties.max()) * largest_area_by_mass(bodies)


def _interfaces(
    stages: Sequence[Sequence[Interface]], names: Sequence[str]
) -> tuple[list[np.ndarray], list[tuple[Interface, int, int]]]:
    """Return the interface of every pair of plies in every stage, and what each of them is.

    That is its table and the two plies. An entry that goes on in the next stage keeps its number.
    """
    entries: list[tuple[Interface, int, int]] = []
    return [_of_pairs(interfaces, names, entries) for interfaces in stages], entries


def _of_pairs(
    interfaces: Sequence[Interface], names: Sequence[str], entries: list[tuple[Interface, int, int]]
) -> np.ndarray:
    """Return the interface of every pair of plies; new ones are added to ``entries``."""
    law = np.full((len(names), len(names)), NONE, dtype=np.int32)
    before = list(entries)
    for index, interface in enumerate(interfaces):
        key = f"interfaces[{index}].between"
        if interface.between is None:
            plies = list(range(len(names)))
            pairs = [(a, b) for a in plies for b in range(a)]
        else:
            for name in interface.between:
                if name not in names:
                    raise InputError(
                        f'there is no ply "{name}"; the plies are {", ".join(names)}', key=key
                    )
            first, second = (list(names).index(name) for name in interface.between)
            if first == second:
                raise InputError(
                    f"the ply {interface.between[0]} cannot touch itself; name two plies", key=key
                )
            plies = sorted((first, second))
            pairs = [(first, second)]
        if interface.itself:
            pairs += [(ply, ply) for ply in plies]
        for a, b in pairs:
            entry = (interface, a, b)
            number = before.index(entry) if entry in before else len(entries)
            if number == len(entries):
                entries.append(entry)
            law[a, b] = law[b, a] = number
    return law


def _faces_of(body: Body) -> tuple[np.ndarray, np.ndarray]:
    """Return the facets of the lower and the upper face in nodes of the model."""
    lower, upper = body.mesh.elements[:, :4], body.mesh.elements[:, 4:]
    turned = lower[:, [1, 0, 3, 2]]
    is_triangle = lower[:, 2] == lower[:, 3]
    turned[is_triangle] = lower[is_triangle][:, [1, 0, 2, 2]]
    return turned + body.first_node, upper + body.first_node


def _partners(body: Body) -> np.ndarray:
    """Return the node on the other face of each node, in nodes of the model."""
    partner = np.empty(body.mesh.node_count, dtype=np.int64)
    lower, upper = body.mesh.elements[:, :4], body.mesh.elements[:, 4:]
    partner[lower], partner[upper] = upper, lower
    return partner + body.first_node


def _edge_lengths(corner: np.ndarray) -> np.ndarray:
    return np.linalg.norm(np.roll(corner, -1, axis=1) - corner, axis=2)


def _neighbours(body: Body, first_facet: int) -> np.ndarray:
    """Return the facet across each edge of a ply's facets, lower ones first; -1 at a rim.

    first_facet : number of the ply's first one. A triangle has none across the edge of no length.
    """
    across = body.mesh.neighbours  # of the elements at ξ = 1, ξ = -1, η = 1, η = -1
    count = body.mesh.element_count
    lower, upper = across[[3, 1, 2, 0]].T, across[[3, 0, 2, 1]].T
    faces = [
        np.where(face < 0, NONE, first + face)
        for face, first in ((lower, first_facet), (upper, first_facet + count))
    ]
    return np.ascontiguousarray(np.concatenate(faces), dtype=np.int32)


def _rings(facet_node: np.ndarray, node_count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the facets around each node and which of their corners it is; -1 where none."""
    corner = np.arange(facet_node.size)
    node = facet_node.ravel()
    repeated = (corner % 4 == 3) & (np.roll(node, 1) == node)
    corner, node = corner[~repeated], node[~repeated]
    found = np.ascontiguousarray(by_node(node, corner, node_count, NONE).T)
    return found // 4, np.where(found < 0, NONE, found % 4).astype(np.int32)


def _parts_of_area(corner: np.ndarray, ring: np.ndarray) -> np.ndarray:
    """Return which part of each node's area lies on the facets around it.

    Facets divide their area evenly among their corners.

    Parameters
    ----------
    corner : (facet_count, 4, 3) positions [m].
    """
    across = np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1])
    is_triangle = (corner[:, 2] == corner[:, 3]).all(axis=1)
    area = np.linalg.norm(across, axis=1) / np.where(is_triangle, 3.0, 4.0)
    own = np.where(ring == NONE, 0.0, area[ring])
    return np.ascontiguousarray(own / own.sum(axis=1, keepdims=True))


def _inner_nodes(facet_node: np.ndarray, neighbour: np.ndarray, node_count: int) -> np.ndarray:
    """Return the nodes inside of each node at a rim (node_count, n), -1 where there are fewer.

    They are the other ends of its edges between two facets, and of a corner with one facet alone
    the node across.
    """
    following = np.roll(facet_node, -1, axis=1)
    real = facet_node != following
    free = (neighbour == NONE) & real
    rim = np.zeros(node_count, dtype=bool)
    rim[facet_node[free]] = rim[following[free]] = True
    between = (neighbour != NONE) & real
    node, other = facet_node[between], following[between]  # each edge from both of its facets
    at_rim = rim[node]
    pairs = [np.stack([node[at_rim], other[at_rim]], axis=1)]
    has_one = np.zeros(node_count, dtype=bool)
    has_one[node] = True
    is_quadrilateral = facet_node[:, 2] != facet_node[:, 3]
    for k in range(4):
        corner = facet_node[is_quadrilateral, k]
        alone = rim[corner] & ~has_one[corner]
        across = facet_node[is_quadrilateral, (k + 2) % 4]
        pairs.append(np.stack([corner[alone], across[alone]], axis=1))
    first, second = np.concatenate(pairs).T
    order = np.argsort(second, kind="stable")
    inner = by_node(first[order], second[order], node_count, NONE)
    return np.ascontiguousarray(inner.T)


def _rims(
    position: np.ndarray,
    facet_node: np.ndarray,
    neighbour: np.ndarray,
    surface: np.ndarray,
    widest: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the rim edges near each facet: where its entries begin, and the nodes of the edges.

    surface : (facet_count,) number of the face of a ply that a facet belongs to; each has rims of
        its own.

    Of two lips that lie at each other before forming, as of a slit or of courses that butt, a facet
    has its own: the other one, as near, would tell that the facet lies outside.
    """
    facet, edge = np.nonzero((neighbour == NONE) & (facet_node != np.roll(facet_node, -1, axis=1)))
    ends = np.stack([facet_node[facet, edge], facet_node[facet, (edge + 1) % 4]], axis=1)
    corner = position[facet_node]
    middle = corner.mean(axis=1)
    size = np.linalg.norm(corner - middle[:, np.newaxis], axis=2).max(axis=1)
    near_facet, near_edge = [], []
    for number in np.unique(surface[facet]):
        own = np.flatnonzero(surface == number)
        rim = np.flatnonzero(surface[facet] == number)
        is_lip = _lips(position[ends[rim]])
        for chunk in np.array_split(own, max(1, own.size * rim.size // 2_000_000)):
            distance = _distance_to_edges(middle[chunk], position[ends[rim]])
            near = distance < RIM_RADIUS * (size[chunk, np.newaxis] + widest)
            if is_lip.any():
                near[:, is_lip] &= _is_inside(corner[chunk], position[ends[rim[is_lip]]])
            i, j = np.nonzero(near)
            near_facet.append(chunk[i])
            near_edge.append(rim[j])
    found, edges = np.concatenate(near_facet), np.concatenate(near_edge)
    order = np.lexsort((edges, found))
    start = np.searchsorted(found[order], np.arange(len(facet_node) + 1))
    return start.astype(np.int32), ends[edges[order]].astype(np.int32)


def _lips(ends: np.ndarray) -> np.ndarray:
    """Return which rim edges (m, 2, 3) [m] of a face lie on others that run the other way (m,)."""
    middle, along = ends.mean(axis=1), ends[:, 1] - ends[:, 0]
    length = np.linalg.norm(along, axis=1)
    pairs = cKDTree(middle).query_pairs(length.max(), output_type="ndarray")
    pairs = np.concatenate([pairs, pairs[:, ::-1]])
    one, other = pairs[np.einsum("ni,ni->n", along[pairs[:, 0]], along[pairs[:, 1]]) < 0.0].T
    away = middle[one] - ends[other, 0]
    part = np.einsum("ni,ni->n", away, along[other]) / length[other] ** 2
    off = np.linalg.norm(away - part[:, np.newaxis] * along[other], axis=1)
    lies_on = (off < SAME_PLACE * length[one]) & (part > 0.0) & (part < 1.0)
    lips = np.zeros(len(ends), dtype=bool)
    lips[one[lies_on]] = True
    return lips


def _is_inside(corner: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Return whether facets (n, 4, 3) lie on the inner side of rim edges (m, 2, 3): (n, m)."""
    normal = np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1])
    away = corner.mean(axis=1)[:, np.newaxis] - ends[:, 0]
    across = np.cross(ends[:, 1] - ends[:, 0], away)
    return np.einsum("ni,nmi->nm", normal, across) > 0.0


def _distance_to_edges(points: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Return the distance [m] of points (n, 3) to edges (m, 2, 3), shape (n, m)."""
    along = ends[:, 1] - ends[:, 0]
    away = points[:, np.newaxis] - ends[:, 0]
    part = np.einsum("nmi,mi->nm", away, along) / np.einsum("mi,mi->m", along, along)
    foot = ends[:, 0] + np.clip(part, 0.0, 1.0)[..., np.newaxis] * along
    return np.linalg.norm(points[:, np.newaxis] - foot, axis=2)
