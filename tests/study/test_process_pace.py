"""Where the process time is part of the physics, no study stretches it."""

import pytest

from lcmchain.study import accuracy as accuracy_module
from lcmchain.study import read_source
from lcmchain.study.accuracy import TIME, ladder
from lcmchain.study.accuracy_files import markdown, write_page
from lcmchain.study.step_settings import StepSettings, inertia_trials, slower, why_time_stays

from .test_comparison import sheet

FIXED_DIE = 'tools.punch.motion={type = "fixed"}'
TABLE = (
    'tools.punch.motion={type = "table", direction = [0, 0, -1], times = "0 4 ms", '
    'travel = "0 2 mm"}'
)
GUIDED = 'tools.die.motion={type = "guided", direction = [0, 0, 1], mass = "1 kg", force = "30 N"}'
PRESSURE = 'pressure=[{name = "bag", face = "top", value = "1 kPa"%s}]'


@pytest.mark.parametrize(
    ("overrides", "told"),
    [
        ((), ""),
        (("process.gravity=true",), ""),  # the punch sets the pace
        (('tools.punch.motion.end="3 ms"',), "tools.punch.motion.end"),
        (('tools.punch.motion.start="1 ms"',), "tools.punch.motion.start"),
        ((TABLE,), "tools.punch.motion has times"),
        ((GUIDED,), ""),  # as a holder: the punch sets the pace
        ((GUIDED, FIXED_DIE), "weight and forces"),
        ((FIXED_DIE,), "weight and forces"),
        ((FIXED_DIE, "process.gravity=true"), "weight and forces"),
        ((PRESSURE % "",), ""),  # comes on over a part of the process time
        ((PRESSURE % ', ramp = "1 ms"',), "pressure.bag.ramp"),
        ((FIXED_DIE, PRESSURE % ""), "weight and forces"),
    ],
)
def test_the_process_time_stays_where_it_is_part_of_the_physics(dent, overrides, told):
    scene = dent.scene(overrides)
    if not told:
        assert why_time_stays(scene) == ""
        return
    assert told in why_time_stays(scene)
    assert slower(scene) == []
    assert all(trial.time == 1.0 for trial in inertia_trials(scene))


def test_a_scene_with_mass_of_its_own_is_hurried_only_where_time_is_free(dent):
    added = "process.mass_scaling={factor = 4}"
    assert inertia_trials(dent.scene((added,))) == [StepSettings(time=0.5)]
    assert inertia_trials(dent.scene((added, 'tools.punch.motion.end="3 ms"'))) == []


def test_the_clamps_of_a_coupon_go_with_the_process_time():
    assert why_time_stays(read_source("bias-extension").scene()) == ""


def test_the_ladder_of_a_stroke_with_an_end_of_its_own_can_be_run(dent):
    ended = type(dent)(dent.text, dent.path, ('tools.punch.motion.end="3 ms"',))
    variants = ladder(ended)
    scenes = [ended.job(variant).scene for variant in variants]
    assert {scene.process.time for scene in scenes} == {ended.scene().process.time}
    assert TIME not in {variant.axis for variant in variants}
    edges = [scene.blank.edge_length for scene in scenes]
    assert edges[-1] == min(edges)
    assert edges.count(edges[-1]) == 1
    assert len({variant.name for variant in variants}) == len(variants)


def test_a_study_of_accuracy_says_why_the_process_time_stays(dent, tmp_path, monkeypatch):
    class Known(accuracy_module.Study):
        def outcomes(self, variants, progress=None):
            made = sheet(6, lambda x, y: 0.1 + x + 0.0 * y)
            return {v.name: made for v in variants}

    monkeypatch.setattr(accuracy_module, "Study", Known)
    ended = type(dent)(dent.text, dent.path, ('tools.punch.motion.end="3 ms"',))
    study = accuracy_module.study_accuracy(ended, tmp_path)
    assert "since tools.punch.motion.end is a time of its own" in study.notes[0]
    assert study.notes[0] in markdown(study)
    chart = tmp_path / "chart.png"
    chart.write_bytes(b"")
    write_page(tmp_path / "report.html", study, chart)
    assert study.notes[0] in (tmp_path / "report.html").read_text(encoding="utf-8")
    assert accuracy_module.study_accuracy(dent, tmp_path).notes == ()


# --- where the time is found ----------------------------------------------------------------------


@pytest.fixture
def without_time(dent, tmp_path):
    """The dented sheet, whose process has no time."""
    text = dent.scene().source.text
    line = next(line for line in text.splitlines() if line.startswith("process"))
    path = tmp_path / "scene.toml"
    path.write_text(text.replace(line, "process = { frames = 3 }"), encoding="utf-8")
    return read_source(path)


def test_a_process_whose_time_is_found_is_slowed_by_one_entry(without_time):
    """More mass alone takes longer by its root, and as many steps: no study tries it."""
    scene = without_time.scene()
    assert scene.time_is_found
    fast, slow = inertia_trials(scene)[0], slower(scene)[-1]
    assert (fast.mass, fast.time, slow.time) == (1.0, 0.25, 4.0)
    for settings in (fast, slow):
        (entry,) = settings.overrides(scene)
        changed = without_time.scene((entry,))
        assert changed.process.time == pytest.approx(settings.time * scene.process.time)
    both = StepSettings(mass=4.0, fibres=0.5).overrides(scene)
    assert both == ("process.quasi_static=0.5", "process.fibre_modulus_factor=0.5")


def test_the_ladder_of_a_process_whose_time_is_found_has_no_mass(without_time):
    variants = ladder(without_time)
    assert not any("mass_scaling" in entry for v in variants for entry in v.overrides)
    times = {v.name: without_time.scene(v.overrides) for v in variants if v.axis == TIME}
    own = without_time.scene().process.time
    assert {round(s.process.time / own, 6) for s in times.values()} >= {0.5, 2.0}
    assert all(s.time_is_found for s in times.values())
