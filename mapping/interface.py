"""The interface at which a simulation gives and takes fields: its cells, or patches of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.spatial import cKDTree

from lcmchain.errors import InputError
from lcmchain.fields.netcdf_file import ROOT, open_netcdf, write_netcdf
from lcmchain.fields.ugrid import CONVENTIONS, UgridMesh
from lcmchain.mapping.surfaces.surface import Surface

if TYPE_CHECKING:
    import xarray as xr

MESH = UgridMesh("interface")
#: Dimension of the values that are exchanged, and the variable that says which face has which.
VALUES = "interface_patch_count"
PATCH = "interface_patch"


@dataclass(frozen=True)
class Interface:
    """Cells of a sheet, each in a patch that has one value of every field.

    Parameters
    ----------
    points : node positions [m], shape (N, 3).
    cells : node rows of triangles and quadrilaterals, shape (C, 4); a triangle has -1 last.
    patches : of the cells; as many as cells where the fields are those of the cells.
    part : labels that patches do not mix, such as plies, shape (C,).
    """

    points: np.ndarray
    cells: np.ndarray
    patches: Patches
    part: np.ndarray | None = None

    @classmethod
    def of_mesh(
        cls,
        points: np.ndarray,
        cells: np.ndarray,
        count: int = 0,
        *,
        part: np.ndarray | None = None,
    ) -> Interface:
        """Return the interface with ``count`` patches, or with every cell by itself (0).

        Raises
        ------
        InputError : a negative count, or fewer patches than the sheet has loose pieces.
        """
        points = np.ascontiguousarray(points, dtype=float)
        cells = np.ascontiguousarray(cells, dtype=np.int64)
        if cells.shape[1] == 3:
            cells = np.hstack([cells, np.full((len(cells), 1), -1, dtype=np.int64)])
        if count == 0:
            return cls(points, cells, Patches.of_single_cells(len(cells)), part)
        areas = Surface(points, cells).areas
        return cls(points, cells, group_cells(points, cells, count, areas=areas, part=part), part)

    @property
    def size(self) -> int:
        """Number of values of a field."""
        return self.patches.count

    @cached_property
    def is_coarse(self) -> bool:
        """Whether fields are not simply those of the cells in their order."""
        return not np.array_equal(self.patches.of_cell, np.arange(len(self.cells)))

    @cached_property
    def surface(self) -> Surface:
        return Surface(self.points, self.cells)

    @cached_property
    def fields(self) -> PatchFields:
        """Transfer of fields between the cells and the interface."""
        neighbours = shared_edges(self.cells, self.part)
        centres = _centres_of(self.points, self.cells)
        return PatchFields(self.patches, centres, self.surface.areas, neighbours)

    def spread(self, values: np.ndarray) -> np.ndarray:
        """Return the value of each cell's patch, (P,) to (C,)."""
        return values[self.patches.of_cell]

    def dataset(self, attributes: Mapping[str, Any] | None = None) -> xr.Dataset:
        """Return the interface as a UGRID mesh of its cells, with the patch of each.

        attributes : of the file.
        """
        of_cells = "cell" if not self.is_coarse else "patch of cells"
        number = {
            "long_name": f"place of the {of_cells}, from 0, in the fields that are exchanged",
            "units": "1",
        }
        variables = {
            **MESH.topology(self.cells, long_name="interface, undeformed"),
            **MESH.node_positions(self.points),
            PATCH: MESH.on_cells(self.patches.of_cell.astype(np.int32), number),
            "interface_patch_area": (
                VALUES, self.fields.patch_areas, {"units": "m2", "long_name": "area of patch"},
            ),
        }  # fmt: skip
        if self.part is not None:
            label = {"units": "1", "long_name": "part that patches do not mix"}
            variables["interface_part"] = MESH.on_cells(self.part.astype(np.int32), label)
        for axis, values in zip("xyz", self.fields.patch_centres.T, strict=True):
            text = {"units": "m", "long_name": f"{axis} coordinate of the middle of patch"}
            variables[f"interface_patch_{axis}"] = (VALUES, values, text)
        return MESH.dataset(variables, {"Conventions": CONVENTIONS, **(attributes or {})})

    def write(self, path: Path | str, attributes: Mapping[str, Any] | None = None) -> None:
        """Write :meth:`dataset` as netCDF, whole or not at all.

        Raises
        ------
        InputError : the place cannot be written.
        """
        write_netcdf(path, {ROOT: self.dataset(attributes)})


