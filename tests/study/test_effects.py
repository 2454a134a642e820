"""Effects switched over one at a time: what changes, and that nothing else does."""

import csv
import math

import pytest
from rich.console import Console

from lcmchain.check.effect_cost import EffectCost
from lcmchain.effects.switches import switchable_effects
from lcmchain.errors import InputError
from lcmchain.study import effects as effects_module
from lcmchain.study import read_source
from lcmchain.study import sources as sources_module
from lcmchain.study.effects import effects_table, study_effects, write_effects


@pytest.fixture
def two_effects(monkeypatch):
    """Study damping and gravity alone, whose kernels are compiled already, with a known cost."""
    recorded = {}

    def two(scene):
        return [e for e in switchable_effects(scene) if e.name in ("damping", "gravity")]

    def cost(scene):
        return [EffectCost(e, 2e-8, 1e-8) for e in two(scene) if e.name == "damping"]

    monkeypatch.setattr(effects_module, "switchable_effects", two)
    monkeypatch.setattr(sources_module, "measure_effects", cost)
    monkeypatch.setattr(
        sources_module, "record_effect_parts", lambda model, parts: recorded.update(parts)
    )
    return recorded


def test_each_effect_is_switched_over_alone(dent, tmp_path, two_effects):
    coarse = type(dent)(dent.text, dent.path, ("blank.edge_length=10 mm",))
    study = study_effects(coarse, tmp_path)
    found = {change.effect.name: change for change in study.changes}
    assert set(found) == {"damping", "gravity"}
    assert (found["damping"].effect.state, found["gravity"].effect.state) == ("on", "off")
    assert two_effects == {"damping": 0.5}
    assert found["damping"].part == 0.5
    assert math.isnan(found["gravity"].part)
    for change in study.changes:
        assert change.failure == ""
        assert 0.0 < change.changes["forming_work"].typical < 1.0
        assert 0.9 < change.steps < 1.1
    # without damping less work is put in: more of it is changed than by a weight of a gram
    assert (
        found["damping"].changes["forming_work"].typical
        > found["gravity"].changes["forming_work"].typical
    )
    write_effects(tmp_path / "effects.csv", study)
    with open(tmp_path / "effects.csv", encoding="utf-8") as file:
        rows = {row["effect"]: row for row in csv.DictReader(file)}
    assert rows["damping"]["scene_has_it"] == "on"
    assert float(rows["damping"]["part_of_step"]) == 0.5
    console = Console(width=80, record=True)
    console.print(effects_table(study))
    text = console.export_text()
    assert "damping" in text
    assert "50%" in text
    assert "…" not in text


def test_a_scene_that_fails_as_it_is_says_so(dent, tmp_path, two_effects):
    coarse = type(dent)(dent.text, dent.path, ("blank.edge_length=30 mm",))
    with pytest.raises(InputError, match="the scene itself fails"):
        study_effects(coarse, tmp_path)


def test_effects_of_a_coupon_are_told_without_their_part_of_a_step(tmp_path, two_effects):
    small = ("blank.size=['80 mm', '40 mm']", "blank.edge_length=10 mm", "process.time=20 ms",
             "coupon.displacement=6 mm")  # fmt: skip
    study = study_effects(read_source("bias_extension", small), tmp_path)
    found = {change.effect.name: change for change in study.changes}
    assert found["damping"].changes["clamp_force"].typical > 0.0
    assert all(math.isnan(change.part) for change in study.changes)
    assert two_effects == {}
