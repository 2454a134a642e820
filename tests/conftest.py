"""Settings shared by all tests: installed package, no display, reproducible examples."""

import functools
import json
import os
import subprocess
import sys
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from hypothesis import settings

os.environ.setdefault("MPLBACKEND", "Agg")

settings.register_profile("lcmchain", derandomize=True, deadline=None, database=None)
settings.load_profile("lcmchain")


@pytest.fixture(scope="session", autouse=True)
def coarse_pictures():
    """Draw with few pixels, which is half of the time of a short run that draws everything.

    Pictures are the same in inches; the command in a process of its own draws as ever. Returns the
    pixels per inch that they else have.
    """
    from lcmchain.report import style

    with pytest.MonkeyPatch.context() as patch:
        fine = style.DPI
        patch.setattr(style, "DPI", 60)
        yield fine


@pytest.fixture(scope="session", autouse=True)
def compiled_by_two():
    """Let runs in this process compile alone: the workers of the tests have the cores already.

    A second process takes two seconds to begin. Commands in processes of their own start it as
    ever. Returns a context in which runs of this process do so too.
    """
    from lcmchain.solver import compile_beside

    cores = compile_beside._cores

    @contextmanager
    def by_two():
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(compile_beside, "_cores", cores)
            yield

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(compile_beside, "_cores", lambda: 1)
        yield by_two


@pytest.fixture(scope="session", autouse=True)
def commands_built_once():
    """Build what parses the command line once: typer does so in each call, in a tenth of a second.

    Commands in processes of their own build theirs as ever.
    """
    import typer.main
    import typer.testing

    build = functools.cache(typer.main.get_command)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(typer.main, "get_command", build)
        patch.setattr(typer.testing, "_get_command", build)
        yield


@pytest.fixture
def fine_pictures(coarse_pictures, monkeypatch):
    """Draw as the program does, for tests that look at pixels."""
    monkeypatch.setattr("lcmchain.report.style.DPI", coarse_pictures)


@pytest.fixture(scope="session")
def manual_table():
    """Rows of all tables on a page of the manual, as lists of cells."""
    import re

    from lcmchain.manual.contents import read_page

    def rows(topic: str) -> list[list[str]]:
        lines = [line for line in read_page(topic).text.splitlines() if line.startswith("| ")]
        cells = [re.split(r"(?<!\\)\|", line.strip()[1:-1]) for line in lines]
        return [[cell.strip().replace("\\|", "|") for cell in row] for row in cells]

    return rows


@pytest.fixture(scope="session")
def references():
    """Count who holds the arrays that the loop of a simulation takes: none more after a step.

    The loop hands them on without counting references.
    """

    def arrays_in(values):
        if isinstance(values, np.ndarray):
            yield values
        elif isinstance(values, tuple):
            for value in values:
                yield from arrays_in(value)

    def count(simulation):
        model = simulation.model
        placed = tuple(body.data for body in model.placed)
        arrays = list(arrays_in((simulation.arrays.referent, model.interactions, placed)))
        assert len(arrays) > 50
        return [sys.getrefcount(array) for array in arrays]

    return count


@pytest.fixture(scope="session")
def placed_by_hand():
    """Make the groups of a result whose plies lie flat, then where they are put.

    Nothing is compiled or formed. ``put`` takes the undeformed mesh of a ply and returns the last
    positions of its nodes; ``thinning`` is the last thickness over the first.
    """

    def make(scene, put, thinning=1.0):
        from lcmchain.fields import FrameSeries
        from lcmchain.fields.dataset import LaidSheet, SheetFrames, sheets_datasets
        from lcmchain.mesh.mid_surface import MidSurfaceMesh

        sheets, positions = {}, []
        for ply in scene.stack:
            mesh, material = MidSurfaceMesh.of_blank(ply.build_blank()), ply.built_material()
            both = np.stack([mesh.node_positions, put(mesh)])
            thickness = np.full((2, mesh.element_count), material.thickness)
            thickness[1] *= thinning
            given = {"thickness": thickness}
            if material.fibre_density is not None:
                fraction = material.areal_mass / (material.fibre_density * thickness)
                given["fibre_volume_fraction"] = fraction
            none = np.empty((2, 0, mesh.element_count))
            sheets[ply.name] = SheetFrames(
                LaidSheet(mesh, material), both, none, given, None, None, np.nan
            )
            positions.append(both)
        frames = FrameSeries(
            time=np.array([0.0, scene.process.time]),
            positions=np.concatenate(positions, axis=1),
            tool_travel=np.zeros((2, 0)),
            tool_force=np.zeros((2, 0, 3)),
        )
        return sheets_datasets(scene, sheets, frames)

    return make


@pytest.fixture
def in_new_process(tmp_path):
    """Run code in a process of its own, in ``tmp_path``, whose modules it finds.

    All processes of a test share one cache of compiled code. Returns what the code prints as JSON.
    """
    environment = os.environ | {
        "NUMBA_CACHE_DIR": str(tmp_path / "cache"),
        "PYTHONPATH": os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")]),
        "PYTHONDONTWRITEBYTECODE": "1",
    }
    environment.pop("LCMCHAIN_CHOSEN_CACHE_DIR", None)

    def call(code):
        done = subprocess.run(
            [sys.executable, "-c", code],
            capture_output=True, text=True, env=environment, cwd=tmp_path, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)

    return call


# Files with the most work, of compiler and solver, first: two workers then end at about the same
# time. A file stays with one worker, which keeps what its fixtures have computed and compiled.
# The first goes to one worker, the second to the other one, the third again to the first: those of
# the two workers share no loops, which both would compile at the same time.
FOLDER = Path(__file__).parent
LONG_FILES = (
    "verification/test_restart.py",
    "elements/test_frequency_bound.py",
    "stability/test_hard_cases.py",
    "elements/test_kernel.py",
    "interfaces/test_closed_forms.py",
    "unit/test_bodies.py",
    "faults/test_faults.py",
    "effects/test_contract.py",
    "verification/test_hemisphere_holder.py",
    "fmu/test_wet_stack.py",
    "fmu/test_stack.py",
    "stages/test_interfaces.py",
    "interfaces/test_fields.py",
    "fmu/test_conduct.py",
)


def pytest_collection_modifyitems(items):
    rank = {FOLDER / part: i for i, part in enumerate(LONG_FILES)}
    items.sort(key=lambda item: rank.get(item.path, len(rank)))


def pytest_configure(config):
    # A checkout on sys.path has the folder lcmchain/ but not the packages beside it.
    if find_spec("lcmchain.mapping") is None:
        raise pytest.UsageError(
            "lcmchain is not installed in this environment; run `pip install -e '.[test]'`"
        )
