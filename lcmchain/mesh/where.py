"""Scene entries that name a place of a mesh: a set, a point, a box, a polygon, a boundary."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, model_validator

from lcmchain.quantities.entry_types import (
    AbsentMeans,
    Name,
    Number,
    PointInPlane,
    Position,
    PositiveLength,
    Range,
    Row,
    Switch,
    Text,
    wrong,
)
from lcmchain.quantities.scene_model import SceneModel

#: Entries that name a place, beside ``rim``.
WAYS = ("set", "point", "box", "polygon", "loop", "boundary")

Corners = Annotated[
    tuple[Position, Position],
    Row('["0 0 -1 mm", "20 20 1 mm"]', count=2, entries="points", units=False),
]
CornersInPlane = Row(
    '[["0 mm", "0 mm"], ["30 mm", "0 mm"], ["0 mm", "20 mm"]]',
    minimum_count=3,
    entries="corner points",
    units=False,
)


class Where(SceneModel):
    """A place of the mesh: a set, a point, a box, a polygon, the rim, or another boundary."""

    set: Annotated[Annotated[str, Text("GATE")] | None, AbsentMeans("")] = Field(
        default=None,
        description="Name of a node set, a cell set or a part of the mesh file.",
    )
    point: Annotated[Position | None, AbsentMeans("")] = Field(
        default=None, description="The node nearest to a point, or all within radius of it."
    )
    radius: Annotated[PositiveLength | None, AbsentMeans("")] = Field(
        default=None, description="Distance from the point within which all nodes are taken."
    )
    box: Annotated[Corners | None, AbsentMeans("")] = Field(
        default=None, description="Nodes (of a region: cells) in a box, by two opposite corners."
    )
    polygon: Annotated[tuple[PointInPlane, ...] | None, CornersInPlane, AbsentMeans("")] = Field(
        default=None,
        description="Nodes (of a region: cells) whose x and y lie in a polygon, by its corners.",
    )
    rim: Switch = Field(
        default=False, description="Nodes on the outermost closed boundary of the mesh."
    )
    loop: Annotated[Position | None, AbsentMeans("")] = Field(
        default=None,
        description="Nodes on the closed boundary that passes nearest to this point, as of a hole.",
    )

    boundary: Annotated[
        Annotated[int, Number(2, Range(1, 10_000), whole=True)] | None, AbsentMeans("")
    ] = Field(
        default=None,
        description="Nodes on a closed boundary by its number: 1 is the longest, 2 the next.",
    )

    @property
    def ways(self) -> list[str]:
        """Ways in which the place is given."""
        given = [way for way in WAYS if getattr(self, way) is not None]
        return [*given, *(["rim"] if self.rim else [])]

    @property
    def in_words(self) -> str:
        """What the place is, for the check of a scene."""
        if self.set is not None:
            return f'set "{self.set}"'
        if self.point is not None:
            around = "node nearest to" if self.radius is None else f"{_mm(self.radius)} mm around"
            return f"{around} {_place(self.point)}"
        if self.box is not None:
            return f"box from {_place(self.box[0])} to {_place(self.box[1])}"
        if self.polygon is not None:
            return f"polygon of {len(self.polygon)} corners"
        if self.loop is not None:
            return f"boundary next to {_place(self.loop)}"
        if self.boundary is not None:
            return f"boundary {self.boundary}"
        return "rim" if self.rim else "everywhere"

    @model_validator(mode="after")
    def _check_way(self) -> Self:
        self.require_ways()
        return self

    def require_ways(self) -> None:
        """Refuse what is no place, or more than one."""
        ways = self.ways
        if len(ways) != 1:
            found = " and ".join(ways) or "none"
            raise wrong(f"needs one of {', '.join(WAYS)} and rim = true, but has {found}")
        if self.radius is not None and self.point is None:
            raise wrong("belongs to point, which is not given", field="radius")


class NamedPlace(Where):
    """A place with a name, for messages and files."""

    name: Annotated[str, Name("gate")] = Field(description="Name, for messages and files.")


def _place(point: tuple[float, float, float]) -> str:
    return "(" + ", ".join(_mm(value) for value in point) + ") mm"


def _mm(value: float) -> str:
    return f"{1e3 * value + 0.0:.4g}"
