"""Decks of CalculiX: the mesh, the material of every element, and the steps to solve.

Keywords as in the manual of CalculiX CrunchiX 2.20.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from lcmchain.errors import InputError
from lcmchain.mapping.structure.mesh import DeckMesh, cells_at, deck_mesh, nodes_at, sides_at
from lcmchain.mapping.structure.sections import THINNEST_LAYER, Sections
from lcmchain.mapping.target import TargetMesh
from lcmchain.quantities.readable import millimetres
from lcmchain.scene.structure import COMPONENTS, Load, Structure

#: Names of everything, so that a user's own names stay free.
ALL_NODES, ALL_ELEMENTS = "LCM_NODES", "LCM_ELEMENTS"

#: CalculiX reads names of at most 80 characters, and lines of at most 132.
LONGEST_NAME = 70
PER_LINE = 12


@dataclass(frozen=True)
class Units:
    """Units of a deck, by the factor from SI to them."""

    length: float
    stress: float
    density: float

    @property
    def words(self) -> str:
        """Which units these are."""
        return "m, kg, s, N, Pa" if self.length == 1.0 else "mm, t, s, N, MPa"


UNITS = {"m-kg-s": Units(1.0, 1.0, 1.0), "mm-t-s": Units(1e3, 1e-6, 1e-12)}


def mesh_lines(mesh: DeckMesh, units: Units) -> Iterator[str]:
    """Nodes, elements and sets under the numbers and names of the user's file."""
    yield f"** nodes, elements and sets of the mesh, {units.words}"
    yield f"*NODE, NSET={ALL_NODES}"
    rows = np.flatnonzero(mesh.used)
    for number, point in zip(mesh.node_ids[rows], units.length * mesh.points[rows]):
        yield f"{number}, " + ", ".join(f"{x:.12e}" for x in point)
    first = 0
    for _, element, cells in mesh.blocks:
        yield f"*ELEMENT, TYPE={element}, ELSET={ALL_ELEMENTS}"
        numbers = mesh.cell_ids[first : first + len(cells)]
        for number, nodes in zip(numbers, mesh.node_ids[cells]):
            yield from _row([number, *nodes])
        first += len(cells)
    names = _deck_names([*mesh.node_sets, *mesh.cell_sets])
    for name, nodes in mesh.node_sets.items():
        kept = np.asarray(nodes)[mesh.used[nodes]]
        yield from _set("*NSET, NSET", names[name], mesh.node_ids[kept])
    for name, cells in mesh.cell_sets.items():
        yield from _set("*ELSET, ELSET", names[name], mesh.cell_ids[cells])


def section_lines(
    mesh: DeckMesh, sections: Sections, materials: Materials, structure: Structure
) -> Iterator[str]:
    """Materials, axes and sections of all elements.

    A material is fully anisotropic, in the axes of its element: 1 along the first fibre family, 3
    along the normal. Layers of quadratic shells, if they are asked for, are plies, or plies of one
    family.

    Raises
    ------
    InputError : layers with elements that CalculiX has no layers for.
    """
    units = UNITS[structure.units]
    if structure.lay_up != "interleaved":
        _require_layers(mesh, structure)
    through = sections.through
    layered = through is not None
    yield f"** materials and sections, {units.words}"
    yield from _material_lines(materials, units, layered)
    solid = "*SOLID SECTION" if mesh.is_solid else "*SHELL SECTION"
    entries = np.ones(mesh.cell_count, dtype=np.int64)
    if through is not None:
        yield "** sets name an element so often that CalculiX has room for its layers"
        entries = _entries_of_layers(mesh, (through.share > THINNEST_LAYER).sum(axis=0))
    for cell, (number, axes) in enumerate(zip(mesh.cell_ids, sections.axes)):
        yield f"*ORIENTATION, NAME=LCM_O{number}, SYSTEM=RECTANGULAR"
        yield ", ".join(f"{x:.9f}" for x in axes[:2].ravel())
        yield from _set("*ELSET, ELSET", f"LCM_E{number}", np.full(entries[cell], number))
        material = materials.of_cell[cell] + 1
        head = f"{solid}, ELSET=LCM_E{number}"
        if through is not None:
            assert sections.thickness is not None
            yield f"{head}, COMPOSITE"
            thickness = units.length * sections.thickness[cell]
            for kind, share in zip(through.kind[:, cell], through.share[:, cell]):
                if share > THINNEST_LAYER:
                    yield f"{share * thickness:.9e}, , LCM_M{material}_{kind + 1}, LCM_O{number}"
            continue
        head += f", MATERIAL=LCM_M{material}, ORIENTATION=LCM_O{number}"
        if sections.thickness is None:
            yield head
        else:
            yield f"{head}, NODAL THICKNESS"
            yield f"{units.length * sections.thickness[cell]:.9e}"
    if sections.node_thickness is not None and not layered:
        yield "*NODAL THICKNESS"
        rows = np.flatnonzero(mesh.used)
        values = units.length * mesh.with_middles(sections.node_thickness)[rows]
        for number, thickness in zip(mesh.node_ids[rows], values):
            yield f"{number}, {thickness:.9e}"


