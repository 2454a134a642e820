"""The hemisphere without a blank holder: wrinkles, and the published compaction strain."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lcmchain import read_scene
from lcmchain.errors import SimulationError
from lcmchain.fields import read_forming, sheet_positions
from lcmchain.pipeline import run
from lcmchain.verification.hemisphere import mirror_difference

SCENE = Path(__file__).parents[2] / "examples" / "hemisphere_free" / "scene.toml"
NO_FILES = ["output.pictures=false", "output.vtu=false"]

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    return run(read_scene(SCENE, NO_FILES), tmp_path_factory.mktemp("free"))


def height_on_circle(sheet, radius: float) -> np.ndarray:
    """Return heights [m] of the formed sheet on a circle about the axis, every 2 degrees."""
    from scipy.interpolate import LinearNDInterpolator

    formed = sheet_positions(sheet)
    angle = np.radians(np.arange(0.0, 360.0, 2.0))
    interpolate = LinearNDInterpolator(formed[:, :2], formed[:, 2])
    return interpolate(radius * np.cos(angle), radius * np.sin(angle))


def test_runs_to_full_stroke_without_inverted_elements(result):
    # that it snaps is told, and folds over the die fillet, nothing else
    for warning in result.summary["warnings"]:
        assert "the sheet snaps" in warning or "elements per wavelength" in warning
    assert result.summary["thickness_min_m"] > 0.8e-3
    assert result.summary["balance_error_max"] < 0.01
    history = result.datasets["/history"]
    assert float(history["tool_travel"].values[-1].max()) == pytest.approx(0.075, abs=1e-12)


def test_flange_wrinkles_out_of_plane(result):
    """Fig. 8c: waves around the dome, higher than ten thicknesses, between crests that lie low."""
    heights = height_on_circle(result.datasets["/"], 0.095)
    assert np.nanmax(heights) - np.nanmin(heights) > 0.010
    wave = heights - np.nanmean(heights)
    crossings = np.count_nonzero(np.diff(np.sign(wave)))
    assert crossings >= 8  # at least four waves


def test_wrinkles_keep_the_mirror_symmetry(result):
    for axis in (0, 1):
        assert mirror_difference(result.datasets["/"], axis)["contour"] < 0.5e-3


def test_thinning_is_slight_and_concentrated(result):
    """Fig. 8b: no thinning along the whole radius, slight thinning where the sheet wrinkles."""
    ratio = result.datasets["/"]["thickness"].values[-1] / 1.004e-3
    assert ratio.min() > 0.85
    assert np.mean(ratio < 0.95) < 0.15


def test_published_compaction_is_stopped_with_the_explanation(tmp_path):
    scene = read_scene(SCENE, [*NO_FILES, 'element.compaction_strain="director"'])
    with pytest.raises(SimulationError, match="director.*tilts.*normal"):
        run(scene, tmp_path)
    frames = read_forming(tmp_path / "forming.nc")
    assert frames.sizes["time"] > 5
