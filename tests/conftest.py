"""Settings shared by all tests: installed package, no display, reproducible examples."""

import os
from importlib.util import find_spec

import pytest
from hypothesis import settings

os.environ.setdefault("MPLBACKEND", "Agg")

settings.register_profile("lcmchain", derandomize=True, deadline=None, database=None)
settings.load_profile("lcmchain")


def pytest_configure(config):
    # A checkout on sys.path has the folder lcmchain/ but not the packages beside it.
    if find_spec("lcmchain.mapping") is None:
        raise pytest.UsageError(
            "lcmchain is not installed in this environment; run `pip install -e '.[test]'`"
        )
