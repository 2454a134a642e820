"""Requirements that a run has to keep: read rightly, kept by the choice, and judged after the run.

Pilots and runs are made here from a known error law, so that the true error is known.
"""

import json
import math
import time
from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

from lcmchain.check import large_mesh
from lcmchain.check.expected_cost import estimate_run
from lcmchain.check.large_mesh import BUILDING_BYTES
from lcmchain.cli import app
from lcmchain.errors import InputError
from lcmchain.solver.simulation import STEPS_PER_CHUNK, Simulation
from lcmchain.study import chooser as chooser_module
from lcmchain.study.choice import read_requirement
from lcmchain.study.chooser import SPARE, Chooser
from lcmchain.study.comparison import differences
from lcmchain.study.convergence import Convergence, error_laws
from lcmchain.study.outcome import Outcome
from lcmchain.study.runs import DURATION, Beginning, begin_run
from lcmchain.study.step_settings import (
    AS_IT_IS,
    MASSES,
    SOFTER_FIBRES,
    StepSettings,
    cheaper_rungs,
)

from .test_comparison import SIZE, sheet

SECONDS = 1.0  # of a run with edges of a tenth of the sheet


def shear(h: float, order: float, factor: float):
    """A shear angle whose error is factor (h/SIZE)^order times a pattern of size 1."""

    def field(x, y):
        pattern = np.cos(np.pi * x / SIZE) * np.cos(np.pi * y / SIZE) * 2.0
        return 0.4 * np.sin(5.0 * x + 3.0 * y) + factor * (h / SIZE) ** order * pattern

    return field


class Known(Chooser):
    """A chooser whose runs follow a known law of errors and times.

    of_speed, of_fibres : errors by the speed of the process and by soft fibres, in waves that have
        nothing in common with the error of the mesh, nor with each other: squares add up.
    of_step : time of a step beside its elements, in elements.
    """

    def __init__(
        self, dent, tmp_path, requirement, order=1.0, factor=1.0, *, of_speed=0.0, of_fibres=0.5,
        of_step=0.0, **options,
    ):  # fmt: skip
        super().__init__(dent, tmp_path, requirement, **options)
        self.order, self.factor = order, factor
        self.of_speed, self.of_fibres, self.of_step = of_speed, of_fibres, of_step
        self.runs = []

    def outcome(self, edge, settings) -> Outcome:
        h = edge / 0.04 * SIZE  # of the scene's blank of 40 mm
        of_speed = self.of_speed * settings.speed
        of_fibres = self.of_fibres if settings.fibres < 1.0 else 0.0
        known = shear(h, self.order, self.factor)

        def off(x, y):
            waves = (np.sin(2.0 * np.pi * z / SIZE) for z in (x, y))
            return math.sqrt(2.0) * sum(
                size * wave for size, wave in zip((of_speed, of_fibres), waves, strict=True)
            )

        made = sheet(max(2, round(SIZE / h)), lambda x, y: known(x, y) + off(x, y), thickness=known)
        seconds = SECONDS / settings.speed * math.sqrt(settings.fibres) * self.work(edge)
        return Outcome(seconds, 1, made.reference, made.formed, made.faces,
                       {"shear_angle": made.values["shear_angle"]}, {"fibre_strain_max": 1e-3},
                       )  # fmt: skip

    def _pilot(self, edge, settings):
        if settings.model:
            raise InputError("a known law has one model")
        return self.pilots.setdefault((edge, settings), self.outcome(edge, settings))

    def work(self, edge) -> float:
        """Steps times elements, 1 with edges of a tenth of the sheet."""
        steps = 0.04 / edge / 10.0
        return steps * (steps**2 + self.of_step / 100.0)

    def _begin(self, edge):
        return Beginning(0.6 * SECONDS * self.work(edge), 0.01 * SECONDS)

    def make(self, choice):
        made = self.outcome(choice.edge_length, choice.settings)
        self.runs.append((choice.edge_length, choice.settings, made))
        return made

    def true_error(self) -> float:
        exact = sheet(60, shear(0.0, 1.0, 0.0))
        return differences(self.runs[-1][2], exact)["shear_angle"].typical


