"""Packages whose names are imported when they are asked for: every name, whatever came before."""

from __future__ import annotations

import subprocess
import sys

import pytest

PACKAGES = ("check", "draping", "fields", "mapping", "report")


@pytest.mark.parametrize("name", PACKAGES)
def test_every_name_of_a_stub_is_there(name):
    program = (
        "import importlib, types\n"
        f"package = importlib.import_module('lcmchain.{name}')\n"
        "assert len(package.__all__) > 1\n"
        "for name in package.__all__:\n"
        "    assert not isinstance(getattr(package, name), types.ModuleType), name\n"
    )
    subprocess.run([sys.executable, "-c", program], check=True)


@pytest.mark.parametrize("function", ["draping.drape", "mapping.transfer"])
def test_a_function_is_not_hidden_by_the_module_of_its_name(function):
    package, _, name = function.rpartition(".")
    program = (
        f"import lcmchain.{package}.{name}\n"
        f"from lcmchain.{package} import {name}\n"
        f"assert callable({name}) and callable(lcmchain.{package}.{name})\n"
    )
    subprocess.run([sys.executable, "-c", program], check=True)
