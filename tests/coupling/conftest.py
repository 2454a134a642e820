"""What several tests of the coupling share."""

import importlib.util
import sys
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def reference():
    """The independent reference of a filling, which stands beside the tests."""
    path = Path(__file__).parent / "reference" / "hele_shaw.py"
    spec = importlib.util.spec_from_file_location("hele_shaw_reference", path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # its dataclass looks its own module up
    spec.loader.exec_module(module)
    return module