@pytest.mark.parametrize("order", [0.8, 1.0, 1.4, 2.5])
@pytest.mark.parametrize("required", [0.5, 1.0, 2.0])
def test_the_true_error_of_the_chosen_run_is_within_the_requirement(
    dent, tmp_path, order, required
):
    factor = math.radians(20.0) * 10.0 ** (order - 1.0)
    known = Known(dent, tmp_path, read_requirement(f"{required} deg shear", None), order, factor)
    choice = known.run(known.make)
    assert choice.kept
    assert known.true_error() <= math.radians(required)
    # nor is time thrown away: the estimate is no more than three times the truth
    assert choice.found["shear_angle"] < 3.0 * known.true_error()
    # the law knows no inertia, and soft fibres change everything
    assert choice.settings == StepSettings(mass=MASSES[0])
    assert choice.seconds == pytest.approx(
        known.pilot_seconds + sum(made.seconds for _, _, made in known.runs)
    )
    told = choice.settings_in_words()
    assert "16 times the inertia take 0.25 of the time" in told


def test_pilots_take_a_modest_part_of_the_time(dent, tmp_path):
    known = Known(dent, tmp_path, read_requirement("0.3 deg shear", None), 1.0, math.radians(20.0))
    choice = known.run(known.make)
    assert len(known.runs) == 1
    assert choice.pilot_seconds < 0.5 * known.runs[0][2].seconds


def test_cheaper_settings_are_taken_only_where_all_errors_together_meet_the_requirement(
    dent, tmp_path
):
    requirement, one = read_requirement("1 deg shear", None), math.radians(1.0)
    taken = {}
    for of_speed, of_fibres in ((0.02, 2.0), (0.22, 2.0), (0.02, 0.1), (0.02, 0.9)):
        known = Known(dent, tmp_path, requirement, 1.0, 0.3,
                      of_speed=of_speed * one, of_fibres=of_fibres * one)  # fmt: skip
        choice = known.run(known.make)
        taken[of_speed, of_fibres] = choice.settings
        assert choice.kept
        assert known.true_error() <= one
        s = choice.settings
        off = math.hypot(of_speed * s.speed, of_fibres if s.fibres < 1.0 else 0.0)
        # of the speed as far as three runs tell their law; of fibres as measured
        assert 0.95 < choice.settings_errors["shear_angle"] / (off * one) < 1.25
    assert taken[0.02, 2.0] == StepSettings(mass=16.0)
    assert taken[0.22, 2.0].mass < 16.0
    assert taken[0.02, 0.1] == StepSettings(mass=16.0, fibres=SOFTER_FIBRES)
    assert taken[0.02, 0.9] == StepSettings(mass=16.0)


def test_fibres_that_would_stretch_too_far_are_not_softened(dent, tmp_path):
    strict = type(dent)(dent.text, dent.path, ("process.fibre_strain_allowed=0.0005",))
    known = Known(strict, tmp_path, read_requirement("1 deg shear", None), 1.0, 0.3, of_fibres=0.0)
    assert known.run(known.make).settings.fibres == 1.0
    known = Known(dent, tmp_path, read_requirement("1 deg shear", None), 1.0, 0.3, of_fibres=0.0)
    assert known.run(known.make).settings.fibres == SOFTER_FIBRES


class Doubtful(Known):
    """More inertia than the scene's makes a check worse, on meshes finer than some."""

    finer_than, speed = math.inf, 3.0

    def outcome(self, edge, settings):
        made = super().outcome(edge, settings)
        doubts = {"Damping": 2}  # whatever the settings
        if settings.speed > self.speed and edge < self.finer_than:
            doubts["Quasi-static"] = 2
        return replace(made, doubts=doubts)


def test_settings_that_make_a_check_worse_are_not_taken(dent, tmp_path):
    known = Doubtful(dent, tmp_path, read_requirement("1 deg shear", None), 1.0, 0.3)
    choice = known.run(known.make)
    assert choice.kept
    assert choice.settings == StepSettings(mass=4.0)
    assert len({settings for _, settings, _ in known.runs}) == 1