def read_interface(path: Path | str) -> Interface:
    """Read an interface that :meth:`Interface.write` has written; it comes back bit-identical.

    Raises
    ------
    InputError : no such file, or none of an interface.
    """
    try:
        with open_netcdf(path, decode_cf=False) as dataset:
            points = np.stack([dataset[name].values for name in MESH.coordinates], axis=1)
            cells = dataset[MESH.cell_nodes].values.astype(np.int64)
            of_cell = dataset[PATCH].values
            count = dataset.sizes[VALUES]
            part = dataset["interface_part"].values if "interface_part" in dataset else None
    except (OSError, KeyError, ValueError) as error:
        raise InputError(f"this is no interface of a unit ({error})", file=path) from None
    return Interface(points, cells, Patches(of_cell, count), part)


# --- fields between the cells and their patches, both ways, conserving what they carry ------------
# Up: a content of a patch is the sum over its cells, a state (thickness, pressure) their mean by
# weight. Down: contents are shared out by weight; states are constant over a patch, or follow the
# gradient from the patches around it. Constant down is the transpose of sum up: with pressure one
# way and volume rate the other, both sides of a coupling count the same work.

# Parts of the largest spread of the patches around one. Below the first they lie almost in a line,
# and the patches around them are taken too. Directions with less than the second have no gradient.
IN_A_LINE = 0.3
FLAT = 0.05
#: Most rings of patches that a gradient is taken from.
RINGS = 3


class PatchFields:
    """Transfer between cells and their patches.

    Parameters
    ----------
    patches : of the cells.
    centres : of the cells [m], shape (C, 3), and ``areas`` [m2], shape (C,): they weigh the means
        and place the gradients.
    neighbours : pairs of cells that share an edge, shape (2, n); patches with such a pair are
        neighbours.
    """

    def __init__(
        self, patches: Patches, centres: np.ndarray, areas: np.ndarray, neighbours: np.ndarray
    ) -> None:
        self.patches = patches
        self.areas = np.ascontiguousarray(areas, dtype=float)
        if len(self.areas) != len(patches.of_cell) or not (self.areas > 0.0).all():
            raise InputError("every cell of an interface needs a positive area")
        self._centres = np.asarray(centres, dtype=float)
        either = np.hstack([neighbours, neighbours[::-1]])
        pairs = np.unique(patches.of_cell[either], axis=1)
        self._pairs = pairs[:, pairs[0] != pairs[1]]

    @cached_property
    def patch_areas(self) -> np.ndarray:
        """Area of each patch [m2], shape (P,)."""
        return self.total(self.areas)

    @cached_property
    def patch_centres(self) -> np.ndarray:
        """Middle of the area of each patch [m], shape (P, 3); beside the sheet where it bends."""
        return np.stack([self.mean(axis) for axis in self._centres.T], axis=1)

    # --- up ---------------------------------------------------------------------------------------

    def total(self, values: np.ndarray) -> np.ndarray:
        """Return the sum over the cells of each patch, (C,) to (P,): volumes, rates of volume."""
        return np.bincount(self.patches.of_cell, values, self.patches.count)

    def mean(self, values: np.ndarray, weights: np.ndarray | None = None) -> np.ndarray:
        """Return the mean over the cells of each patch by weight, (C,) to (P,).

        A patch whose cells all have the same value gets exactly that one.

        weights : positive, shape (C,); the areas without.
        """
        weights = self.areas if weights is None else weights
        of_cell = self.patches.of_cell
        some = values[self._first_cells]  # the mean of the differences, so that constants stay
        share = self.total(weights * (values - some[of_cell])) / self.total(weights)
        return some + share

    # --- down -------------------------------------------------------------------------------------

    def shared(self, totals: np.ndarray, weights: np.ndarray | None = None) -> np.ndarray:
        """Return the share of each cell in what its patch holds, by weight, (P,) to (C,).

        weights : positive, shape (C,); the areas without.
        """
        weights = self.areas if weights is None else weights
        of_cell = self.patches.of_cell
        return totals[of_cell] * (weights / self.total(weights)[of_cell])

    def constant(self, values: np.ndarray) -> np.ndarray:
        """Return the value of each cell's patch, (P,) to (C,)."""
        return values[self.patches.of_cell]

    def linear(self, values: np.ndarray, *, limited: bool = True) -> np.ndarray:
        """Return values that rise and fall over each patch and have its value as mean by area.

        Linear fields on a flat sheet come out exactly where they are not limited.

        Parameters
        ----------
        values : of the patches, shape (P,).
        limited : no cell beyond the values of its patch and the patches around it (Barth and
            Jespersen 1989); the patches at the edge of the sheet then flatten.
        """
        gradient = (self._gradients @ values).reshape(-1, 3)
        of_cell = self.patches.of_cell
        step = (self._offsets * gradient[of_cell]).sum(axis=1)
        if limited:
            one, other = self._pairs
            low, high = values.copy(), values.copy()
            np.minimum.at(low, one, values[other])
            np.maximum.at(high, one, values[other])
            room = np.where(
                step > 0.0, high[of_cell] - values[of_cell], low[of_cell] - values[of_cell]
            )
            share = np.ones(len(step))
            np.divide(room, step, out=share, where=np.abs(step) > np.abs(room))
            least = np.ones(self.patches.count)
            np.minimum.at(least, of_cell, share)
            step *= least[of_cell]
        return values[of_cell] + step

    # --- constants --------------------------------------------------------------------------------

    @cached_property
    def _first_cells(self) -> np.ndarray:
        return np.unique(self.patches.of_cell, return_index=True)[1]

    @cached_property
    def _offsets(self) -> np.ndarray:
        """Places of the cells seen from the middles of their patches [m], shape (C, 3)."""
        return self._centres - self.patch_centres[self.patches.of_cell]

    @cached_property
    def _gradients(self) -> csr_matrix:
        """The least-squares gradient of each patch from its neighbours (3 P, P)."""
        count, middles = self.patches.count, self.patch_centres
        one, other = self._pairs  # sorted by the first
        beside = np.split(other, np.searchsorted(one, np.arange(1, count)))
        rows, columns, entries = [], [], []
        for patch in range(count):
            around = _patches_around(patch, beside, middles)
            if len(around) == 0:
                continue
            offsets = middles[around] - middles[patch]
            fit = _tangential_inverse(offsets)  # (3, n): differences to gradient
            index = 3 * patch + np.arange(3)
            rows.append(np.repeat(index, len(around) + 1))
            columns.append(np.tile([*around, patch], 3))
            entries.append(np.hstack([fit, -fit.sum(axis=1, keepdims=True)]).ravel())
        if not rows:
            return csr_matrix((3 * count, count))
        table = np.concatenate(entries), (np.concatenate(rows), np.concatenate(columns))
        return csr_matrix(table, shape=(3 * count, count))