def step_lines(mesh: DeckMesh, structure: Structure) -> Iterator[str]:
    """Supports, and the steps: eigenfrequencies of the unloaded part, then the static loads.

    Raises
    ------
    InputError : a place that the mesh does not have.
    """
    units = UNITS[structure.units]
    yield from _support_lines(mesh, structure)
    nodes = "*NODE FILE" if mesh.is_solid else "*NODE FILE, OUTPUT=2D"
    if structure.frequencies:
        yield from ("*STEP", "*FREQUENCY", f"{structure.frequencies}", nodes, "U", "*END STEP")
    if structure.loads:
        yield from ("*STEP", "*STATIC")
        for index, load in enumerate(structure.loads):
            yield f"** load {load.name}"
            yield from _load_lines(load, mesh, units, f'loads[{index}] "{load.name}"')
        yield from (nodes, "U", f"*EL PRINT, ELSET={ALL_ELEMENTS}, GLOBAL=NO", "S, E", "*END STEP")


def idle_loads(mesh: DeckMesh, structure: Structure) -> Iterator[str]:
    """Say which forces act on nodes alone that supports hold against them: they load nothing.

    Raises
    ------
    InputError : a place that the mesh does not have.
    """
    held = np.zeros((len(mesh.points), len(COMPONENTS)), dtype=bool)
    for index, support in enumerate(structure.supports):
        nodes = nodes_at(support, mesh, f'supports[{index}] "{support.name}"')
        for component in support.fixed:
            held[nodes, COMPONENTS.index(component)] = True
    for index, load in enumerate(structure.loads):
        if load.force is None:
            continue
        key = f'loads[{index}] "{load.name}"'
        nodes = nodes_at(load, mesh, key)
        nodes = nodes[mesh.is_corner[nodes]]
        acting = np.flatnonzero(load.force)
        if len(acting) and held[nodes][:, acting].all():
            first = nodes[0]
            yield (
                f"{key} loads nothing: supports hold all of its {len(nodes)} nodes against the "
                f"force (the first is {mesh.node_ids[first]} at "
                f"{millimetres(mesh.points[first])}); move the load, or free what it acts on"
            )


def require_places(target: TargetMesh, structure: Structure) -> None:
    """Refuse supports and loads of an analysis at places that a mesh does not have.

    Raises
    ------
    InputError : cells without an element, or a place that the mesh does not have.
    """
    mesh = deck_mesh(target, quadratic=structure.elements == "quadratic")
    if structure.lay_up != "interleaved":
        _require_layers(mesh, structure)
    for _ in step_lines(mesh, structure):
        pass


# --- materials: one per cell, or one for cells that are alike within a stated tolerance -----------


class Materials(NamedTuple):
    """Materials and the cells that have them.

    of_cell : material of each cell, (C,).
    stiffness : [Pa], (M, 6, 6). layers : of each kind of layer, (M, 6, 6), where there are any.
    density : [kg/m3], (M,).
    error : largest difference between a stiffness of a cell and that of its material, relative to
        the largest stiffness of the cell.
    """

    of_cell: np.ndarray
    stiffness: np.ndarray
    layers: tuple[np.ndarray, ...]
    density: np.ndarray
    error: float