def test_a_run_whose_settings_made_a_check_worse_is_made_again_without_them(dent, tmp_path):
    known = Doubtful(dent, tmp_path, read_requirement("1 deg shear", None), 1.0, 0.3)
    known.finer_than, known.speed = 0.04 / 14.5, 1.0
    choice = known.run(known.make)
    assert known.runs[0][1] == StepSettings(mass=16.0)
    assert choice.settings == AS_IT_IS
    assert choice.kept
    assert any("checks of the run worse (Quasi-static)" in note for note in choice.notes)
    choice.settings, choice.worse = StepSettings(mass=4.0), ["Quasi-static"]
    assert "4 times the inertia made checks of the run worse (Quasi-static)" in choice.missed()


def without_a_time(dent):
    """The scene with the pace that the program finds."""
    text = dent.text.replace('time = "4 ms", mass_damping = "200 1/s"', "")
    assert text != dent.text
    return type(dent)(text, dent.path)


@pytest.mark.parametrize(("speed", "time"), [(5.0, 0.25), (3.0, 0.5), (1.0, 1.0)])
def test_a_pace_that_was_found_is_made_faster_as_far_as_no_check_gets_worse(
    dent, tmp_path, speed, time
):
    known = Doubtful(
        without_a_time(dent), tmp_path, read_requirement("1 deg shear", None), 1.0, 0.3
    )
    known.speed = speed
    assert known.scene.time_is_found
    choice = known.run(known.make)
    assert choice.settings == StepSettings(time=time)
    assert choice.kept and len(known.runs) == 1
    assert {settings.time for _, settings in known.pilots} >= {1.0, 0.25}  # pilots are fast


def test_a_pace_that_was_found_stays_where_only_a_time_is_required(dent, tmp_path):
    known = Known(without_a_time(dent), tmp_path, read_requirement(None, "20 s"), 1.0, 0.3)
    assert known.run(known.make).settings == AS_IT_IS


def test_pilots_are_as_fast_as_they_change_little_of_the_requirement(dent, tmp_path):
    """A tenth of it; four times as fast they are off by 3 ``of_speed``, twice as fast by one."""
    found = without_a_time(dent)
    for of_speed, speed in ((0.02, 4.0), (0.06, 2.0), (0.2, 1.0)):
        requirement = read_requirement("1 deg shear", None)
        known = Known(found, tmp_path, requirement, 1.0, 0.3, of_speed=math.radians(of_speed))
        known.run(known.make)
        assert known.pilots_as.settings.speed == speed


def test_a_run_that_misses_the_requirement_is_repeated_on_a_finer_mesh(dent, tmp_path, monkeypatch):
    known = Known(dent, tmp_path, read_requirement("1 deg shear", None), 1.0, 0.3)

    def surprised(levels):
        twice = 2.0 if known.runs else 1.0  # runs show twice the error that pilots promised
        laws = error_laws(levels)
        return {n: Convergence(law.order, twice * law.factor) for n, law in laws.items()}

    monkeypatch.setattr(chooser_module, "error_laws", surprised)
    choice = known.run(known.make)
    edges = [edge for edge, _, _ in known.runs]
    assert len(edges) > 1
    assert edges == sorted(edges, reverse=True)
    assert choice.kept
    assert any("missed the requirement" in note for note in choice.notes)


def test_a_budget_is_kept_and_what_it_leaves_of_the_requirement_is_told(dent, tmp_path):
    for budget in (5.0, 60.0, 600.0):
        known = Known(dent, tmp_path, read_requirement(None, f"{budget} s"), 1.0, 0.5)
        choice = known.run(known.make)
        assert 0.75 * budget <= choice.seconds <= 1.25 * budget
        # the least budget has one mesh only that is fine enough
        assert ("shear_angle" in choice.found) == (budget > 5.0)
        assert choice.found.get("shear_angle", math.inf) > 0.5 * known.true_error()
        assert choice.settings == AS_IT_IS  # nobody has said which errors matter
    known = Known(dent, tmp_path, read_requirement("0.01 deg shear", "60 s"), 1.0, 0.5)
    choice = known.run(known.make)
    assert not choice.kept
    assert choice.seconds <= 75.0
    assert "what the time allows" in choice.why
    assert any("less than the requirement needs" in note for note in choice.notes)
    assert "is not met" in choice.missed()
    # where no two meshes can be compared nothing is known of the errors
    unknown = replace(choice, found=dict.fromkeys(choice.found, math.nan))
    assert "is met is not known: no error could be estimated" in unknown.missed()
    assert "is not met by" not in unknown.missed()


