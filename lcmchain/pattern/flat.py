"""Trimming line and flat pattern: which flat outline gives the wanted rim of a formed part.

The wanted rim is a closed line in plan, seen along z. On a part that reaches beyond it the line
maps back to the flat blank, which is the trimming line. A blank that is cut there before forming
comes out a little otherwise, since what was cut off no longer holds the rest. So it is formed
again, and each point of the outline moves by what its image misses of the wanted rim, mapped back
through the deformation there: Newton's method with the deformation gradient in place of the full
derivative.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely

from lcmchain.errors import InputError
from lcmchain.fields.dataset import SHEET
from lcmchain.fields.stack import ply_sheet
from lcmchain.mesh.outline import check_simple
from lcmchain.pattern.formed import FormedSheet
from lcmchain.pipeline import run
from lcmchain.scene import Scene

#: Corners of a line turn by this at least; between them it is sampled anew.
CORNER = np.radians(15.0)


@dataclass(frozen=True)
class Round:
    """One forming of the iteration.

    outline : flat outline that was formed [m], shape (n, 2). rim : its image in plan [m].
    miss : largest distance between the formed and the wanted rim [m].
    """

    outline: np.ndarray
    rim: np.ndarray
    miss: float


def trimming_line(sheet: FormedSheet, net: np.ndarray, *, key: str | None = None) -> np.ndarray:
    """Return a closed line of the part in plan (n, 2), on the flat blank (m, 2) [m].

    Raises
    ------
    InputError : the part does not reach it.
    """
    return sheet.to_flat(sampled(net, sheet.edge_length), key=key)


def flat_pattern(
    net: np.ndarray,
    form: Callable[[np.ndarray | None], FormedSheet],
    *,
    tolerance: float | None = None,
    most_rounds: int = 6,
    key: str | None = None,
) -> list[Round]:
    """Return the rounds of the iteration to the flat outline of a wanted rim; the last is best.

    Parameters
    ----------
    net : wanted rim in plan (n, 2) [m].
    form : forms a blank of a flat outline (m, 2) [m]; None is the blank to begin with, whose part
        reaches beyond the wanted rim everywhere.
    tolerance : largest distance that ends the iteration [m], by default a quarter of an edge.
    most_rounds : at which it ends otherwise.

    Raises
    ------
    InputError : the first part does not reach the wanted rim, or the outline crosses itself.
    """
    sheet = form(None)
    goal = sampled(net, sheet.edge_length)
    outline = sheet.to_flat(goal, key=key)
    limit = 0.25 * sheet.edge_length if tolerance is None else tolerance
    rounds: list[Round] = []
    for _ in range(most_rounds):
        check_simple(outline, key or "outline")
        sheet = form(outline)
        rim = sheet.to_formed(outline)[:, :2]
        rounds.append(Round(outline, rim, miss(rim, goal)))
        if rounds[-1].miss <= limit:
            break
        outline = outline + sheet.back(outline, goal - rim)
    return sorted(rounds, key=lambda one: -one.miss)


def miss(rim: np.ndarray, goal: np.ndarray) -> float:
    """Return the largest distance of two closed lines (n, 2) from each other [m]."""
    lines = shapely.LinearRing(rim), shapely.LinearRing(goal)
    return float(shapely.hausdorff_distance(*lines, densify=0.25))


def sampled(line: np.ndarray, spacing: float) -> np.ndarray:
    """Return a closed line (n, 2) with its corners, and points about ``spacing`` [m] between."""
    into = line - np.roll(line, 1, axis=0)
    onward = np.roll(line, -1, axis=0) - line
    turn = np.abs(
        np.arctan2(
            into[:, 0] * onward[:, 1] - into[:, 1] * onward[:, 0], (into * onward).sum(axis=1)
        )
    )
    corners = np.flatnonzero(turn >= CORNER)
    start = int(corners[0]) if len(corners) else 0
    line = np.roll(line, -start, axis=0)
    stops = [*((corners - start).tolist() or [0]), len(line)]
    closed = np.concatenate([line, line[:1]])
    found = []
    for first, last in zip(stops[:-1], stops[1:]):
        piece = closed[first : last + 1]
        way = np.append(0.0, np.cumsum(np.hypot(*np.diff(piece, axis=0).T)))
        count = max(1, round(float(way[-1]) / spacing))
        at = np.linspace(0.0, way[-1], count, endpoint=False)
        found.append(np.column_stack([np.interp(at, way, piece[:, k]) for k in (0, 1)]))
    return np.concatenate(found)


class SceneForming:
    """Forms a scene whose blank, or one of whose plies, takes another outline each time.

    Parameters
    ----------
    scene : with the blank to begin with. folder : each run has a folder in it.
    ply : name of the ply; None where the scene has one sheet.
    progress : as of :func:`lcmchain.pipeline.run`.

    Raises
    ------
    InputError : there is no such ply, or several and none is named.
    """

    def __init__(
        self,
        scene: Scene,
        folder: Path,
        ply: str | None = None,
        progress: Callable[[float, float, str], None] | None = None,
    ) -> None:
        names = [one.name for one in scene.stack]
        if ply is None and len(names) > 1:
            raise InputError(f"needs the name of a ply; there is {', '.join(names)}", key="--ply")
        if ply is not None and ply not in names:
            raise InputError(f'there is no ply "{ply}"; there is {", ".join(names)}', key="--ply")
        if scene.layup is not None:
            raise InputError(
                "gives plies of one outline; name plies of their own in [[plies]]", key="layup"
            )
        self.scene, self.folder, self.progress = scene, folder, progress
        self.ply = ply if scene.plies else None
        self.count = 0
        chosen = scene.stack[0] if ply is None else scene.stack.named(ply)
        self.edge_length = chosen.blank.edge_length
        self.center = np.array(chosen.center)

    def __call__(self, outline: np.ndarray | None) -> FormedSheet:
        """Form the blank with an outline (n, 2) [m], or as the scene says."""
        scene = self.scene if outline is None else self._with(outline)
        folder = self.folder / f"round_{self.count}"
        self.count += 1
        groups = run(scene, folder, progress=self.progress).datasets
        if self.ply is None or f"/{self.ply}" not in groups:  # a single ply has no group
            return FormedSheet.of_result(groups[SHEET])
        return FormedSheet.of_result(ply_sheet(groups, self.ply))

    def _with(self, outline: np.ndarray) -> Scene:
        if self.scene.blank is not None:
            return self.scene.model_copy(update={"blank": self.scene.blank.with_outline(outline)})
        name = self.ply or self.scene.stack[0].name
        plies = tuple(
            one.with_outline(outline - self.center) if one.name == name else one
            for one in self.scene.plies
        )
        return self.scene.model_copy(update={"plies": plies})
