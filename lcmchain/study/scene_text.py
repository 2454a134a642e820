"""A scene file as the source of a study."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path

from lcmchain.check.effect_cost import measure_effects, record_effect_parts
from lcmchain.errors import InputError
from lcmchain.fingerprint import run_fingerprint
from lcmchain.model import build_model
from lcmchain.scene import Scene, on_rung, scene_from_text
from lcmchain.scene.read import read_text
from lcmchain.study.outcome import Outcome, outcome_of
from lcmchain.study.source import Progress
from lcmchain.study.variant import Variant, require_free

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
class SceneJob:
    """A run of a scene by all of its stages."""

    scene: Scene

    @property
    def fingerprint(self) -> str:
        """Hash of all that decides the numbers of the run."""
        return run_fingerprint(self.scene).sha256

    def run(self, threads: int | None, tell: Progress | None = None) -> Outcome:
        """Run in a folder that is gone afterwards; raises as :func:`lcmchain.pipeline.run`."""
        from lcmchain.pipeline import run

        with tempfile.TemporaryDirectory(prefix="lcmchain-study-") as folder:
            result = run(self.scene, folder, threads=threads, progress=tell)
        return outcome_of(result.datasets, result.summary, self.scene)


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

    def job(self, variant: Variant) -> SceneJob:
        """Return the run of a variant without files and stages that a study does not look at.

        Raises
        ------
        InputError : the variant does not fit the scene; names the variant.
        """
        try:
            quiet: tuple[str, ...] = WITHOUT_OUTPUT
            require_free(variant.overrides, quiet)  # before its value is looked at
            scene = self.scene(variant.overrides, variant.model)
            if scene.wet_forming is None:
                require_free(variant.overrides, WITHOUT_FLOW)
                quiet = (*quiet, *WITHOUT_FLOW)
            if scene.stages:  # the borders of which are frames
                quiet = (*quiet, f"process.frames={len(scene.stages) + 1}")
            return SceneJob(self.scene((*variant.overrides, *quiet), variant.model))
        except InputError as error:
            raise InputError(f'setting "{variant.name}" of the study: {error}') from None

    def effect_parts(self) -> dict[str, float]:
        """Measure what each effect takes of a step's time, and keep it for later checks."""
        scene = self.scene()
        parts = {cost.effect.name: cost.part for cost in measure_effects(scene)}
        record_effect_parts(build_model(scene), parts)
        return parts
