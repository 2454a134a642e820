"""The hemisphere of a unidirectional fabric on a coarse mesh, from scene to report."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lcmchain import cli
from lcmchain.fields import read_forming
from lcmchain.fields.sheet import families_of

SCENE = Path(__file__).parents[2] / "examples" / "hemisphere_unidirectional" / "scene.toml"


@pytest.mark.slow
def test_a_unidirectional_fabric_is_formed_over_a_hemisphere(tmp_path):
    """Fibres over the dome are drawn in, those beside it are not; the diagonals shear in turn."""
    out = tmp_path / "run"
    with pytest.raises(SystemExit) as stop:
        cli.main(
            ["run", str(SCENE), "--out", str(out), "--quiet", "--set", "blank.edge_length=15 mm"]
        )
    assert not stop.value.code
    sheet = read_forming(out / "forming.nc")
    assert families_of(sheet) == (1,)
    assert "fibre_direction_2_x" not in sheet
    x, y = (sheet[f"reference_position_{axis}"].values for axis in "xy")
    moved = sheet["displacement_x"].values[-1]
    right = np.abs(x - x.max()) < 1e-6
    middle, beside = right & (np.abs(y) < 1e-3), right & (np.abs(y) > 0.1)
    assert moved[middle].max() < -0.015
    assert np.abs(moved[beside]).max() < 0.005
    corners = sheet["sheet_face_nodes"].values.astype(int)
    centre = np.stack([x, y], axis=1)[corners].mean(axis=1)
    shear = sheet["shear_angle"].values[-1]
    diagonal = (np.abs(centre) > 0.03).all(axis=1) & (np.abs(centre) < 0.1).all(axis=1)
    turn = np.sign(centre[diagonal].prod(axis=1))
    assert (np.sign(shear[diagonal]) == turn).mean() > 0.95
    assert np.degrees(np.abs(shear).max()) > 20.0
    assert np.abs(sheet["strain_across"].values[-1]).max() > 0.05
