"""The main job, run once per session as a user runs it."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from lcmchain import read_scene
from lcmchain.pipeline import Result, run

# Tests share modules that lie beside them.
sys.path.insert(0, str(Path(__file__).parent))
EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture(scope="session")
def holder_result(tmp_path_factory) -> Result:
    """Result of ``lcmchain run examples/hemisphere_holder/scene.toml``."""
    scene = read_scene(EXAMPLES / "hemisphere_holder" / "scene.toml")
    return run(scene, tmp_path_factory.mktemp("hemisphere_holder"))
