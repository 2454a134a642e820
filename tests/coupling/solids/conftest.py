"""Cells and materials for the solid sides; lets the tests of this folder import what they share."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from lcmchain.coupling.solids.compaction_law import CellCompaction
from lcmchain.scene import scene_from_text

sys.path.insert(0, str(Path(__file__).parent))

MATERIALS = {
    "fabric": 'preset = "MD600"',
    "fabric-with-set": 'law = "fabric-with-set"\npreset = "MD600"\ncompaction.permanent_set = 0.4',
    "isotropic": 'law = "isotropic"\nthickness = "1 mm"\ndensity = "1000 kg/m^3"\n'
    'young_modulus = "1 MPa"\npoisson_ratio = 0.0',
}
SCENE = """
process = { time = "1 ms" }
blank = { size = ["30 mm", "20 mm"], edge_length = "5 mm" }

[material]
"""


@pytest.fixture(scope="session", params=list(MATERIALS))
def law_name(request):
    return request.param


@pytest.fixture(scope="session")
def cells():
    """Maker of the compaction law of so many cells."""

    def make(count=5, name="fabric", **options):
        material = scene_from_text(SCENE + MATERIALS[name] + "\n").material.build()
        return CellCompaction(material, np.full(count, material.thickness), **options)

    return make
