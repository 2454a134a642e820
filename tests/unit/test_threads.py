"""How many threads the compiled loops take, and that they are there before a loop needs them."""

import os
import subprocess
import sys

import pytest

from lcmchain.compilation import threads
from lcmchain.pipeline import run
from lcmchain.scene import scene_from_text

SQUARE = """
process = { time = "0.1 ms", frames = 2 }
blank = { size = ["100 mm", "100 mm"], edge_length = "5 mm", height = "0.5 mm" }
material = { preset = "MD600" }
output = { pictures = false }

[[tools]]
name = "floor"
shape = { type = "plate", side = "below" }
position = "0 0 -1 mm"
"""


@pytest.fixture
def four_cores(monkeypatch):
    """A machine of four cores; returns the numbers of threads that numba is told."""
    told = []
    monkeypatch.setattr(threads, "available_threads", lambda: 4)
    monkeypatch.setattr("numba.set_num_threads", told.append)
    return told


@pytest.mark.parametrize(
    ("wanted", "elements", "used"),
    [(None, 100, 1), (0, 100, 1), (None, 1400, 2), (None, 10**6, 4), (None, None, 4), (0, None, 4),
     (3, 100, 3), (9, 100, 4)],
)  # fmt: skip
def test_a_small_mesh_takes_fewer_threads_unless_told_else(four_cores, wanted, elements, used):
    assert threads.use_threads(wanted, elements) == used
    assert four_cores == [used]


def test_a_run_takes_as_many_threads_as_its_mesh_is_worth(tmp_path):
    small = scene_from_text(SQUARE)
    assert run(small, tmp_path / "small").summary["threads"] == 1
    told = run(small, tmp_path / "told", threads=threads.available_threads())
    assert told.summary["threads"] == told.summary["provenance"]["threads"]
    assert told.summary["threads"] == threads.available_threads()
    large = scene_from_text(SQUARE, overrides=["blank.edge_length=2.5 mm"])
    most = min(2, threads.available_threads())  # of 1,600 elements
    assert run(large, tmp_path / "large").summary["threads"] == most


LOOPS = """
import numpy as np
from numba import prange
from lcmchain.jit import entry, kernel

@kernel
def doubled(values):
    out = np.empty_like(values)
    for i in prange(len(values)):
        out[i] = 2.0 * values[i]
    return out

@entry
def through_serial_code(values):
    return doubled(values).sum()
"""


def test_a_serial_function_that_holds_a_parallel_loop_can_be_the_first_one_read_from_disk(tmp_path):
    """The order of processes that ended the third one by a segmentation fault."""
    (tmp_path / "loops.py").write_text(LOOPS)
    environment = os.environ | {
        "NUMBA_CACHE_DIR": str(tmp_path / "cache"),
        "PYTHONPATH": os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")]),
    }
    environment.pop("LCMCHAIN_CHOSEN_CACHE_DIR", None)

    def called(function):
        code = f"import loops, numpy; print(numpy.sum(loops.{function}(numpy.ones(10))))"
        return subprocess.run(
            [sys.executable, "-c", code], cwd=tmp_path, env=environment, text=True,
            capture_output=True, timeout=300,
        )  # fmt: skip

    for function in ("doubled", "through_serial_code", "through_serial_code"):
        found = called(function)
        assert found.returncode == 0, f"{function}: signal {-found.returncode} {found.stderr}"
        assert float(found.stdout) == 20.0


def test_a_library_that_pip_put_elsewhere_is_found(tmp_path, monkeypatch):
    record = tmp_path / "sheets-1.0.dist-info"
    record.mkdir()
    (record / "METADATA").write_text("Metadata-Version: 2.1\nName: sheets\nVersion: 1.0\n")
    (record / "RECORD").write_text("sheets/__init__.py,,\nlib/libsheets.so.1,,\n")
    (tmp_path / "lib").mkdir()
    (tmp_path / "lib" / "libsheets.so.1").touch()
    monkeypatch.syspath_prepend(tmp_path)
    found = threads._file_of_package("sheets", "libsheets.so.1")
    assert found == tmp_path / "lib" / "libsheets.so.1"
    assert threads._file_of_package("sheets", "other.so") is None
    assert threads._file_of_package("no such package", "libsheets.so.1") is None
