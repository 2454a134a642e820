"""The example of double-diaphragm forming goes to its end, and stays what the manual tells."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from lcmchain.pipeline import run
from lcmchain.scene import read_scene

EXAMPLE = Path(__file__).parents[2] / "examples" / "double_diaphragm" / "scene.toml"


@pytest.mark.slow
def test_a_fabric_between_two_films_is_drawn_on_a_dome(tmp_path):
    """Symmetric, in balance, with films that thin by the stretch and a fabric that is sheared."""
    run(read_scene(EXAMPLE), tmp_path / "out")
    summary = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    assert summary["balance_error_max"] < 5e-3
    assert summary["energy"]["hourglass"] < 0.01 * summary["energy"]["internal"]
    assert summary["kinetic_to_internal_end"] < 1e-4
    assert summary["stack"]["films"] == ["lower", "upper"]
    assert summary["stack"]["ply_count"] == 1
    plies = summary["plies"]
    # the lower film lies outermost on the dome, the upper one on it by friction
    assert 0.70e-3 < plies["lower"]["thickness_min_m"] < 0.82e-3
    assert plies["lower"]["thickness_max_m"] < 1.01e-3
    assert 0.65 < plies["fabric"]["shear_angle_max_rad"] < 0.78
