"""Packages whose names are imported when they are asked for: every name, whatever came before."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

PACKAGES = ("check", "draping", "fields", "mapping", "report")


def imported_as_installed(program: str, folder: Path) -> None:
    """Run a program in a folder without sources, which would hide the installed packages."""
    subprocess.run([sys.executable, "-c", program], check=True, cwd=folder)


@pytest.mark.parametrize("name", PACKAGES)
def test_every_name_of_a_stub_is_there(name, tmp_path):
    program = (
        "import importlib, types\n"
        f"package = importlib.import_module('lcmchain.{name}')\n"
        "assert len(package.__all__) > 1\n"
        "for name in package.__all__:\n"
        "    assert not isinstance(getattr(package, name), types.ModuleType), name\n"
    )
    imported_as_installed(program, tmp_path)


@pytest.mark.parametrize("function", ["draping.drape", "mapping.transfer"])
def test_a_function_is_not_hidden_by_the_module_of_its_name(function, tmp_path):
    package, _, name = function.rpartition(".")
    program = (
        f"import lcmchain.{package}.{name}\n"
        f"from lcmchain.{package} import {name}\n"
        f"assert callable({name}) and callable(lcmchain.{package}.{name})\n"
    )
    imported_as_installed(program, tmp_path)
