"""A setting of a study: what it changes of a scene, and the scene that comes of it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from lcmchain.errors import InputError
from lcmchain.scene import Scene, on_rung, scene_from_text
from lcmchain.scene.read import read_text

#: What a run of a study leaves out: nothing of it enters a comparison.
WITHOUT_OUTPUT = (
    "output.pictures=false",
    "output.vtu=false",
    "output.report=false",
    'output.animation="none"',
    "process.frames=2",
    "mapping=[]",
)
#: Taken out as well, unless resin flows while the blank is formed.
WITHOUT_FLOW = ("infiltration=none", "permeability=none")


@dataclass(frozen=True)
class Variant:
    """One setting.

    Parameters
    ----------
    name : short, unique in a study.
    axis : what is varied, such as ``edge length``.
    overrides : ``key=value`` texts, as for :func:`lcmchain.scene.read_scene`.
    value : of what is varied, in SI, for orders and charts; None where it is no number.
    model : rung of the model ladder; None is that of the scene.
    """

    name: str
    axis: str
    overrides: tuple[str, ...] = ()
    value: float | None = None
    model: str | None = None


@dataclass(frozen=True)
class SceneText:
    """A scene as text, with its overrides: what a worker on another machine needs to build it.

    Parameters
    ----------
    text : TOML. path : file it came from; mesh files that tools name are relative to its folder.
    overrides : that hold for the whole study, before those of a variant.
    model : rung of the model ladder for the whole study; None is that of the scene.
    """

    text: str
    path: str
    overrides: tuple[str, ...] = ()
    model: str | None = None

    @classmethod
    def from_file(
        cls, path: Path | str, overrides: tuple[str, ...] = (), model: str | None = None
    ) -> SceneText:
        """Read a scene file.

        Raises
        ------
        InputError : there is none, or it cannot be read.
        """
        path = Path(path)
        if path.is_dir():
            raise InputError("is a folder; name the scene file in it", file=path)
        return cls(read_text(path), str(path.resolve()), tuple(overrides), model)

    def scene(self, overrides: tuple[str, ...] = (), model: str | None = None) -> Scene:
        """Return the scene with further overrides, on a rung of its own where one is named.

        Raises
        ------
        InputError : an entry is wrong.
        """
        scene = scene_from_text(self.text, self.path, (*self.overrides, *overrides))
        rung = model or self.model
        return scene if rung is None else on_rung(scene, rung)

    def scene_to_run(self, variant: Variant) -> Scene:
        """Return the scene of a variant without files and stages that a study does not look at.

        Raises
        ------
        InputError : the variant does not fit the scene; names the variant.
        """
        try:
            quiet: tuple[str, ...] = WITHOUT_OUTPUT
            if self.scene(variant.overrides, variant.model).wet_forming is None:
                quiet = (*quiet, *WITHOUT_FLOW)
            return self.scene((*variant.overrides, *quiet), variant.model)
        except InputError as error:
            raise InputError(f'setting "{variant.name}" of the study: {error}') from None