def test_a_requirement_that_no_pilot_tells_of_takes_no_coarser_mesh_than_the_scene(dent, tmp_path):
    """One pilot fits into the budget, which tells times alone; the mesh of the scene does too."""
    text = replace(dent, overrides=('blank.edge_length="3 mm"',))
    known = Known(text, tmp_path, read_requirement("5 deg shear", "4 s"), 1.0, 0.5)
    choice = known.run(known.make)
    assert len(known.pilots) == 1 and choice.edge_length == pytest.approx(3e-3)
    assert choice.why == "the pilots tell nothing of the shear angle, and these are the scene's"
    # what the time does not allow is not taken for it
    known = Known(text, tmp_path, read_requirement("5 deg shear", "2 s"), 1.0, 0.5)
    choice = known.run(known.make)
    assert choice.edge_length > 3e-3 and "what the time allows" in choice.why


def test_a_budget_takes_softer_fibres_where_all_errors_fall_by_them(dent, tmp_path):
    edges = {}
    for of_fibres in (0.0, 0.5):
        known = Known(dent, tmp_path, read_requirement(None, "60 s"), 1.0, 0.5, of_fibres=of_fibres)
        choice = known.run(known.make)
        edges[of_fibres] = choice.edge_length
        assert choice.settings == (AS_IT_IS if of_fibres else StepSettings(fibres=SOFTER_FIBRES))
        assert choice.seconds <= 75.0
    assert edges[0.0] < 0.9 * edges[0.5]


class WithThickness(Known):
    """Thickness, which nobody asks for, is off by the mesh and by the speed of the process.

    By the mesh it is everywhere, by the speed in waves: the squares of both add up. Meshes of
    fewer than 14 elements along the blank follow no law.
    """

    of_mesh, of_pace, astray = 0.4, 0.01, 0.1

    def truth(self, edge, settings):
        return math.hypot(self.of_mesh * edge / 0.04, self.of_pace * settings.speed)

    def outcome(self, edge, settings):
        made = super().outcome(edge, settings)
        astray = self.astray if edge > 0.04 / 13.9 else 0.0
        along = made.reference[made.faces].mean(axis=1)[:, 0]
        waves = math.sqrt(2.0) * np.cos(2.0 * np.pi * along / SIZE)
        off = self.of_mesh * edge / 0.04 + self.of_pace * settings.speed * waves
        made.values["thickness"] = 1e-3 * (1.0 + off + astray)
        return made


@pytest.mark.parametrize(
    ("within", "budget"),
    [("3 deg shear", None), ("1 deg shear", None), (None, "20 s"), (None, "60 s"), (None, "400 s")],
    ids=["loose-requirement", "requirement", "small-budget", "budget", "large-budget"],
)
def test_a_requirement_and_a_budget_state_the_errors_of_a_run_by_one_rule(
    dent, tmp_path, within, budget
):
    """By meshes that are fine enough, and with what its settings leave, required or not."""
    known = WithThickness(dent, tmp_path, read_requirement(within, budget), 1.0, 0.5)
    choice = known.run(known.make)
    edge, settings, _ = known.runs[-1]
    # two meshes alone leave the order open; what is left open is taken on the safe side
    most = 1.4 if len(choice.meshes) == 2 else 1.3
    assert 0.98 < choice.found["thickness"] / known.truth(edge, settings) < most
    assert max(choice.meshes) < 0.04 / 13.9
    *coarser, finest = [f"{1e3 * edge:.3g} mm" for edge in choice.meshes]
    told = f"Estimated errors, by meshes of {', '.join(coarser)} and {finest}"
    assert told in choice.in_words()


def test_errors_of_a_slower_process_that_a_budget_leaves_are_those_of_its_speed(dent, tmp_path):
    class Doubling(WithThickness):
        """Only meshes of which one halves the edges of the other."""

        def work(self, edge):
            return super().work(0.04 / 2.0 ** math.floor(math.log2(0.04 / edge)))

    known = Doubling(dent, tmp_path, read_requirement(None, "100 s"), 1.0, 0.5)
    choice = known.run(known.make)
    assert choice.settings.time > 1.3
    slower = known.candidates[-1]
    assert slower.settings == choice.settings
    of_pace = known.of_pace / choice.settings.time
    assert slower.errors["thickness"] == pytest.approx(of_pace, rel=0.1)
    assert choice.found["thickness"] >= known.truth(choice.edge_length, choice.settings)


