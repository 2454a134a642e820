"""What the net of kinematic draping says of a scene, in milliseconds: the preview of any model."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from lcmchain.check.effects_of_run import later_stages
from lcmchain.check.remarks import scene_warnings
from lcmchain.check.tables import effect_table, preview_table, scene_tables
from lcmchain.draping import Draped, drape, is_drapable
from lcmchain.draping.joints import joints_of
from lcmchain.draping.result import draping_effect, locking_warnings
from lcmchain.effects.effect import Effect
from lcmchain.errors import InputError
from lcmchain.mesh.blank import BlankMesh
from lcmchain.quantities.places import millimetres
from lcmchain.scene import Scene
from lcmchain.tools.table import ToolTable

if TYPE_CHECKING:
    from rich.table import Table


#: Rows that differ between plies that are draped alike.
SEED, LAID_IN = "seed", "laid in"


@dataclass(frozen=True)
class DrapingReport:
    """Everything that ``lcmchain check`` shows of a scene that is draped."""

    scene: Scene
    effects: list[Effect]
    preview: list[tuple[str, str]]
    warnings: list[str]
    picture: Path | None

    def first_tables(self) -> list[Table]:
        """Lay out for a terminal what decides whether to start."""
        return preview_table(self.preview)

    def further_tables(self) -> list[Table]:
        """Lay out all entries with what they rest on, and all effects with their reason."""
        return [*scene_tables(self.scene), effect_table(self.effects)]

    def tables(self) -> list[Table]:
        """Lay the whole report out as tables for a terminal."""
        return [*self.first_tables(), *self.further_tables()]


def check_draping(
    scene: Scene, blank: BlankMesh, tools: ToolTable, remarks: list[str], picture: Path | None
) -> DrapingReport:
    """Drape the blank of a scene, and tell what a run of it will find.

    Parameters
    ----------
    blank, tools : of the scene. remarks : found while they were built.
    picture : of the start, that the report names; None for none.

    Raises
    ------
    InputError : there is no surface, or the seed has no place on it.
    """
    draped = drape(scene, tools=tools, blank=blank)
    missing = draped.missing()
    return DrapingReport(
        scene=scene,
        effects=[draping_effect(draped), *later_stages(scene)],
        preview=list(_rows(draped)),
        warnings=[
            *scene_warnings(scene),
            *remarks,
            *(locking_warnings(draped) if missing is None else [f"a run will fail: {missing}"]),
        ],
        picture=picture,
    )


def draping_preview(
    scene: Scene, blanks: Sequence[BlankMesh], tools: ToolTable
) -> list[tuple[str, str]]:
    """Return what the net says of a scene on any rung; empty where there is nothing to drape.

    Of a stack every ply is draped as if it were alone; what is the same of plies is said once.

    Raises
    ------
    InputError : the scene's own ``[draping]`` cannot be followed.
    """
    if not is_drapable(scene, tools):
        return []
    stack = scene.stack
    with_fibres = [(p, b) for p, b in zip(stack, blanks, strict=True) if p.material.has_fibres]
    drapable = [(p, b) for p, b in with_fibres if p.material.is_biaxial]
    if with_fibres and not drapable:
        return [("no net", "a net is laid for fibres along both axes of a ply, 0 and 90 deg")]
    each = [(ply.name, _preview_of_one(scene.alone(ply), b, tools)) for ply, b in drapable]
    if len(stack) == 1:
        return [row for _, rows in each for row in rows]
    alike: dict[tuple[str, str], list[str]] = {}
    for name, rows in each:
        for row in rows:
            if row[0] not in (SEED, LAID_IN):
                alike.setdefault(row, []).append(name)
    return [
        (what if len(names) == len(each) else f"{', '.join(names)}: {what}", value)
        for (what, value), names in sorted(alike.items(), key=lambda row: row[0][0], reverse=True)
    ]


def _preview_of_one(scene: Scene, blank: BlankMesh, tools: ToolTable) -> list[tuple[str, str]]:
    try:
        return list(_rows(drape(scene, tools=tools, blank=blank)))
    except InputError as error:
        if scene.draping.model_fields_set:
            raise
        return [("no net", f"{error}")]


def _rows(draped: Draped) -> Iterator[tuple[str, str]]:
    yield "surface", draped.surface
    seed = [*draped.seed, draped.mesh.node_positions[0, 2]]
    yield SEED, f"{millimetres(seed, 1)} of the flat blank, at {millimetres(draped.place, 1)}"
    missing, unplaced = draped.missing(), draped.unplaced_part()
    of_laid = "" if missing is None else f", of the {1.0 - unplaced:.1%} of the area that it covers"
    if unplaced < 1.0:
        angle, place, flat = draped.largest_shear()
        yield (
            "largest shear angle",
            f"{math.degrees(angle):.1f} deg at {millimetres(place, 1)}, "
            f"{millimetres(flat, 1)} of the flat blank{of_laid}",
        )
    # what has no place counts as locked, for a run; it is not sheared
    locking = math.degrees(draped.locking_angle)
    part = max(draped.locked_part() - unplaced, 0.0)
    yield f"beyond {locking:.3g} deg", f"{part:.1%} of the area" if part > 1e-12 else "nothing"
    for joint in joints_of(draped):
        yield f"joint of {joint.below} and {joint.above}", joint.in_words()
    if missing is not None:
        yield "not laid", f"{unplaced:.1%} of the area: {missing}"
    yield LAID_IN, f"{1e3 * draped.wall_s:.0f} ms"
