"""What a coarse hemisphere forecasts of the wrinkles of a finer one: the example, with 5 mm."""

import runpy
from pathlib import Path

import pytest

EXAMPLE = Path(__file__).parents[2] / "examples" / "wrinkle_risk" / "compare.py"


@pytest.mark.slow
def test_a_coarse_run_marks_where_a_fine_one_wrinkles(tmp_path):
    """Without a holder most wrinkles are marked, and what is marked is mostly wrinkled.

    The holder keeps the flange flat: there next to nothing may be marked.
    """
    compared = runpy.run_path(str(EXAMPLE))["compared"]
    free = compared("without a holder", 10.0, 5.0, tmp_path)[""]
    assert free["hits"] > 0.55 and free["false alarms"] < 0.3
    assert free["precision"] > 1.4 * free["wrinkled"]
    held = compared("with a holder", 10.0, 5.0, tmp_path)[""]
    assert held["wrinkled"] == 0.0 and held["marked"] < 0.06