def test_no_error_is_stated_where_too_few_meshes_are_known(dent, tmp_path):
    known = WithThickness(dent, tmp_path, read_requirement(None, "4 s"), 1.0, 0.5)
    choice = known.run(known.make)
    assert choice.kept and choice.found == {}
    assert choice.unstated == ["shear_angle", "thickness", "contour"]
    assert "No error can be stated: that takes two meshes at least" in choice.in_words()
    # of some quantities only
    choice.found = {"shear_angle": 0.01}
    choice.unstated, choice.meshes = ["thickness"], [2e-3, 1e-3]
    told = choice.in_words()
    assert "by meshes of 2 mm and 1 mm, which leave the order open: shear angle 0.57 °" in told
    assert "too few of these can be compared to state that of thickness" in told


class Guarded(Known):
    """Meshes with fewer elements along an edge than some are stopped by a guard, after half."""

    least = 24

    def _pilot(self, edge, settings):
        made = super()._pilot(edge, settings)
        if not made.failure and edge > 1.001 * 0.04 / self.least:
            made = replace(made, seconds=0.5 * made.seconds, failure="hourglass energy: too coarse")
            self.pilots[edge, settings] = made
        return made


def test_pilots_of_a_budget_go_on_until_one_is_fine_enough_for_its_guards(dent, tmp_path):
    known = Guarded(dent, tmp_path, read_requirement(None, "28 s"), 1.0, 0.5)
    choice = known.run(known.make)
    failed = [edge for (edge, _), made in known.pilots.items() if made.failure]
    assert len(failed) == 3 and min(failed) > 0.04 / known.least
    assert choice.edge_length < min(failed)
    assert choice.is_over_budget == any("more than the budget" in note for note in choice.notes)

    known = Guarded(dent, tmp_path, read_requirement(None, "2 s"), 1.0, 0.5)
    with pytest.raises(InputError, match="too coarse.*; allow a larger --budget, which finer ones"):
        known.run(known.make)
    assert known.pilot_seconds <= 2.0


def test_a_broken_budget_is_told_and_is_no_requirement_that_was_met(dent, tmp_path):
    class Slow(Known):
        """Pilots promise a tenth of what the run takes."""

        def make(self, choice):
            made = super().make(choice)
            return replace(made, seconds=10.0 * made.seconds)

    known = Slow(dent, tmp_path, read_requirement(None, "20 s"), 1.0, 0.5)
    choice = known.run(known.make)
    assert choice.seconds > 1.25 * 20.0
    assert not choice.kept
    assert any("more than the budget of 20 s" in note for note in choice.notes)
    assert f"took {choice.seconds:.3g} s" in choice.missed()
    known = Known(dent, tmp_path, read_requirement(None, "20 s"), 1.0, 0.5)
    choice = known.run(known.make)
    assert choice.kept
    assert choice.notes == []


def test_a_budget_is_not_spent_on_a_process_time_that_is_part_of_the_physics(dent, tmp_path):
    class Doubling(Known):
        def work(self, edge):
            return super().work(0.04 / 2.0 ** math.floor(math.log2(0.04 / edge)))

    ended = type(dent)(dent.text, dent.path, ('tools.punch.motion.end="3 ms"',))
    known = Doubling(ended, tmp_path, read_requirement(None, "100 s"), 1.0, 0.5)
    choice = known.run(known.make)
    assert choice.settings.time == 1.0
    assert "the process time stays, since tools.punch.motion.end" in choice.why


def test_steps_that_cost_much_beside_their_elements_do_not_mislead_a_budget(dent, tmp_path):
    # by pilots alone the time would be extrapolated with the 2.5th power of the edges at least
    for of_step in (400.0, 3000.0):
        requirement = read_requirement(None, "100 s")
        known = Known(dent, tmp_path, requirement, 1.0, 0.5, of_step=of_step)
        choice = known.run(known.make)
        assert 0.75 <= choice.seconds / 100.0 <= 1.0
        assert choice.run_seconds == pytest.approx(known.runs[-1][2].seconds, rel=0.1)
        assert choice.pilot_seconds == pytest.approx(
            sum(made.seconds for made in known.pilots.values()) + 0.01 * len(known.beginnings)
        )


