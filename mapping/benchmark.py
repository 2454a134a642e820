"""Time, memory and accuracy of the mapping beside those of medcoupling, in one run.

A hemisphere of quadrilaterals is mapped onto one of twice as many triangles, turned so that no cell
of one mesh is one of the other. Every program maps in a process of its own, after a small mapping
that loads and compiles what it needs. Times are those of the processor.
"""

from __future__ import annotations

import importlib.util
import multiprocessing
import statistics
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass

import numpy as np
from rich.table import Table

from lcmchain.bench.measure import largest_memory

REPETITIONS = 5
RADIUS = 0.1
TURN = 0.3

#: Cells along the side of source and target: 25k onto 50k cells, and 100k onto 200k.
SIZES = (158, 316)
PROGRAMS = ("second order", "first order", "medcoupling P0P0")


@dataclass(frozen=True)
class MappingTime:
    """Median times [s] of one program on one size, memory beyond that of the meshes, and error.

    memory : largest memory of the process, less that before the mapping [byte].
    error : relative difference (L2) to the exact means over the target's cells.
    """

    program: str
    source_cells: int
    target_cells: int
    weights: float
    first_transfer: float
    next_transfer: float
    memory: int
    error: float


def dome(side: int, turn: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Points [m] (N, 3) and quadrilaterals of a hemisphere, from a square of side x side cells."""
    line = np.linspace(-1.0, 1.0, side + 1)
    x, y = (c.ravel() for c in np.meshgrid(line, line, indexing="ij"))
    u, v = x * np.sqrt(1.0 - 0.5 * y * y), y * np.sqrt(1.0 - 0.5 * x * x)
    r = np.hypot(u, v)
    angle = 0.999 * 0.5 * np.pi * r
    factor = np.where(r > 0.0, np.sin(angle) / np.where(r > 0.0, r, 1.0), 0.0)
    points = RADIUS * np.stack([u * factor, v * factor, np.cos(angle)], axis=1)
    cosine, sine = np.cos(turn), np.sin(turn)
    turned = points @ np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    node = np.arange(len(points)).reshape(side + 1, side + 1)
    corners = (node[:-1, :-1], node[1:, :-1], node[1:, 1:], node[:-1, 1:])
    return turned, np.stack([c.ravel() for c in corners], axis=1)


def means(points: np.ndarray, cells: np.ndarray, parts: int = 4) -> np.ndarray:
    """Means of a smooth field over the curved cells, by the midpoints of small triangles."""
    total, weight = np.zeros(len(cells)), np.zeros(len(cells))
    for half in [(0, 1, 2), (0, 2, 3)][: cells.shape[1] - 2]:
        a, b, c = (points[cells[:, k]] for k in half)
        for i in range(parts):
            for j in range(parts - i):
                for corners in _pair_of_triangles(i, j)[: 2 if i + j < parts - 1 else 1]:
                    p, q, r = (
                        _on_sphere(a + (b - a) * (m / parts) + (c - a) * (n / parts))
                        for m, n in corners
                    )
                    area = np.linalg.norm(np.cross(q - p, r - p), axis=1)
                    total += area * field(_on_sphere(p + q + r))
                    weight += area
    return total / np.where(weight > 0.0, weight, 1.0)


def _pair_of_triangles(i: int, j: int) -> list[list[tuple[int, int]]]:
    return [[(i, j), (i + 1, j), (i, j + 1)], [(i + 1, j), (i + 1, j + 1), (i, j + 1)]]


def _on_sphere(places: np.ndarray) -> np.ndarray:
    return RADIUS * places / np.linalg.norm(places, axis=1)[:, None]


def field(places: np.ndarray) -> np.ndarray:
    """A smooth function of places [m], shape (N, 3)."""
    x, y, z = (places / RADIUS).T
    return 1.0 + 0.5 * np.sin(2.0 * x) * np.cos(1.5 * y) + 0.2 * z


def measure(program: str, side: int) -> MappingTime:
    """Measure one program on one size, in this process."""
    run = _medcoupling if program.startswith("medcoupling") else _own(program)
    run(12)
    source, target = dome(side), dome(side, TURN)
    triangles = np.concatenate([target[1][:, [0, 1, 2]], target[1][:, [0, 2, 3]]])
    given, exact = means(*source), means(target[0], triangles)
    before = largest_memory()
    times, mapped = [], np.zeros(0)
    for _ in range(REPETITIONS):
        *durations, mapped = run(side, (*source, target[0], triangles, given))
        times.append(durations)
    corners = target[0][triangles]
    doubled = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.where(mapped < 1e100, np.linalg.norm(doubled, axis=1), 0.0)
    difference = np.where(mapped < 1e100, mapped - exact, 0.0)
    error = float(np.sqrt(np.sum(areas * difference**2) / np.sum(areas * exact**2)))
    weights, first, following = (statistics.median(column) for column in zip(*times, strict=True))
    memory = largest_memory() - before
    return MappingTime(
        program, len(source[1]), len(triangles), weights, first, following, memory, error
    )


def _own(program: str) -> Callable:
    # Imported here: in the process of another program they would count as its memory.
    from lcmchain.mapping.sheet import Sheet
    from lcmchain.mapping.surfaces.averages import mean_over_cells
    from lcmchain.mapping.surfaces.surface import Surface
    from lcmchain.mapping.target import TargetMesh
    from lcmchain.mapping.transfer import compute_weights

    order = 1 if program.startswith("first") else 2

    def run(side, meshes=None):
        points, quads, others, triangles, values = meshes or _small(side)
        start = time.process_time()
        sheet = Sheet(Surface(points, quads), {"thickness": values}, {})
        target = TargetMesh(others, (("triangle", triangles),), {})
        weights = compute_weights(sheet, target, order=order)
        after = time.process_time()
        mean_over_cells(sheet.surface, weights, values)
        once = time.process_time()
        found = mean_over_cells(sheet.surface, weights, values)
        return after - start, once - after, time.process_time() - once, found

    return run


def _medcoupling(side, meshes=None):
    import medcoupling
    from MEDCouplingRemapper import MEDCouplingRemapper

    points, quads, others, triangles, values = meshes or _small(side)

    def mesh(places, cells):
        kind = {3: medcoupling.NORM_TRI3, 4: medcoupling.NORM_QUAD4}[cells.shape[1]]
        table = np.hstack([np.full((len(cells), 1), kind), cells]).astype(np.int64)
        ends = np.arange(0, table.size + 1, table.shape[1], dtype=np.int64)
        made = medcoupling.MEDCouplingUMesh("mesh", 2)
        made.setCoords(medcoupling.DataArrayDouble(np.ascontiguousarray(places)))
        numbers = medcoupling.DataArrayInt64
        made.setConnectivity(numbers(table.ravel()), numbers(ends))
        return made

    start = time.process_time()
    source, target = mesh(points, quads), mesh(others, triangles)
    remapper = MEDCouplingRemapper()
    remapper.setPrecision(1e-12)
    remapper.setIntersectionType(medcoupling.Triangulation)
    remapper.prepare(source, target, "P0P0")
    after = time.process_time()

    def transfer():
        given = medcoupling.MEDCouplingFieldDouble(medcoupling.ON_CELLS)
        given.setMesh(source)
        given.setArray(medcoupling.DataArrayDouble(np.ascontiguousarray(values)))
        given.setNature(medcoupling.IntensiveMaximum)
        return remapper.transferField(given, 1e300).getArray().toNumPyArray()

    transfer()
    once = time.process_time()
    found = transfer()
    return after - start, once - after, time.process_time() - once, found


def _small(side: int) -> tuple[np.ndarray, ...]:
    points, quads = dome(side)
    others, cells = dome(side, TURN)
    triangles = np.concatenate([cells[:, [0, 1, 2]], cells[:, [0, 2, 3]]])
    return points, quads, others, triangles, means(points, quads)


def run_mapping_bench(sizes: tuple[int, ...] = SIZES) -> Table:
    """Measure all programs that are installed and return the table of ``lcmchain bench``."""
    installed = importlib.util.find_spec("medcoupling") is not None
    programs = PROGRAMS if installed else PROGRAMS[:2]
    table = Table(
        title=f"mapping a hemisphere, processor time in s, median of {REPETITIONS}"
        + ("" if installed else "; pip install medcoupling to compare"),
        title_justify="left",
    )
    for column in ("cells", "onto", "program", "weights", "transfer", "next", "MiB", "error"):
        table.add_column(column, justify="left" if column == "program" else "right")
    spawn = multiprocessing.get_context("spawn")
    for side in sizes:
        for program in programs:
            with ProcessPoolExecutor(max_workers=1, mp_context=spawn) as pool:
                found = pool.submit(measure, program, side).result()
            table.add_row(
                f"{found.source_cells:,}", f"{found.target_cells:,}", program,
                f"{found.weights:.3f}", f"{found.first_transfer:.3f}",
                f"{found.next_transfer:.4f}", f"{found.memory / 2**20:.0f}", f"{found.error:.1e}",
            )  # fmt: skip
    return table