def _patches_around(patch: int, beside: list[np.ndarray], middles: np.ndarray) -> np.ndarray:
    """Return the neighbours of a patch; where they lie almost in a line, theirs as well."""
    around = beside[patch]
    for _ in range(RINGS - 1):
        if len(around) == 0:
            break
        sizes = np.linalg.svd(middles[around] - middles[patch], compute_uv=False)
        if len(sizes) > 1 and sizes[1] > IN_A_LINE * sizes[0]:
            break
        wider = np.unique(np.concatenate([around, *(beside[k] for k in around)]))
        around = wider[wider != patch]
    return around


def _tangential_inverse(offsets: np.ndarray) -> np.ndarray:
    """Return the pseudoinverse in the plane in which the offsets (n, 3) lie best, (3, n)."""
    left, sizes, right = np.linalg.svd(offsets, full_matrices=False)
    kept = sizes > FLAT * sizes[0]
    kept[2:] = False
    return (right[kept].T / sizes[kept]) @ left[:, kept].T


# --- cells in compact, connected patches ----------------------------------------------------------
# Recursive bisection finds parts of equal area, and Lloyd's iteration (Du, Faber, Gunzburger 1999)
# rounds them: every cell goes to the nearest middle, and the middles follow. A few cells that lie
# nearest to a middle through the air, on the other side of a fold, go to the patch that reaches
# them along the sheet.

#: Rounds of Lloyd's iteration; the shapes hardly change after the first few.
ROUNDS = 12
#: Where more of the area lies nearest to a middle that it has no way to, places in space do not
#: tell what lies together: then distances along the sheet to so many cells do.
FOLDED = 0.05
LANDMARKS = 6


