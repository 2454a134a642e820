"""The part of ``examples/staged_part`` on a coarse mesh: killed in each stage, and resumed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lcmchain.pipeline import run
from lcmchain.scene import read_scene

EXAMPLE = Path(__file__).parents[2] / "examples" / "staged_part" / "scene.toml"
COARSE = ('blank.edge_length="12 mm"', "output.pictures=false", "output.vtu=false")


class Killed(Exception):
    """What ends a run between two checkpoints."""


@pytest.mark.slow
def test_the_staged_part_killed_in_each_stage_resumes_to_the_same_bits(tmp_path):
    scene = read_scene(EXAMPLE, COARSE)
    plain = run(scene, tmp_path / "plain", threads=1)
    left = [f"forming, {stage.name}" for stage in scene.stages]

    def kill(time, total, text):
        # two thirds through a stage, with a checkpoint behind it
        name = text.partition(", step")[0]
        if left and name == left[0]:
            plan = plans[len(plans) - len(left)]
            if time > plan.start + 0.6 * plan.time or plan.stage.rest:
                left.pop(0)
                raise Killed

    plans = scene.stage_plans()
    for attempt in range(len(plans)):
        with pytest.raises(Killed):
            run(scene, tmp_path / "killed", threads=1, resume=attempt > 0, progress=kill)
    assert not left
    resumed = run(scene, tmp_path / "killed", threads=1, resume=True)
    for name in ("displacement_x", "displacement_y", "displacement_z"):
        assert np.array_equal(plain.datasets["/"][name], resumed.datasets["/"][name])
    summary = plain.summary
    assert [stage["name"] for stage in summary["stages"]] == [s.name for s in scene.stages]
    assert summary["stages"][-1]["rest"]["reached_s"] is not None
    assert summary["balance_error_max"] < 0.01
    assert 5e-3 < summary["springback_max_m"] < 20e-3
