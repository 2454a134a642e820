"""The example of a coupling that a user adds runs in a process of its own, as a user's code does.

Kernels for a law outside the package lie in a cache of their own; in this process they would get
into that of all other tests, where nobody knows the law.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

CASES = Path(__file__).with_name("tension_shear_cases.py")


def run_cases(folder: Path, marked: str) -> None:
    """Run the cases that are marked so."""
    options = ("-p", "no:cacheprovider", "-q", "-n", "0", "-m", marked)
    # -P: the package is the installed one, not the folder lcmchain/ where the tests are started.
    done = subprocess.run(
        [sys.executable, "-P", "-m", "pytest", *options, str(CASES)],
        env=os.environ | {"NUMBA_CACHE_DIR": str(folder / "cache"), "PYTEST_ADDOPTS": ""},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_law_of_the_example(tmp_path):
    run_cases(tmp_path, "not slow")


@pytest.mark.slow
def test_the_example_in_the_solver(tmp_path):
    run_cases(tmp_path, "slow")