@dataclass(frozen=True)
class Patches:
    """Which patch each cell belongs to.

    Parameters
    ----------
    of_cell : number of the patch of each cell, from 0 without gaps, shape (C,).
    count : number of patches.
    """

    of_cell: np.ndarray
    count: int

    def __post_init__(self) -> None:
        of_cell = np.ascontiguousarray(self.of_cell, dtype=np.int64)
        object.__setattr__(self, "of_cell", of_cell)
        if not np.array_equal(np.unique(of_cell), np.arange(self.count)):
            raise InputError(f"the patches must be 0 to {self.count - 1}, none of them empty")

    @classmethod
    def of_single_cells(cls, cell_count: int) -> Patches:
        """Return a patch for every cell."""
        return cls(np.arange(cell_count), cell_count)


def group_cells(
    points: np.ndarray,
    cells: np.ndarray,
    count: int,
    *,
    areas: np.ndarray,
    part: np.ndarray | None = None,
) -> Patches:
    """Group the cells of a sheet into patches of about the same area.

    Every patch is connected through edges of cells, has no cell of another part, and lies in one
    loose piece of the sheet; every piece has at least one. The result depends on nothing but the
    arguments. Patches are numbered by their first cell.

    Parameters
    ----------
    points : node positions [m], shape (N, 3).
    cells : node rows of triangles and quadrilaterals, shape (C, 3) or (C, 4), -1 is no node.
    count : patches wanted; with more than there are cells, every cell is one.
    areas : of the cells [m2], shape (C,).
    part : labels that patches must not mix, such as plies, shape (C,).

    Raises
    ------
    InputError : a count below 1, or below the number of loose pieces.
    """
    if count < 1:
        raise InputError(f"an interface needs at least one patch, not {count}")
    if count >= len(cells):
        return Patches.of_single_cells(len(cells))
    one, other = shared_edges(cells, part)
    half = coo_matrix((np.ones(len(one)), (one, other)), shape=(len(cells),) * 2)
    neighbours = (half + half.T).tocsr()
    piece_count, piece = connected_components(neighbours, directed=False)
    if count < piece_count:
        raise InputError(
            f"the sheet has {piece_count} loose pieces, each of which needs a patch of its own; "
            f"ask for at least {piece_count} patches, not {count}"
        )
    centres = _centres_of(points, cells)
    of_cell = np.empty(len(cells), dtype=np.int64)
    first = 0
    shares = _shares(np.bincount(piece, areas), np.bincount(piece), count)
    for number, share in enumerate(shares):
        rows = np.flatnonzero(piece == number)
        graph = neighbours[rows][:, rows]
        of_cell[rows] = first + _group_piece(centres[rows], areas[rows], graph, int(share))
        first += int(share)
    _, at, inverse = np.unique(of_cell, return_index=True, return_inverse=True)
    rank = np.empty(count, dtype=np.int64)
    rank[np.argsort(at)] = np.arange(count)
    return Patches(rank[inverse], count)


def shared_edges(cells: np.ndarray, part: np.ndarray | None = None) -> np.ndarray:
    """Return the pairs of cells that share an edge, shape (2, n); many at one edge are chained.

    Parameters
    ----------
    cells : node rows, shape (C, 3) or (C, 4), -1 is no node.
    part : labels; cells of different ones make no pair, shape (C,).
    """
    corners = np.where(cells >= 0, cells, cells[:, :1])  # a missing corner makes no new edge
    begin, end = corners.ravel(), np.roll(corners, -1, axis=1).ravel()
    cell = np.repeat(np.arange(len(cells)), cells.shape[1])
    is_edge = begin != end
    low, high = np.minimum(begin, end)[is_edge], np.maximum(begin, end)[is_edge]
    label = np.zeros(len(cells), dtype=np.int64)
    if part is not None:
        label = np.unique(part, return_inverse=True)[1].reshape(-1)
    cell = cell[is_edge]
    order = np.lexsort((cell, label[cell], high, low))
    low, high, cell = low[order], high[order], cell[order]
    same = (low[1:] == low[:-1]) & (high[1:] == high[:-1]) & (label[cell[1:]] == label[cell[:-1]])
    return np.stack([cell[:-1][same], cell[1:][same]])


