"""The scripts of ``examples/scripts`` run to their end; each checks its own result."""

from __future__ import annotations

import runpy

import pytest

OWN_KERNELS = ["own_law", "own_interface", "stack"]  # compiled by nobody else
NAMES = ["form", "read_results", "plot", "map", "fill", "unit", "study"]


@pytest.mark.parametrize(
    "name", NAMES + [pytest.param(name, marks=pytest.mark.slow) for name in OWN_KERNELS]
)
def test_a_script_finds_what_it_should(name, request, tmp_path, monkeypatch):
    script = request.config.rootpath / "examples" / "scripts" / f"{name}.py"
    monkeypatch.setattr("sys.argv", [str(script), str(tmp_path)])
    runpy.run_path(str(script), run_name="__main__")


def test_every_script_is_run_and_listed(request):
    folder = request.config.rootpath / "examples" / "scripts"
    names = {file.stem for file in folder.glob("*.py")}
    assert names == {*NAMES, *OWN_KERNELS}
    page = (folder / "README.md").read_text(encoding="utf-8")
    assert all(f"`{name}.py`" in page for name in names)
