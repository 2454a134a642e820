"""Contours of a blank from a DXF drawing, read by ezdxf: the scene table, and the reading.

Lines, arcs, circles, ellipses, splines and polylines, also those in blocks, become polylines; those
whose ends meet are joined. The outermost closed contour is the outline, closed contours inside it
are holes.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple, Protocol

import numpy as np
import shapely
from pydantic import Field
from scipy.spatial import cKDTree

from lcmchain.errors import InputError
from lcmchain.mesh.contours import Drawn
from lcmchain.mesh.outline import check_simple, in_mm
from lcmchain.quantities.entry_types import (
    AbsentMeans,
    FileName,
    LengthUnit,
    PositiveLength,
    SceneModel,
    Text,
)
from lcmchain.quantities.units import length_factor

if TYPE_CHECKING:  # the library takes longer than other scenes take to be read
    from ezdxf.document import Drawing as Document
    from ezdxf.math import Vec3

#: Largest turn from one side of an arc to the next; corners of the outline turn by more.
LARGEST_TURN = math.radians(10.0)
#: Entities that are read; all others have no contour, are left out, and named.
CURVES = ("LINE", "ARC", "CIRCLE", "ELLIPSE", "SPLINE", "LWPOLYLINE", "POLYLINE", "INSERT")
#: How deep blocks may stand in each other.
DEEPEST_BLOCK = 20


class Drawing(SceneModel):
    """Contours of a blank from a DXF file: the outermost is the outline, those inside are holes."""

    file: Annotated[str, FileName("part.dxf")] = Field(
        description="DXF file, text or binary; relative to the scene file."
    )
    layer: Annotated[Annotated[str, Text("CUT")] | None, AbsentMeans("all layers")] = Field(
        default=None,
        description="Layer of the outline and the holes; left out, all but slit_layer.",
    )
    slit_layer: Annotated[Annotated[str, Text("SLIT")] | None, AbsentMeans("no slits")] = Field(
        default=None, description="Layer whose open lines are slits."
    )
    length_unit: Annotated[
        Annotated[str, LengthUnit()] | None, AbsentMeans("that of the drawing")
    ] = Field(
        default=None,
        description="Unit of the coordinates; it goes before that of the drawing (INSUNITS).",
    )
    sagitta: PositiveLength = Field(  # type: ignore[assignment]
        default="0.02 mm",
        description="Largest distance of an arc or curve from the straight sides in its place.",
    )
    gap: PositiveLength = Field(  # type: ignore[assignment]
        default="0.01 mm", description="Ends of lines and arcs that are nearer are joined."
    )

    def read(self, directory: Path) -> Drawn:
        """Read the drawing; errors as :func:`read_drawing`."""
        return read_drawing(
            Path(directory) / self.file,
            layer=self.layer,
            slit_layer=self.slit_layer,
            length_unit=self.length_unit,
            sagitta=self.sagitta,
            gap=self.gap,
        )


class Curve(NamedTuple):
    """A polyline of a drawing.

    points : corners (n, 2) [m]. handles : of the entities that it is made of. layer : of the first.
    """

    points: np.ndarray
    handles: tuple[str, ...]
    layer: str

    @property
    def name(self) -> str:
        """What it is called in messages."""
        some = ", ".join(self.handles[:4]) + (", ..." if len(self.handles) > 4 else "")
        return f'{some} on layer "{self.layer}"'

    @property
    def is_closed(self) -> bool:
        """Whether its ends are one point."""
        return len(self.points) > 3 and np.array_equal(self.points[0], self.points[-1])


def read_drawing(
    path: Path,
    *,
    layer: str | None,
    slit_layer: str | None,
    length_unit: str | None,
    sagitta: float,
    gap: float,
) -> Drawn:
    """Read the contours of a blank.

    Parameters
    ----------
    path : DXF file. layer : of the outline and the holes; all but ``slit_layer`` where None.
    slit_layer : of open lines that are slits. length_unit : goes before that of the file.
    sagitta : largest distance of a curve from its sides [m]. gap : ends that are joined [m].

    Raises
    ------
    InputError : no DXF file, no unit, a layer that is not there; contours with a gap, a branch or
        a crossing, several outer ones, or lines that are not flat: each names layer, handle and
        place.
    """
    document = _document(path)
    factor = _unit(document, length_unit, path)
    entities = list(_entities(document.modelspace(), 0, path))
    layers = {entity.dxf.layer for entity in entities}
    for wanted in (layer, slit_layer):
        if wanted is not None and wanted.lower() not in {name.lower() for name in layers}:
            there = ", ".join(f'"{name}"' for name in sorted(layers)) or "none"
            raise InputError(f'has nothing on a layer "{wanted}"; there is {there}', file=path)
    of_slits = [e for e in entities if slit_layer and _is_on(e, slit_layer)]
    of_contours = [e for e in entities if e not in of_slits and (layer is None or _is_on(e, layer))]
    lines = [_curve(e, factor, sagitta, path) for e in of_contours if e.dxftype() in CURVES]
    closed = _closed(_joined(lines, gap, path), gap, path)
    rim, holes = _nested(closed, path)
    slits = _joined(
        [_curve(e, factor, sagitta, path) for e in of_slits if e.dxftype() in CURVES], gap, path
    )
    for slit in slits:
        if slit.is_closed:
            raise InputError(
                f"has the closed line {slit.name} among the slits, near {in_mm(slit.points[0])}; "
                "a closed cut is a hole: draw it on the layer of the outline",
                file=path,
            )
    return Drawn(
        rim, holes, tuple(slit.points for slit in slits), _left_out([*of_contours, *of_slits])
    )


class Entity(Protocol):
    """What is read of an entity of a drawing: a curve of some kind, or a block.

    ``dxf`` holds its attributes by their names in DXF. Each kind has those of the methods that are
    asked for of it.
    """

    @property
    def dxf(self) -> Any: ...
    def dxftype(self) -> str: ...
    def virtual_entities(self) -> Iterable[Entity]: ...
    def flattening(self, distance: float, segments: int) -> Iterable[Vec3]: ...
    def vertices(self, angles: Iterable[float]) -> Iterable[Vec3]: ...


def _document(path: Path) -> Document:
    """Open a drawing, whatever its ending."""
    # Imported where a blank is drawn: the library takes longer than other scenes take to be read.
    try:
        import ezdxf
        from ezdxf import recover
    except ImportError as error:  # an environment that was set up without it
        raise InputError(
            "a drawing is read by the Python library ezdxf, which is not installed; install it "
            "with: pip install ezdxf"
        ) from error
    try:
        with open(path, "rb") as opened:
            start = opened.read(64)
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", file=path) from None
    if start[:4] in (b"AC10", b"AC1.", b"MC0."):
        raise InputError("is a DWG drawing; save it as DXF", file=path)
    text = start.removeprefix(b"\xef\xbb\xbf").split()
    if not start.startswith(b"AutoCAD Binary DXF") and text[:1] not in ([b"0"], [b"999"]):
        raise InputError("is no DXF drawing; export the contours as DXF", file=path)
    try:
        try:
            return ezdxf.readfile(path)
        except ezdxf.DXFError:  # files of many programs are not quite right
            return recover.readfile(path)[0]
    except (ezdxf.DXFError, OSError, ValueError, UnicodeDecodeError) as error:
        raise InputError(f"cannot be read as a DXF drawing: {error}", file=path) from None


def _unit(document: Document, length_unit: str | None, path: Path) -> float:
    """Metres to a unit of the drawing."""
    if length_unit is not None:
        return length_factor(length_unit)
    if not document.units:
        raise InputError(
            'does not say its unit ($INSUNITS); give length_unit, for example "mm"', file=path
        )
    from ezdxf import units

    return float(
        units.conversion_factor(units.InsertUnits(document.units), units.InsertUnits.Meters)
    )


def _entities(space: Iterable[Any], depth: int, path: Path) -> Iterator[Entity]:
    """Entities of a drawing, those of blocks in their place."""
    for entity in space:
        if entity.dxftype() == "INSERT":
            if depth == DEEPEST_BLOCK:
                raise InputError(f"has blocks nested more than {depth} deep", file=path)
            inner = list(_entities(entity.virtual_entities(), depth + 1, path))
            for part in inner:
                if part.dxf.layer == "0":  # what a block leaves open is that of its place
                    part.dxf.layer = entity.dxf.layer
                part.dxf.handle = part.dxf.handle or entity.dxf.handle
            yield from inner
        else:
            yield entity


def _is_on(entity: Entity, layer: str) -> bool:
    return str(entity.dxf.layer).lower() == layer.lower()


def _left_out(entities: Iterable[Entity]) -> str:
    """Say which entities have no contour."""
    count = Counter(entity.dxftype() for entity in entities if entity.dxftype() not in CURVES)
    return ", ".join(f"{number} {kind}" for kind, number in sorted(count.items()))


# --- curves ---------------------------------------------------------------------------------------


def _curve(entity: Entity, factor: float, sagitta: float, path: Path) -> Curve:
    """Return an entity as a polyline [m]."""
    points = np.array([tuple(point) for point in _points(entity, sagitta / factor)], dtype=float)
    points = points.reshape(-1, 3) * factor
    handle = str(entity.dxf.handle or "?")
    if not np.isfinite(points).all() or len(points) < 2:
        raise InputError(
            f'has no length in {entity.dxftype()} {handle} on layer "{entity.dxf.layer}"; remove '
            "it",
            file=path,
        )
    if np.ptp(points[:, 2]) > 1e-6 * max(float(np.ptp(points[:, :2], axis=0).max()), sagitta):
        raise InputError(
            f'is not flat: {entity.dxftype()} {handle} on layer "{entity.dxf.layer}" near '
            f"{in_mm(points[0])} reaches over {1e3 * np.ptp(points[:, 2]):.3g} mm of z; draw the "
            "blank in the plane of x and y",
            file=path,
        )
    return Curve(points[:, :2], (handle,), str(entity.dxf.layer))


def _points(entity: Entity, sagitta: float) -> Iterator[Vec3]:
    """Corners of an entity, in the units of the drawing."""
    kind = entity.dxftype()
    if kind == "LINE":
        yield from (entity.dxf.start, entity.dxf.end)
    elif kind in ("ARC", "CIRCLE"):
        yield from _arc_points(entity, sagitta)
    elif kind == "ELLIPSE":
        way = entity.dxf.end_param - entity.dxf.start_param
        count = math.ceil((way % (2.0 * math.pi) or 2.0 * math.pi) / LARGEST_TURN)
        yield from entity.flattening(sagitta, segments=count)
    elif kind == "SPLINE":
        yield from entity.flattening(sagitta, segments=8)
    else:
        last = None
        for side in entity.virtual_entities():
            points = list(_points(side, sagitta))
            if last is not None and points[-1].isclose(last) and not points[0].isclose(last):
                points.reverse()  # arcs run anticlockwise
            yield from points if last is None else points[1:]
            last = points[-1]


def _arc_points(entity: Entity, sagitta: float) -> Iterator[Vec3]:
    """Corners of an arc or circle on it: sides turn by a bounded angle and leave a bounded gap."""
    if entity.dxftype() == "CIRCLE":
        first, way = 0.0, 360.0
    else:
        first = entity.dxf.start_angle
        way = (entity.dxf.end_angle - first) % 360.0 or 360.0
    radius = abs(entity.dxf.radius)
    turn = 2.0 * math.acos(max(1.0 - sagitta / radius, -1.0)) if radius > 0.0 else LARGEST_TURN
    count = math.ceil(math.radians(way) / min(turn, LARGEST_TURN) - 1e-9)
    if way == 360.0:
        count += -count % 4  # a circle has the symmetries of a square
    points = list(entity.vertices(first + way * np.arange(count + 1) / count))
    yield from points[:-1]
    yield points[0] if way == 360.0 else points[-1]


# --- contours -------------------------------------------------------------------------------------


def _joined(curves: list[Curve], gap: float, path: Path) -> list[Curve]:
    """Join curves whose ends meet, as far as two meet; ends of joined ones are one point."""
    whole = [_snapped(c, gap) for c in curves]
    found = [c for c in whole if c.is_closed]
    parts = [c for c in whole if not c.is_closed]
    if not parts:
        return found
    ends = np.array([end for c in parts for end in (c.points[0], c.points[-1])])
    node = np.arange(len(ends))
    for first, second in sorted(cKDTree(ends).query_pairs(gap)):
        node[node == node[second]] = node[first]
    at_node: dict[int, list[int]] = defaultdict(list)
    for end, number in enumerate(node.tolist()):
        at_node[number].append(end // 2)
    for number, meeting in at_node.items():
        if len(meeting) > 2:
            names = ", ".join(parts[part].handles[0] for part in meeting[:5])
            raise InputError(
                f"branches at {in_mm(ends[number])}: {len(meeting)} ends of lines ({names}, layer "
                f'"{parts[meeting[0]].layer}") meet there; remove what is drawn twice, or name the '
                "layer of the contours",
                file=path,
            )
    left = set(range(len(parts)))
    while left:
        open_ends = [p for p in sorted(left) for e in (0, 1) if len(at_node[node[2 * p + e]]) == 1]
        found.append(_chain(open_ends[0] if open_ends else min(left), parts, node, at_node, left))
    return found


def _chain(
    first: int,
    parts: list[Curve],
    node: np.ndarray,
    at_node: dict[int, list[int]],
    left: set[int],
) -> Curve:
    """Return the curve that one and those joined to it make; they are taken out of ``left``."""
    start = first
    forward = not (len(at_node[node[2 * first]]) == 2 and len(at_node[node[2 * first + 1]]) == 1)
    points: list[np.ndarray] = []
    handles: list[str] = []
    begun = node[2 * first + (0 if forward else 1)]
    here = begun
    while True:
        left.discard(first)
        line = parts[first].points
        if node[2 * first] != here:
            line = line[::-1]
            here = node[2 * first]
        else:
            here = node[2 * first + 1]
        points.append(line if not points else line[1:])
        handles += parts[first].handles
        onward = [part for part in at_node[here] if part in left]
        if not onward:
            break
        first = onward[0]
    joined = np.concatenate(points)
    if here == begun and len(joined) > 3:
        joined[-1] = joined[0]
    return Curve(joined, tuple(handles), parts[start].layer)


def _snapped(curve: Curve, gap: float) -> Curve:
    """Return a curve without repeated points; one whose ends meet is closed."""
    points = curve.points
    away = np.hypot(*np.diff(points, axis=0).T)
    points = points[np.append(True, away > 1e-9 * np.ptp(points, axis=0).max())]
    if len(points) > 3 and np.hypot(*(points[-1] - points[0])) <= gap:
        points = points.copy()
        points[-1] = points[0]
    return curve._replace(points=points)


def _closed(curves: list[Curve], gap: float, path: Path) -> list[Curve]:
    """Return the closed contours without the repeated point; open ones are an error."""
    if not curves:
        raise InputError("has no line that could be a contour", file=path)
    open_ones = [curve for curve in curves if not curve.is_closed]
    if open_ones:
        curve = open_ones[0]
        ends = np.array([end for c in open_ones for end in (c.points[0], c.points[-1])])
        away = np.hypot(*(ends - curve.points[-1]).T)
        away[1] = np.inf
        nearest = ends[int(np.argmin(away))]
        raise InputError(
            f"has a contour that is not closed: {curve.name} ends at {in_mm(curve.points[-1])}, "
            f"{1e3 * away.min():.4g} mm from the next end at {in_mm(nearest)}; close it, give a "
            f"larger gap than {1e3 * gap:.4g} mm, or name the layer of the contours (open lines "
            "that are slits: slit_layer)",
            file=path,
        )
    for curve in curves:
        try:
            check_simple(curve.points[:-1], "")
        except InputError as error:
            text = error.message.split("; ")[0]
            raise InputError(f"has the contour {curve.name}, which {text}", file=path) from None
    return [curve._replace(points=curve.points[:-1]) for curve in curves]


def _nested(curves: list[Curve], path: Path) -> tuple[np.ndarray, tuple[np.ndarray, ...]]:
    """Outermost contour and those inside it."""
    shapes = [shapely.Polygon(curve.points) for curve in curves]
    for index, (curve, shape) in enumerate(zip(curves, shapes)):
        for other, beside in zip(curves[:index], shapes[:index]):
            if shape.boundary.intersects(beside.boundary):
                at = shapely.get_coordinates(shape.boundary.intersection(beside.boundary))[0]
                raise InputError(
                    f"has contours that cross or touch at {in_mm(at)}: {other.name}, and "
                    f"{curve.name}",
                    file=path,
                )
    depth = [sum(o is not s and o.contains(s) for o in shapes) for s in shapes]
    outer = [curve for curve, level in zip(curves, depth) if level == 0]
    if len(outer) > 1:
        names = "; ".join(f"{c.name} at {in_mm(c.points[0])}" for c in outer[:4])
        raise InputError(
            f"has {len(outer)} contours that lie in no other one: {names}; one is the outline of a "
            "blank: name its layer, or give a drawing for each ply",
            file=path,
        )
    for curve, level in zip(curves, depth):
        if level > 1:
            raise InputError(
                f"has a contour in a hole: {curve.name} at {in_mm(curve.points[0])}; remove it",
                file=path,
            )
    holes = tuple(curve.points for curve, level in zip(curves, depth) if level == 1)
    return outer[0].points, holes