def _centres_of(points: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Return the mean of the corners of each cell, shape (C, 3)."""
    there = cells >= 0
    sums = np.where(there[:, :, None], points[cells], 0.0).sum(axis=1)
    return sums / there.sum(axis=1)[:, None]


def _shares(areas: np.ndarray, cell_counts: np.ndarray, count: int) -> np.ndarray:
    """Return how many patches each piece gets: at least one, at most its cells, else by area."""
    shares = np.ones(len(areas), dtype=np.int64)
    for _ in range(count - len(areas)):  # the next one where patches are largest
        shares[np.argmax(np.where(shares < cell_counts, areas / shares, -1.0))] += 1
    return shares


def _group_piece(
    centres: np.ndarray, areas: np.ndarray, graph: csr_matrix, count: int
) -> np.ndarray:
    """Return the patch of each cell of one connected piece."""
    of_cell, moved = _rounded(centres, areas, graph, count)
    if moved > FOLDED * areas.sum():
        of_cell, _ = _rounded(_distances(centres, graph), areas, graph, count)
    return of_cell


def _rounded(
    places: np.ndarray, areas: np.ndarray, graph: csr_matrix, count: int
) -> tuple[np.ndarray, float]:
    """Return the patches that suit the places of the cells, and the area that had to be moved.

    It is the largest area that :func:`_nearest` moved in a round.
    """
    most = 0.0
    of_cell = _bisected(places, areas, count)
    for _ in range(ROUNDS):
        before = of_cell
        of_cell, moved = _nearest(places, areas, graph, before, count)
        most = max(most, moved)
        if np.array_equal(of_cell, before):
            break
    return of_cell, most


def _distances(centres: np.ndarray, graph: csr_matrix) -> np.ndarray:
    """Return distances along the sheet to a few far cells, as places of the cells, (C, n)."""
    ways = _ways(centres, graph)
    far = dijkstra(ways, indices=0).argmax()
    distances = []
    for _ in range(LANDMARKS):
        distances.append(dijkstra(ways, indices=far))
        far = np.min(distances, axis=0).argmax()
    return np.stack(distances, axis=1)


def _ways(centres: np.ndarray, graph: csr_matrix) -> csr_matrix:
    """Return the lengths from cell to neighbouring cell [m], never zero."""
    one, other = graph.nonzero()
    lengths = np.linalg.norm(centres[one] - centres[other], axis=1)
    return csr_matrix((np.maximum(lengths, np.finfo(float).tiny), (one, other)), shape=graph.shape)


def _bisected(centres: np.ndarray, areas: np.ndarray, count: int) -> np.ndarray:
    """Halve the cells along the longest side of their box until there are ``count`` groups."""
    of_cell = np.empty(len(centres), dtype=np.int64)
    waiting, done = [(np.arange(len(centres)), count)], 0
    while waiting:
        rows, parts = waiting.pop()
        if parts == 1:
            of_cell[rows] = done
            done += 1
            continue
        axis = np.argmax(np.ptp(centres[rows], axis=0))
        rows = rows[np.argsort(centres[rows, axis], kind="stable")]
        half = parts // 2
        sums = np.cumsum(areas[rows])
        cut = int(np.searchsorted(sums, sums[-1] * half / parts))
        cut = min(max(cut, half), len(rows) - (parts - half))  # enough cells for either side
        waiting += [(rows[:cut], half), (rows[cut:], parts - half)]
    return of_cell


def _nearest(
    centres: np.ndarray, areas: np.ndarray, graph: csr_matrix, before: np.ndarray, count: int
) -> tuple[np.ndarray, float]:
    """Return the patch with the nearest middle, as far as the sheet connects the cell with it.

    And the area of the cells that it does not connect, which go to another patch.
    """
    area = np.bincount(before, areas, count)
    sums = [np.bincount(before, areas * axis, count) for axis in centres.T]
    middles = np.stack(sums, axis=1) / area[:, None]
    # the cell next to the middle stays, so that no patch ends up empty
    distance = ((centres - middles[before]) ** 2).sum(axis=1)
    order = np.lexsort((distance, before))
    seeds = order[np.searchsorted(before[order], np.arange(count))]
    of_cell = cKDTree(middles).query(centres)[1].astype(np.int64)
    of_cell[seeds] = np.arange(count)
    # keep of each patch the piece with its seed
    one, other = graph.nonzero()
    inside = of_cell[one] == of_cell[other]
    pairs = (np.ones(np.count_nonzero(inside)), (one[inside], other[inside]))
    piece = connected_components(coo_matrix(pairs, shape=graph.shape), directed=False)[1]
    kept = piece == piece[seeds][of_cell]
    if kept.all():
        return of_cell, 0.0
    _, _, source = dijkstra(
        _ways(centres, graph),
        indices=np.flatnonzero(kept),
        min_only=True,
        return_predecessors=True,
    )
    return of_cell[source], areas[~kept].sum()  # a cell that is kept is its own source
