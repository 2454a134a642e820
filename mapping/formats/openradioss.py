"""Include file for OpenRadioss: mesh, plies with their draping by element, and the stack of them.

Each family of fibres is a ``/PLY`` with its share of the thickness. Its ``/DRAPE`` gives every
element the thinning factor and the angle. ``/STACK`` holds the plies, the lowest along the normals
first, and ``/PROP/PCOMPP`` is the property of the part.

Source: Altair Radioss reference guide (2024), starter keywords /DRAPE, /PLY, /STACK, /PROP/PCOMPP;
columns after the description of the formats in OpenRadioss (``hm_cfg_files``: ``drape_ply_slice``,
``ply``, ``stack``). What the starter makes of them is in its source:

- With the reference direction of the stack ``Ip = 20`` an angle counts from the side from node 1 to
  node 2 of the element, brought into its plane, and turns it about the normal: cos φ along the
  side, sin φ along normal × side (``corthini.F``, ``corthdir.F``). φ is the sum of the angles of
  stack, ply and drape; those of stack and ply are 0 here.
- The layer is as thick as the ply times the thinning factor (``layini1.F``); 0 is read as 1
  (``hm_read_drape.F``). One slice, as here, is one integration point over the ply.
- The first ply of a stack has the smallest height along the normal (``stackgroup_drape.F``).
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np

from lcmchain.atomic import replacing
from lcmchain.errors import InputError
from lcmchain.mapping.formats.drape import (
    Tables,
    covered_cells,
    draped_plies,
    losses_of_layers,
    losses_of_order,
    plain,
    title,
)
from lcmchain.mapping.formats.format import ExportReport, Loss, MappedCells, Saver, require_numbers

NAME = "openradioss"

#: Numbers of part, property and stack in the file.
NUMBER = 1
#: Largest number that the starter holds.
LARGEST_NUMBER = 2**31 - 1
#: Reference direction of the stack: from node 1 to node 2 of the element.
FROM_SIDE = 20
#: Longest title.
_TITLE = 100
_IDS_A_LINE = 10


def prepare(path: Path, cells: MappedCells) -> Saver:
    """Get ready to write the include file.

    Raises
    ------
    InputError : solid cells, no thickness or fibre directions, numbers that the starter does not
        hold, or no mapped cell.
    """
    plies = draped_plies(cells, NAME)
    target = cells.target
    misfit = f"is none that OpenRadioss holds, 1 to {LARGEST_NUMBER}"
    for numbers, what in ((target.cell_ids, "cell"), (target.node_ids, "node")):
        require_numbers(numbers, what, target.file, LARGEST_NUMBER, misfit, "OpenRadioss")
    if not plies:
        raise InputError("no cell has a thickness and fibre directions to write", file=target.file)
    return partial(_write, path, cells, plies)


def _write(path: Path, cells: MappedCells, plies: list[Tables]) -> ExportReport:
    with replacing(path) as temporary, temporary.open("w", encoding="ascii") as file:
        for text in _lines(cells, plies):
            file.write(text.rstrip() + "\n")
    covered = covered_cells(plies)
    losses = losses_of_layers(plies) + losses_of_order(cells, plies, NAME)
    missing = cells.target.cell_count - covered
    if missing:
        losses.append(Loss(f"{missing} unmapped cells are in the mesh and in no ply"))
    if any(name not in ("triangle", "quad") for name, _ in cells.target.blocks):
        losses.append(Loss("nodes in the middle of sides and cells are left out"))
    materials = _materials(plies)
    named = [f"{number} ({ply.name})" if ply.name else f"{number}" for number, ply in materials]
    note = (
        f"define the material {' and '.join(named)} in the deck that includes the file, and let "
        "its /BEGIN name the units kg, m and s"
    )
    details: dict[str, object] = {
        "ply_thickness_m": {ply.name: ply.of_family for ply in plies},
        "materials": {str(number): ply.name for number, ply in materials},
    }
    return ExportReport(NAME, [path.name], covered, losses, [note], details)


def _materials(plies: list[Tables]) -> list[tuple[int, Tables]]:
    """Number of the material of every ply: its place in the stack, from 1."""
    return list(enumerate(plies, start=1))


def _lines(cells: MappedCells, plies: list[Tables]) -> Iterator[str]:
    yield from _head(cells, plies)
    yield from _mesh(cells)
    family = 0
    for number, ply in _materials(plies):
        yield from _groups(cells, ply, number)
        for own in range(len(ply.angles)):
            family += 1
            yield from _ply(cells, ply, number, own, family)
    yield from _stack(family)


def _head(cells: MappedCells, plies: list[Tables]) -> Iterator[str]:
    source = plain(str(cells.provenance.get("source", "lcmchain")))
    yield f"# Draped plies by lcmchain; {source}"
    yield "# Units: kg, m, s; angles in degrees. Include it in a starter deck of these units."
    yield "# Angles count from the side from node 1 to node 2 of an element, about its normal."
    yield "# The plies stand in the order of their heights along the normals, lowest first."
    for number, ply in _materials(plies):
        of = f" of the ply {plain(ply.name)}" if ply.name else ""
        yield f"# The deck has to define the material {number}{of}, along and across a fibre."


def _mesh(cells: MappedCells) -> Iterator[str]:
    target = cells.target
    corners = target.corners
    yield "/NODE"
    yield "#  node_ID                  Xc                  Yc                  Zc"
    for row in np.unique(corners[corners >= 0]).tolist():
        x, y, z = target.points[row].tolist()
        yield f"{target.node_ids[row]:>10}{_real(x)}{_real(y)}{_real(z)}"
    yield f"/PART/{NUMBER}"
    yield "formed part"
    yield "#  prop_ID    mat_ID subset_ID"
    yield f"{NUMBER:>10}{1:>10}"
    yield f"/PROP/PCOMPP/{NUMBER}"
    yield "plies of the stack"
    for keyword, count in (("SHELL", 4), ("SH3N", 3)):
        rows = np.flatnonzero(_count(corners) == count)
        if len(rows):
            yield f"/{keyword}/{NUMBER}"
            for row in rows.tolist():
                nodes = target.node_ids[corners[row, :count]].tolist()
                yield "".join(f"{value:>10}" for value in (target.cell_ids[row], *nodes))


def _count(corners: np.ndarray) -> np.ndarray:
    return (corners >= 0).sum(axis=1)


def _of_kind(cells: MappedCells, ply: Tables, count: int) -> np.ndarray:
    """Numbers of the elements of a ply with so many corners."""
    own = cells.target.cell_ids[_count(cells.target.corners) == count]
    return ply.ids[np.isin(ply.ids, own)]


def _groups(cells: MappedCells, ply: Tables, number: int) -> Iterator[str]:
    for keyword, kind, count in (("GRSHEL", "SHEL", 4), ("GRSH3N", "SH3N", 3)):
        ids = _of_kind(cells, ply, count).tolist()
        if ids:
            yield f"/{keyword}/{kind}/{number}"
            yield (plain(ply.name) or "part")[:_TITLE]
            for first in range(0, len(ids), _IDS_A_LINE):
                yield "".join(f"{value:>10}" for value in ids[first : first + _IDS_A_LINE])


def _ply(
    cells: MappedCells, ply: Tables, number: int, family: int, identifier: int
) -> Iterator[str]:
    """Yield the ply of one family of a ply of the stack, and its draping."""
    quads, triangles = (number if len(_of_kind(cells, ply, count)) else 0 for count in (4, 3))
    yield f"/PLY/{identifier}"
    yield title(ply, family)[:_TITLE]
    yield (
        "#   mat_ID                   t           delta_phi grsh4n_ID grsh3n_ID   Npt_ply"
        "             alpha_i"
    )
    yield (
        f"{number:>10}{_real(ply.of_family)}{_real(0.0)}{quads:>10}{triangles:>10}{1:>10}"
        f"{_real(90.0)}"
    )
    yield "# drape_ID"
    yield f"{identifier:>10}"
    yield f"/DRAPE/{identifier}"
    yield title(ply, family)[:_TITLE]
    yield "#   Entity Entity_ID            Thinning          thetaDrape"
    is_quad = np.isin(ply.ids, _of_kind(cells, ply, 4)).tolist()
    rows = zip(ply.ids.tolist(), is_quad, ply.thinning.tolist(), ply.angles[family].tolist())
    for element, quad, thinning, angle in rows:
        entity = "SHELL" if quad else "SH3N"
        yield f"{entity:<10}{element:>10}{_real(thinning)}{_real(angle)}"


def _stack(count: int) -> Iterator[str]:
    """Yield the stack of all plies; what is left blank has the defaults of the deck."""
    yield f"/STACK/{NUMBER}"
    yield "draped plies"
    yield "#   Ishell    Ismstr     Ish3n    Idrill        P_thick_fail                  Z0"
    yield "".join(f"{0:>10}" for _ in range(4))
    yield "#                 Hm                  Hf                  Hr                  Dm"
    yield "".join(_real(0.0) for _ in range(4))
    yield "#                                 Ashear                Iint              Ithick"
    yield f"{'':20}{_real(0.0)}{'':10}{0:>10}{'':10}{0:>10}"
    yield (
        "#                 Vx                  Vy                  Vz   skew_ID     Iorth"
        "      Ipos        Ip"
    )
    yield "".join(_real(0.0) for _ in range(3)) + f"{0:>10}{0:>10}{0:>10}{FROM_SIDE:>10}"
    yield "# Pply_IDi               Phi_i                 Z_i"
    for identifier in range(1, count + 1):
        yield f"{identifier:>10}{_real(0.0)}{_real(0.0)}"
        yield ""


def _real(value: float) -> str:
    """Write a number into twenty columns, one of them blank, with thirteen digits."""
    return f"{value + 0.0:>20.12e}"
