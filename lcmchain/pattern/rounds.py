"""Forming of a scene with one outline after the other, as the search for a flat pattern asks."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from lcmchain.errors import InputError
from lcmchain.fields.dataset import SHEET
from lcmchain.pattern.formed import FormedSheet
from lcmchain.pipeline import run
from lcmchain.scene import Scene


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
        names = [own.name for own in scene.stack]
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
        result = run(scene, folder, progress=self.progress)
        return FormedSheet.of_result(result.datasets[self.ply or SHEET])

    def _with(self, outline: np.ndarray) -> Scene:
        if self.scene.blank is not None:
            return self.scene.model_copy(update={"blank": self.scene.blank.with_outline(outline)})
        name = self.ply or self.scene.stack[0].name
        plies = tuple(
            own.with_outline(outline - self.center) if own.name == name else own
            for own in self.scene.plies
        )
        return self.scene.model_copy(update={"plies": plies})
