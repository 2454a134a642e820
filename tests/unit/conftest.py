"""Lets the tests of this folder import what they share."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

import dead_loads


@pytest.fixture
def loaded():
    """Give forces on its nodes to a model (``dead_loads.py``), for the time of a test."""
    with dead_loads.kept_apart():
        yield dead_loads.loaded