def test_what_no_finer_mesh_can_be_had_for_goes_into_a_slower_process(dent, tmp_path):
    class Doubling(Known):
        """Only meshes of which one halves the edges of the other."""

        def work(self, edge):
            return super().work(0.04 / 2.0 ** math.floor(math.log2(0.04 / edge)))

    for budget in (60.0, 100.0, 150.0):
        known = Doubling(dent, tmp_path, read_requirement(None, f"{budget} s"), 1.0, 0.5)
        choice = known.run(known.make)
        assert 0.75 <= choice.seconds / budget <= 1.0
        assert choice.settings.time >= SPARE
        assert "a slower process" in choice.why
        assert choice.run_seconds == pytest.approx(known.runs[-1][2].seconds, rel=0.05)


def test_a_small_budget_is_not_spent_on_knowing_what_to_spend_it_on(dent, tmp_path):
    """Two meshes that tell of errors, trials that are quick, first steps of a hundredth of it."""
    known = Known(dent, tmp_path, read_requirement(None, "32 s"), 1.0, 0.5, of_fibres=0.0)
    choice = known.run(known.make)
    assert choice.settings.fibres == SOFTER_FIBRES
    assert known._begun_for == DURATION
    tried = {settings for _, settings in known.pilots}
    assert not any(settings.mass == MASSES[1] for settings in tried)
    counted = [level.edge for level in known._counted[:-1]]
    assert len(counted) == 2 and counted[0] == pytest.approx(0.04 / 14)
    assert choice.pilot_seconds < 0.35 * 32.0
    assert 0.75 * 32.0 <= choice.seconds <= 32.0
    small = Known(dent, tmp_path, read_requirement(None, "5 s"), 1.0, 0.5)
    assert small._begun_for == pytest.approx(0.05)


def test_the_beginning_of_a_run_goes_with_the_work_of_a_run(dent, monkeypatch):
    """Steps of the mesh itself, made for a moment; what one takes is measured, here by a clock
    of which the test knows all."""
    per_step, made = 1e-3, []
    make_steps = Simulation.make_steps

    def counted(simulation, count, step):
        made.append(count)
        return make_steps(simulation, count, step)

    monkeypatch.setattr(Simulation, "make_steps", counted)
    monkeypatch.setattr(time, "perf_counter", lambda: 100.0 + per_step * sum(made))

    def begun(*overrides, duration=DURATION):
        made.clear()
        scene = dent.scene(('blank.edge_length="2 mm"', *overrides))
        beginning = begin_run(scene, 1, duration)
        steps = estimate_run(Simulation.from_scene(scene).model).step_count
        assert beginning.seconds == pytest.approx(per_step * steps)
        assert beginning.spent == pytest.approx(per_step * sum(made))
        return beginning

    short, long = (begun(f'process.time="{duration} ms"') for duration in (8, 16))
    assert long.seconds == pytest.approx(2.0 * short.seconds, rel=0.01)
    for beginning in (short, long):  # whole chunks, until the moment is over
        assert DURATION <= beginning.spent < DURATION + per_step * STEPS_PER_CHUNK
    begun('process.time="8 ms"', duration=1e-9)
    assert made == [STEPS_PER_CHUNK]  # one at least
    instant = begun('process.time="0.05 ms"', "process.frames=2")
    assert instant.spent == pytest.approx(instant.seconds)  # made to its end


def test_a_requirement_far_beyond_the_scene_is_told_before_anything_long_is_run(dent, tmp_path):
    told = []
    known = Known(
        dent, tmp_path, read_requirement("0.01 deg shear", None), 1.0, 0.5, announce=told.append
    )
    with pytest.raises(
        InputError, match=r'edges of .* minutes; allow them with --budget "\d+ min"'
    ):
        known.run(known.make)
    assert (known.runs, told) == ([], [])
    assert len({edge for edge, _ in known.pilots}) == 3  # an order, and no finer ones for nothing
    known = Known(
        dent, tmp_path, read_requirement("1 deg shear", None), 1.0, 0.5, announce=told.append
    )
    known.run(known.make)
    assert len(told) == len(known.runs)
    assert all("Running edges of" in text and "s of solver time" in text for text in told)


