"""Parts, instances and what stands outside of them in an Abaqus deck, put into one mesh."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from lcmchain.errors import first_few
from lcmchain.mesh_files.file_mesh import (
    NO_IDS,
    FileMesh,
    Numbering,
    merged_blocks,
    unique_nodes,
)
from lcmchain.mesh_files.readers.abaqus_scope import Scope
from lcmchain.mesh_files.readers.abaqus_sets import DeckSets, Placed
from lcmchain.mesh_files.readers.numbered_sets import listed
from lcmchain.mesh_files.shapes import SURFACE_CORNERS, base_type


@dataclass
class Deck:
    """A deck while it is read: its parts, their instances, and what stands outside.

    ``placed`` holds of each instance its name, part, rotation and translation; ``own`` what is
    defined within it.
    """

    outside: Scope = field(default_factory=Scope)
    parts: dict[str, Scope] = field(default_factory=dict)
    placed: list[tuple[str, str, np.ndarray, np.ndarray]] = field(default_factory=list)
    own: dict[str, Scope] = field(default_factory=dict)


def merged(deck: Deck) -> FileMesh:
    """Put all instances (or all parts, where none is placed) and what stands outside together."""
    second = _settle_second_choice(_scopes(deck))
    instances = [
        _placed(name, (deck.parts[part], deck.own[name.upper()]), rotation, shift)
        for name, part, rotation, shift in deck.placed
    ]
    if not instances:
        instances = [
            _placed(part.name, (part,), np.eye(3), np.zeros(3)) for part in deck.parts.values()
        ]
    outside = _placed("", (deck.outside,), np.eye(3), np.zeros(3))
    everything = [*instances, outside]
    blocks = _joined(everything)
    mesh = FileMesh(
        points=np.concatenate([one.points for one in everything]),
        blocks=blocks,
        cell_ids=np.empty(sum(len(one.cell_ids) for one in everything), dtype=np.int64),
        node_ids=np.concatenate([one.ids for one in everything]),
    )
    for one in everything:
        mesh.cell_ids[one.cell_rows] = one.cell_ids
    DeckSets(mesh, {one.name.upper(): one for one in everything}).fill()
    _fill_parts(mesh, everything)
    if second:
        mesh.notes.append(
            f"the deck has no shells: {listed(second)} are taken for cells, though they are rigid, "
            "surface or axisymmetric elements"
        )
    used = {part for _, part, _, _ in deck.placed}
    unused = [part.name for key, part in deck.parts.items() if deck.placed and key not in used]
    if unused:
        mesh.notes.append(f"parts of the deck without an instance are left out: {listed(unused)}")
    if len(np.unique(mesh.cell_ids)) < len(mesh.cell_ids):
        mesh.notes_of_sets.append(
            "element numbers repeat in the instances of the deck: part and number together name an "
            "element"
        )
    spherical = sorted(line for scope in _scopes(deck) for line in scope.spherical)
    if spherical:
        mesh.notes.append(
            f"the nodes of line {spherical[0]} are given in spherical coordinates: read as radius, "
            "angle about z from x, and angle from the plane of x and y"
        )
    for one in everything:
        for scope in one.scopes:
            for element, count in scope.aside.items():
                mesh.left_aside[element] = mesh.left_aside.get(element, 0) + count
    return mesh


def _scopes(deck: Deck) -> list[Scope]:
    return [*deck.parts.values(), *deck.own.values(), deck.outside]


def _settle_second_choice(scopes: list[Scope]) -> list[str]:
    """Take elements of second choice for cells in a deck without shells, else count them.

    Returns
    -------
    types : of the elements that are taken.
    """
    has_shells = any(base_type(cells.name) in SURFACE_CORNERS for s in scopes for cells in s.cells)
    taken = {} if has_shells else {element: None for s in scopes for element, _ in s.second}
    for scope in scopes:
        for element, cells in scope.second:
            if element in taken:
                scope.cells.append(cells)
            else:
                scope.leave_out(element, cells)
    return list(taken)


def _placed(name: str, scopes: tuple[Scope, ...], rotation, shift) -> Placed:
    ids = np.concatenate([scope.all_ids() for scope in scopes])
    points = np.concatenate([scope.all_points() for scope in scopes])
    counts = np.cumsum([len(scope.all_ids()) for scope in scopes])

    def place(row: int):
        which = int(np.searchsorted(counts, row, side="right"))
        return scopes[which].node_place(row - (int(counts[which - 1]) if which else 0))

    ids, points = unique_nodes(ids, points, place)
    cells = [group for scope in scopes for group in scope.cells]
    blocks, cell_ids = merged_blocks(cells, Numbering(ids))
    unturned = np.array_equal(rotation, np.eye(3))
    with np.errstate(over="ignore", invalid="ignore"):  # places far off are told by the cells
        points = points + shift if unturned else points @ rotation.T + shift
    return Placed(name, scopes, ids, points, blocks, cell_ids)


def _joined(everything: list[Placed]) -> list[tuple[str, np.ndarray]]:
    """Blocks of all instances, one per type; sets their rows in the mesh."""
    first = 0
    for one in everything:
        one.first_node = first
        first += len(one.ids)
    names = list(dict.fromkeys(name for one in everything for name, _ in one.blocks))
    blocks = []
    pieces: dict[int, list[np.ndarray]] = {id(one): [] for one in everything}
    row = 0
    for name in names:
        of_type = []
        for one in everything:
            for own, nodes in one.blocks:
                if own == name:
                    of_type.append(nodes + one.first_node)
                    pieces[id(one)].append(np.arange(row, row + len(nodes)))
                    row += len(nodes)
        blocks.append((name, np.concatenate(of_type)))
    for one in everything:
        # the blocks of an instance follow in the same order of types, or are sorted to it
        order = [name for name, _ in one.blocks]
        by_name = dict(zip([n for n in names if n in order], pieces[id(one)], strict=True))
        one.cell_rows = np.concatenate([NO_IDS, *[by_name[name] for name in order]])
    return blocks


def _fill_parts(mesh: FileMesh, everything: list[Placed]) -> None:
    """Parts are the instances, or the sections of a deck without any."""
    if len(everything) > 1:
        for one in everything:
            if len(one.cell_rows):
                mesh.parts[one.name or "assembly"] = np.sort(one.cell_rows)
        return
    taken = np.zeros(mesh.cell_count, dtype=bool)
    names = {name.upper(): name for name in mesh.cell_sets}
    for section in everything[0].scopes[0].sections:
        name = names.get(section.upper())
        if name is None or name in mesh.parts:
            continue
        rows = mesh.cell_sets[name]
        if taken[rows].any():
            mesh.notes_of_sets.append(
                "elements have two sections and belong to the part of the first "
                f"({first_few(mesh.cell_ids[rows[taken[rows]]])})"
            )
        mesh.parts[name] = rows[~taken[rows]]
        taken[rows] = True
