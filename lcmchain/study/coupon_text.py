"""A coupon test as the source of a study."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass

from lcmchain.compilation.threads import thread_count
from lcmchain.coupons.pulled import PULLED, PulledTest
from lcmchain.coupons.specimen import FRAMES, Recording, record
from lcmchain.effects.mass_scaling import added_mass
from lcmchain.errors import InputError, SimulationInterrupted
from lcmchain.fields import FrameSeries, build_datasets, field_summary
from lcmchain.fingerprint import run_fingerprint
from lcmchain.quantities.units import QuantityError, parse_quantity
from lcmchain.scene import Scene, on_rung, scene_from_text
from lcmchain.scene.overrides import parse_value
from lcmchain.solver.simulation import Simulation
from lcmchain.study.outcome import Outcome, outcome_of_sheet
from lcmchain.study.source import Progress
from lcmchain.study.variant import Variant, require_free

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