def test_a_longer_process_is_chosen_where_inertia_would_take_the_requirement(dent, tmp_path):
    requirement = read_requirement("1 deg shear", None)
    steady = Known(dent, tmp_path, requirement, 1.0, 0.3, of_speed=math.radians(0.2))
    assert steady.run(steady.make).settings.time == 1.0
    fast = Known(dent, tmp_path, requirement, 1.0, 0.3, of_speed=math.radians(0.9))
    choice = fast.run(fast.make)
    assert choice.settings.time > 1.0
    assert {settings for _, settings, _ in fast.runs} == {choice.settings}
    assert fast.true_error() <= math.radians(1.0)


def test_a_laid_net_is_chosen_where_it_is_near_enough(dent, tmp_path):
    class WithNet(Known):
        off = 0.0

        def _pilot(self, edge, settings):
            if settings.model != "kinematic":
                return super()._pilot(edge, settings)
            like = self.outcome(edge, AS_IT_IS)
            values = {"shear_angle": like.values["shear_angle"] + self.off}
            return Outcome(1e-3, 1, like.reference, like.formed, like.faces, values)

    requirement = read_requirement("2 deg shear", None)
    near = WithNet(dent, tmp_path, requirement, 1.0, 0.05)
    near.off = math.radians(0.5)
    choice = near.run(near.make)
    assert choice.settings.model == "kinematic"
    assert near.scene_of(choice).element.type == "kinematic"
    assert 0.5 <= math.degrees(choice.found["shear_angle"]) <= 2.0
    far = WithNet(dent, tmp_path, requirement, 1.0, 0.05)
    far.off = math.radians(1.95)
    assert far.run(far.make).settings.model == ""
    # a requirement that it cannot answer, and a rung that was asked for
    assert "kinematic" not in cheaper_rungs(dent.scene(), {"punch_force": 0.1})
    fixed = WithNet(
        type(dent)(dent.text, dent.path, (), "solid-shell"), tmp_path, requirement, 1.0, 0.05
    )
    assert fixed.run(fixed.make).settings.model == ""


@pytest.mark.parametrize(("within", "budget"), [("0.5 deg shear", None), (None, "2 s")])
def test_a_scene_whose_net_is_laid_has_no_steps_to_choose(dent, tmp_path, within, budget):
    laid = type(dent)(dent.text, dent.path, (), "kinematic")
    chooser = Chooser(laid, tmp_path, read_requirement(within, budget), threads=1)
    lay = chooser.study.outcome

    def laid_in_known_time(variant, progress=None):  # as long on any machine
        return replace(lay(variant, progress), seconds=SECONDS * (4e-3 / variant.value) ** 3)

    chooser.study.outcome = laid_in_known_time
    choice = chooser.run(lambda choice: chooser.study.outcome(chooser.variant_of(choice)))
    assert choice.settings == AS_IT_IS
    assert choice.kept
    assert chooser.beginnings == {}
    assert "process time" not in choice.why
    if within:
        assert 0.0 < choice.found["shear_angle"] <= math.radians(0.5)
    else:
        assert choice.edge_length < chooser.levels[0].edge


def test_no_mesh_is_chosen_that_memory_does_not_hold(dent, tmp_path, monkeypatch):
    """A budget that allows millions of elements took all memory of a machine."""
    elements = (0.04 / 1.5e-3) ** 2
    monkeypatch.setattr(large_mesh, "physical_memory", lambda: 2 * elements * BUILDING_BYTES)
    for requirement in (
        read_requirement(None, "100000 s"),
        read_requirement("0.05 deg shear", "100000 s"),
    ):
        known = Known(dent, tmp_path, requirement, 1.0, 0.5)
        choice = known.run(known.make)
        assert choice.edge_length == pytest.approx(1.5e-3)
        assert "do not fit into the memory of this machine" in choice.why


def test_what_does_not_converge_is_told_and_no_mesh_is_spent_on_it(dent, tmp_path):
    class Restless(Known):
        def outcome(self, edge, settings):
            made = super().outcome(edge, settings)
            wave = 0.02 * math.sin(5.0 * math.log2(0.04 / edge))
            made.values["thickness"] = 1e-3 * (1.0 + wave * np.ones(len(made.faces)))
            return made

    known = Restless(dent, tmp_path, read_requirement("1 deg shear, 1 % thickness", None), 1.0, 0.3)
    choice = known.run(known.make)
    assert not choice.kept
    assert any("thickness changes by" in note for note in choice.notes)
    # the mesh is that of the shear angle
    alone = Known(dent, tmp_path, read_requirement("1 deg shear", None), 1.0, 0.3)
    assert choice.edge_length > 0.95 * alone.run(alone.make).edge_length


