"""What a study varies: settings of a scene file or of a coupon test, and the run of each."""

from __future__ import annotations

import difflib
import hashlib
import json
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Protocol

from lcmchain import pipeline
from lcmchain.check.effect_cost import measure_effects, record_effect_parts
from lcmchain.compilation.threads import thread_count
from lcmchain.coupons.pulled import PULLED, PulledTest
from lcmchain.coupons.specimen import FRAMES, Recording, record
from lcmchain.effects.process.mass_scaling import added_mass
from lcmchain.errors import InputError, SimulationInterrupted
from lcmchain.fields import FrameSeries, build_datasets, field_summary
from lcmchain.model import build_model
from lcmchain.provenance import run_fingerprint
from lcmchain.quantities.units import QuantityError, parse_quantity
from lcmchain.scene import Scene, on_rung, scene_from_text
from lcmchain.scene.reading.overrides import parse_value
from lcmchain.scene.reading.read import is_pipe, read_text
from lcmchain.solver.simulation import Simulation
from lcmchain.study.outcome import Outcome, outcome_of, outcome_of_sheet


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


def require_free(overrides: Sequence[str], of_study: Sequence[str]) -> None:
    """Refuse to vary an entry that the study itself sets in every run: it would vary nothing.

    Parameters
    ----------
    overrides : of a variant. of_study : those that the study puts behind them.

    Raises
    ------
    InputError : names the entry.
    """
    taken = [text.partition("=")[0] for text in of_study]
    for key in (text.partition("=")[0].strip() for text in overrides):
        if any(key == entry or key.startswith((f"{entry}.", f"{entry}[")) for entry in taken):
            raise InputError("cannot be varied: the study sets it in every run", key=key)


#: Called with (completed, total, text).
Progress = Callable[[float, float, str], None]


class Job(Protocol):
    """One run of a study: its scene, what decides its numbers, and how it is made."""

    @property
    def scene(self) -> Scene:
        """The scene, with all that a study leaves out of its output left out."""

    @property
    def fingerprint(self) -> str:
        """Hash of all that decides the numbers of the run."""

    def run(self, threads: int | None, tell: Progress | None = None) -> Outcome:
        """Run, and return what a study keeps.

        Raises
        ------
        SimulationError : a guard stopped the run.
        InputError : no model can be made of the scene, as of a mesh too coarse for it.
        """


class Source(Protocol):
    """What a study varies, with what a worker on another machine needs to build it."""

    @property
    def path(self) -> str:
        """Where it comes from, for messages."""

    def scene(self, overrides: tuple[str, ...] = (), model: str | None = None) -> Scene:
        """Return the scene with further overrides, on a rung of its own where one is named.

        Raises
        ------
        InputError : an entry is wrong.
        """

    def job(self, variant: Variant) -> Job:
        """Return the run of a variant.

        Raises
        ------
        InputError : the variant does not fit the scene; names the variant.
        """

    def effect_parts(self) -> dict[str, float]:
        """Return the parts of a step's time that effects take, where they can be measured."""


# --- coupon test ----------------------------------------------------------------------------------


#: Beginning of overrides that are of the test itself, not of its scene.
OF_TEST = "coupon."


@dataclass(frozen=True)
class CouponJob:
    """A run of a coupon test on the specimen of a scene."""

    test: PulledTest
    scene: Scene

    @property
    def fingerprint(self) -> str:
        """Hash of all that decides the numbers of the run."""
        decides = (run_fingerprint(self.scene), self.test.name, asdict(self.test))  # type: ignore[call-overload]
        return hashlib.sha256(json.dumps(decides).encode()).hexdigest()

    def run(self, threads: int | None, tell: Progress | None = None) -> Outcome:
        """Pull the specimen.

        Raises
        ------
        SimulationError : a guard stopped the run.
        SimulationInterrupted : Ctrl-C.
        """
        supports = self.test.supports(self.scene)
        try:
            simulation, recording = record(self.scene, supports, threads=threads, progress=tell)
        except KeyboardInterrupt:
            raise SimulationInterrupted("stopped by the user") from None
        return self._outcome(simulation, recording)

    def _outcome(self, simulation: Simulation, recording: Recording) -> Outcome:
        model = simulation.model
        frames = FrameSeries.from_snapshots(recording.snapshots[:: FRAMES - 1], ())
        (body,) = model.bodies
        datasets = build_datasets(self.scene, body.mesh, frames, material=body.material)
        force = self.test.force(self.scene, recording)
        numbers = {
            "element_count": model.element_count,
            "step_count": simulation.state.step_count,
            **field_summary(datasets),
            **added_mass(model),
            "clamp_force_max_N": force.max(),
            "forming_work_J": recording.work[-1],
        }
        return outcome_of_sheet(datasets, numbers, recording.seconds, thread_count())