def materials_of(sections: Sections, tolerance: float) -> Materials:
    """Group the cells whose stiffness differs by less than ``tolerance``; 0 groups none.

    Fibre volume fraction, angle and share of every layer decide the stiffness in the axes of the
    cell. All are divided into equal steps, which are made smaller until the tolerance holds.
    """
    if tolerance == 0.0:
        layers = () if sections.through is None else sections.through.kinds
        each = np.arange(len(sections.density))
        return Materials(each, sections.stiffness, layers, sections.density, 0.0)
    mean = sections.fibre_volume_fraction.mean()
    states = [
        column
        for layer in sections.layers
        for column in (layer.fibre_volume_fraction / mean, layer.angle, layer.share)
    ]
    step = tolerance
    while True:
        keys = (np.stack(states, axis=1) / step).round()
        _, of_cell = np.unique(keys, axis=0, return_inverse=True)
        found = _grouped(sections, of_cell.reshape(-1))
        if found.error <= tolerance:
            return found
        step *= 0.7


def _grouped(sections: Sections, of_cell: np.ndarray) -> Materials:
    members = np.bincount(of_cell)

    def mean(values: np.ndarray) -> np.ndarray:
        total = np.zeros((len(members), *values.shape[1:]))
        np.add.at(total, of_cell, values)
        return total / members.reshape(-1, *[1] * (values.ndim - 1))

    stiffness = mean(sections.stiffness)
    off = np.abs(stiffness[of_cell] - sections.stiffness).max(axis=(1, 2))
    error = float((off / sections.stiffness.max(axis=(1, 2))).max())
    kinds = () if sections.through is None else sections.through.kinds
    layers = tuple(mean(kind) for kind in kinds)
    return Materials(of_cell, stiffness, layers, mean(sections.density), error)


# --- lines of the deck ----------------------------------------------------------------------------

#: Nodes that CalculiX reserves for each layer and entry of the set of a layered section.
NODES_OF_A_LAYER = 20