def test_settings_add_nothing_to_what_no_mesh_can_keep(dent, tmp_path):
    """Added mass within the requirement is not taken where the mesh alone misses it for good."""

    class Restless(Known):
        restless = True

        def outcome(self, edge, settings):
            made = super().outcome(edge, settings)
            if self.restless:
                wave = math.radians(8.0) * math.sin(5.0 * math.log2(0.04 / edge))
                made.values["shear_angle"] = made.values["shear_angle"] + wave
            return made

    requirement, of_speed = read_requirement("2 deg shear", None), math.radians(0.3)
    fine = type(dent)(dent.text, dent.path, ('blank.edge_length="1.5 mm"',), None)
    restless = Restless(fine, tmp_path, requirement, 1.0, 0.01, of_speed=of_speed)
    choice = restless.run(restless.make)
    assert not choice.kept
    assert any("shear angle changes by" in note for note in choice.notes)
    assert choice.settings == AS_IT_IS
    assert choice.edge_length == 1.5e-3
    assert "the scene's" in choice.why
    calm = Restless(fine, tmp_path, requirement, 1.0, 0.01, of_speed=of_speed)
    calm.restless = False
    assert calm.run(calm.make).settings.mass > 1.0


def test_requirements_are_read_with_their_units():
    requirement = read_requirement("1 deg shear, 1.5 % thickness, 3% force, 0.5 mm contour", "20 s")
    assert requirement.errors == pytest.approx(
        {"shear_angle": math.radians(1.0), "thickness": 0.015, "punch_force": 0.03,
         "contour": 0.5e-3}
    )  # fmt: skip
    assert requirement.budget == 20.0
    assert read_requirement("0.02 rad shear angle", None).errors["shear_angle"] == 0.02
    assert read_requirement("2 % v_f", "1 min").budget == 60.0
    assert "1.5 % thickness" in requirement.in_words()


@pytest.mark.parametrize(
    ("within", "budget", "told"),
    [
        ("1 deg", None, "what it is of"),
        ("shear", None, "what it is of"),
        ("1 deg colour", None, '"colour" is no quantity'),
        ("1 % shear", None, "give it in °"),
        ("1 mm thickness", None, "give it in %"),
        ("1 mm shear", None, "--within"),
        ("0 deg shear", None, "no error at all"),
        (". % force", None, "what it is of"),
        ("1..2 % force", None, "what it is of"),
        ("1e400 % force", None, "any error"),
        ("1e400 mm contour", None, "--within"),
        ("1 deg shear, 2 deg shear angle", None, "twice"),
        (None, "20", "--budget"),
        (None, "20 mm", "--budget"),
        (None, "0 s", "positive"),
    ],
)
def test_a_requirement_that_makes_no_sense_is_told(within, budget, told):
    with pytest.raises(InputError, match=told):
        read_requirement(within, budget)


def test_a_run_from_the_command_line_says_what_was_chosen(dent, tmp_path):
    out = tmp_path / "out"
    quiet = ["--set", "output.pictures=false", "--set", "output.report=false", "--quiet"]
    done = CliRunner().invoke(
        app, ["run", dent.path, "--within", "9 deg shear", "--out", str(out), *quiet],
        catch_exceptions=False,
    )  # fmt: skip
    assert done.exit_code == 0
    summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    choice = summary["choice"]
    assert choice["kept"]
    assert choice["found"]["shear_angle"] <= math.radians(9.0)
    assert choice["seconds"] > choice["pilot_seconds"] > 0.0
    assert summary["element_count"] == pytest.approx((0.04 / choice["edge_length"]) ** 2, rel=0.1)
    assert (out / "forming.nc").exists()
    with pytest.raises(InputError, match="--resume"):
        CliRunner().invoke(
            app, ["run", dent.path, "--budget", "9 s", "--resume", "--out", str(out)],
            catch_exceptions=False,
        )  # fmt: skip
