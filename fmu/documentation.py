"""The documentation inside a unit: what it is, its variables, and what it needs."""

from __future__ import annotations

import sys
from html import escape

from lcmchain import __version__
from lcmchain.fmu.part import UnitDefinition
from lcmchain.fmu.variables import Variable

_STYLE = (
    "body{font-family:sans-serif;max-width:60em;margin:2em auto}"
    "table{border-collapse:collapse}td,th{border:1px solid #ccc;padding:.2em .5em;text-align:left}"
)


def documentation(definition: UnitDefinition, exporter: str, version: str) -> dict[str, bytes]:
    """Return the files of the folder ``documentation`` by their places in the unit."""
    dependencies = _dependencies(exporter, version)
    return {
        "documentation/index.html": _index(definition).encode(),
        "documentation/externalDependencies.txt": dependencies.encode(),
    }


def _index(definition: UnitDefinition) -> str:
    rows = "\n".join(_row(variable) for variable in definition.variables)
    title = escape(definition.title)
    return f"""<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>{title}</title><style>{_STYLE}</style></head>
<body><h1>{title}</h1>
<p>A unit of lcmchain {escape(__version__)} for co-simulation, {definition.stop_time:g} s long.
It computes in the Python of the importing process; see
<a href="externalDependencies.txt">what it needs</a>.</p>
<p>Inputs are held over a communication step, outputs are those of the last communication point.
A step that cannot be done is undone and discarded with a message; so is the step after a call that
was refused. The master may then change inputs and try again, restore a state, or terminate.</p>
<table><tr><th>variable</th><th>kind</th><th>unit</th><th>values</th><th>meaning</th></tr>
{rows}
</table></body></html>
"""


def _row(variable: Variable) -> str:
    kind = variable.causality if variable.variability != "constant" else "constant"
    cells = (
        variable.name, kind, variable.unit or "", str(variable.count), variable.description,
    )  # fmt: skip
    return "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in cells) + "</tr>"


def _dependencies(exporter: str, version: str) -> str:
    python = f"{sys.version_info.major}.{sys.version_info.minor}"
    return f"""This unit computes in the Python of the importing process.

Python    3.11 or later (built with {python})
Packages  lcmchain {__version__} and what it depends on, {exporter} {version} among it
Systems   Linux and Windows on x86-64

A program that is no Python must be given Python's shared library and be started from the activated
environment that has lcmchain. On Linux:

  LD_PRELOAD=$(python -c "import sysconfig as s; print(s.get_config_var('LIBDIR') + '/' \\
      + s.get_config_var('INSTSONAME'))") master ...
"""