def _entries_of_layers(mesh: DeckMesh, layers: np.ndarray) -> np.ndarray:
    """Return how often every layered element stands in its set, (C,), for CalculiX to have room.

    CalculiX 2.20 reserves 20 nodes for every layer and entry of the set of a section
    (``allocation.f``). Where thickness or normal differs from that of the neighbours it makes three
    for each node of an element and each layer of the element with the most layers
    (``gen3dnor.f``): 24 for a quadrilateral. It stops with "increase nk_" where these are more in
    sum. A repeated entry reserves room again, and changes nothing else.

    layers : of every element, (C,).
    """
    nodes = np.concatenate([np.full(len(cells), cells.shape[1]) for _, _, cells in mesh.blocks])
    needed = 3 * int(layers.max(initial=0)) * nodes
    entries = np.ones(len(layers), dtype=np.int64)
    missing = 0
    for cell, (need, reserved) in enumerate(zip(needed, NODES_OF_A_LAYER * layers)):
        missing += need - reserved
        if missing > 0:
            more = -(-missing // reserved)
            entries[cell] += more
            missing -= more * reserved
    return entries


def _aniso_lines(stiffness: np.ndarray) -> Iterator[str]:
    """Upper triangle of a stiffness (6, 6) in CalculiX's order 11, 22, 33, 12, 13, 23."""
    constants = [stiffness[row, column] for column in range(6) for row in range(column + 1)]
    for start in range(0, 21, 8):
        yield ", ".join(f"{value:.9e}" for value in constants[start : start + 8])


def _deck_names(names: Iterable[str]) -> dict[str, str]:
    """Names of sets as CalculiX takes them: letters in capitals, digits, _ and -; all different."""
    taken: dict[str, str] = {}
    for name in names:
        plain = re.sub(r"[^A-Z0-9_-]", "_", name.upper())[:LONGEST_NAME]
        plain = plain if plain[:1].isalpha() else f"S_{plain}"
        number = 1
        unique = plain
        while unique in taken.values():
            number += 1
            unique = f"{plain}_{number}"
        taken.setdefault(name, unique)
    return taken


def _material_lines(materials: Materials, units: Units, layered: bool) -> Iterator[str]:
    kinds = (
        [(f"_{kind + 1}", layer) for kind, layer in enumerate(materials.layers)]
        if layered
        else [("", materials.stiffness)]
    )
    for ending, stiffness in kinds:
        pairs = zip(units.stress * stiffness, units.density * materials.density)
        for number, (constants, density) in enumerate(pairs, start=1):
            yield f"*MATERIAL, NAME=LCM_M{number}{ending}"
            yield "*ELASTIC, TYPE=ANISO"
            yield from _aniso_lines(constants)
            yield "*DENSITY"
            yield f"{density:.9e}"


def _support_lines(mesh: DeckMesh, structure: Structure) -> Iterator[str]:
    for index, support in enumerate(structure.supports):
        nodes = nodes_at(support, mesh, f'supports[{index}] "{support.name}"')
        degrees = [1 + COMPONENTS.index(component) for component in support.fixed]
        if mesh.is_solid and max(degrees) > 3:
            raise InputError(
                "nodes of solids have no rotations; hold displacements only",
                key=f'supports[{index}] "{support.name}".fixed',
            )
        yield f"** support {support.name}"
        yield "*BOUNDARY"
        for number in mesh.node_ids[nodes]:
            for degree in degrees:
                yield f"{number}, {degree}, {degree}"


def _load_lines(load: Load, mesh: DeckMesh, units: Units, key: str) -> Iterator[str]:
    if load.force is not None:
        nodes = nodes_at(load, mesh, key)
        nodes = nodes[mesh.is_corner[nodes]]
        yield "*CLOAD"
        for degree, part in enumerate(np.array(load.force) / len(nodes), start=1):
            if part != 0.0:
                yield from (f"{number}, {degree}, {part:.9e}" for number in mesh.node_ids[nodes])
    elif load.acceleration is not None:
        size = float(np.linalg.norm(load.acceleration))
        if size == 0.0:
            raise InputError("is zero; leave the load out", key=f"{key}.acceleration")
        along = ", ".join(f"{x:.9f}" for x in np.array(load.acceleration) / size)
        yield "*DLOAD"
        yield f"{ALL_ELEMENTS}, GRAV, {size * units.length:.9e}, {along}"
    elif load.pressure is not None:
        value = load.pressure * units.stress
        yield "*DLOAD"
        if mesh.is_solid:
            cells, sides = sides_at(load, mesh, key)
            pairs = zip(mesh.cell_ids[cells], sides)
            yield from (f"{number}, P{side}, {value:.9e}" for number, side in pairs)
        else:
            cells = cells_at(load, mesh, key)
            yield from (f"{number}, P, {value:.9e}" for number in mesh.cell_ids[cells])


def _require_layers(mesh: DeckMesh, structure: Structure) -> None:
    if mesh.is_solid or not {"S6", "S8R"} >= set(mesh.elements):
        raise InputError(
            f"CalculiX has layers in S8R and S6 elements only, not in {', '.join(mesh.elements)}; "
            'take lay_up = "interleaved", or elements = "quadratic" for a mesh of shells',
            key="lay_up",
        )


def _row(numbers: Iterable[int]) -> Iterator[str]:
    """A row of numbers, continued on the next line where it is long."""
    texts = [str(number) for number in numbers]
    for start in range(0, len(texts), PER_LINE):
        part = texts[start : start + PER_LINE]
        yield ", ".join(part) + ("," if start + PER_LINE < len(texts) else "")


def _set(keyword: str, name: str, numbers: np.ndarray) -> Iterator[str]:
    if len(numbers) == 0:
        return
    yield f"{keyword}={name}"
    for start in range(0, len(numbers), PER_LINE):
        yield ", ".join(str(number) for number in numbers[start : start + PER_LINE]) + ","