@dataclass(frozen=True)
class CouponText:
    """A coupon test by its name, with overrides of its scene and of the test.

    Parameters
    ----------
    name : as in ``lcmchain coupon NAME``.
    overrides : of the scene of the usual specimen, or ``coupon.displacement=...`` of the test.
    model : rung of the model ladder for the whole study; None is that of the scene.
    """

    name: str
    overrides: tuple[str, ...] = ()
    model: str | None = None

    @property
    def path(self) -> str:
        """Where it comes from, for messages."""
        return f"coupon {self.name}"

    def scene(self, overrides: tuple[str, ...] = (), model: str | None = None) -> Scene:
        """Return the scene of the specimen with further overrides.

        Raises
        ------
        InputError : an entry is wrong, or the specimen is none that the test can hold.
        """
        return self._test_and_scene(overrides, model)[1]

    def job(self, variant: Variant) -> CouponJob:
        """Return the run of a variant.

        Raises
        ------
        InputError : the variant does not fit the specimen; names the variant.
        """
        frames = f"process.frames={FRAMES}"
        try:
            require_free(variant.overrides, (frames,))
            return CouponJob(*self._test_and_scene((*variant.overrides, frames), variant.model))
        except InputError as error:
            raise InputError(f'setting "{variant.name}" of the study: {error}') from None

    def effect_parts(self) -> dict[str, float]:
        """Return nothing: times of steps are measured on scenes, which no clamp moves."""
        return {}

    def _test_and_scene(
        self, overrides: tuple[str, ...], model: str | None
    ) -> tuple[PulledTest, Scene]:
        everything = (*self.overrides, *overrides)
        of_test = [text for text in everything if text.startswith(OF_TEST)]
        test = self._test(of_test)
        rest = [text for text in everything if not text.startswith(OF_TEST)]
        scene = scene_from_text(test.text, None, rest)
        rung = model or self.model
        scene = scene if rung is None else on_rung(scene, rung)
        _require_pullable(scene)
        return test, scene

    def _test(self, overrides: list[str]) -> PulledTest:
        """Return the test with its overrides."""
        kind = PULLED[self.name]
        name, dimension = kind.driven_by
        given = {}
        for text in overrides:
            key, _, value = text.partition("=")
            if key.strip() != OF_TEST + name:
                raise InputError(
                    f'is no entry of the test; there is "{OF_TEST}{name}"', key=key.strip()
                )
            try:
                given[name] = parse_quantity(str(parse_value(value.strip())), dimension)
            except QuantityError as error:
                raise InputError(str(error), key=key.strip()) from None
            if not given[name] > 0.0:
                raise InputError(f"must be positive, is {value.strip()}", key=key.strip())
        return kind(**given)


def _require_pullable(scene: Scene) -> None:
    """Refuse what a specimen cannot be.

    Raises
    ------
    InputError : no rectangle, tools beside the clamps, or a net that knows no forces.
    """
    if scene.only_ply("a coupon").blank.size is None:
        raise InputError("a coupon is a rectangle: give its size", key="blank.size")
    for name, cuts in scene.only_ply("a coupon").blank.cuts.items():
        if cuts:
            raise InputError("a coupon is a whole rectangle; leave them out", key=f"blank.{name}")
    if scene.tools:
        raise InputError("a coupon is held by clamps, not by tools", key="tools")
    if not scene.element.has_forces:
        raise InputError(
            "a net that is laid onto a tool cannot be pulled; take another rung", key="element"
        )


# --- scene file -----------------------------------------------------------------------------------


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
        with tempfile.TemporaryDirectory(prefix="lcmchain-study-") as folder:
            result = pipeline.run(self.scene, folder, threads=threads, progress=tell)
        return outcome_of(result.datasets, result.summary, self.scene)


@dataclass(frozen=True)
class SceneText:
    """A scene as text, with its overrides: what a worker on another machine needs to build it.

    Parameters
    ----------
    text : TOML. path : file it came from; mesh files that tools name are relative to its folder.
        Of what came through a pipe a name in the current folder: other processes lack the pipe.
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
        text = read_text(path)
        whole = Path.cwd() / "stdin" if is_pipe(path) else path.resolve()
        return cls(text, str(whole), tuple(overrides), model)

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


def read_source(name: Path | str, overrides: tuple[str, ...] = ()) -> Source:
    """Return the scene of a file, or the coupon test of that name, to be varied by a study.

    Raises
    ------
    InputError : there is neither such a file nor such a coupon, or an override is wrong.
    """
    path = Path(name)
    coupon = str(name).replace("_", "-")
    source: Source
    if coupon in PULLED and not path.exists():
        source = CouponText(coupon, overrides)
    elif path.exists() or path.suffix:
        source = SceneText.from_file(path, overrides)
    else:
        near = difflib.get_close_matches(coupon, PULLED, 1, 0.5)
        raise InputError(
            f'"{name}" is neither a scene file nor a coupon that can be studied, which are '
            f"{' and '.join(PULLED)}" + (f'; did you mean "{near[0]}"?' if near else "")
        )
    source.scene()  # wrong input is told before a folder is made
    return source
