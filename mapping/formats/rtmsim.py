"""RTMsim: a mesh with up to four sets, and the input file that gives their properties.

Source: RTMsim 1.0.4 (Obertscheider and Fauster, Journal of Open Source Software 8 (2023) 4763),
its page on input parameters.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np

from lcmchain.atomic import replacing
from lcmchain.errors import InputError
from lcmchain.mapping.formats.format import ExportReport, MappedCells, Saver
from lcmchain.mapping.formats.preform import (
    Classes,
    Preform,
    class_table,
    losses_of,
    preform_of,
    write_mesh,
)

NAME = "rtmsim"

# The main preform and four further sets, of which inlets and outlets take one each.
MOST_SETS = 4

# What a set is to RTMsim.
IGNORED, IS_INLET, IS_PREFORM, IS_OUTLET = range(4)

# Numbers of a line of a set.
SET_LINE = 6

# Values of RTMsim's own example; none of them follows from forming.
END_TIME = 200.0
AIR = (1.01325e5, 1.225, 1.4)
VISCOSITY = 0.06
INJECTION_PRESSURE, CAVITY_PRESSURE = 1.35e5, 1.0e5
PORT_RADIUS = 0.01
PICTURES = 16


def prepare(path: Path, cells: MappedCells) -> Saver:
    """Get ready to write the input file ``path`` and, with its stem and ``.bdf``, the mesh.

    Cells are gathered into classes; the largest is the main preform. Sets of the target whose
    names hold "inlet" or "outlet" (or "vent") are written as such, and leave fewer classes.

    Raises
    ------
    InputError : as :func:`~lcmchain.mapping.formats.preform.preform_of`, or the name of the file
        holds a blank, which separates entries.
    """
    if any(letter.isspace() for letter in path.name):
        raise InputError("the name holds a blank, which RTMsim takes for two names", file=path)
    preform = preform_of(cells, NAME, most_classes=MOST_SETS + 1, classes_per_kind_of_port=1)
    return partial(_write, path, preform)


def _write(path: Path, preform: Preform) -> ExportReport:
    mesh = path.with_suffix(".bdf")
    sets = _sets(preform)
    lines = [
        text
        for number, (_, rows) in enumerate(sets, start=1)
        for text in _set_lines(number, preform.triangles.ids[rows])
    ]
    write_mesh(mesh, preform, lines, preform.of_triangle + 1)
    with replacing(path) as temporary:
        temporary.write_text(_input_file(mesh.name, preform, sets), encoding="ascii")
    notes = [
        f"viscosity, pressures and times in {path.name} are those of RTMsim's own example; give "
        "those of the process, and start RTMsim in the folder of the files"
    ]
    if not preform.inlets:
        notes.append(
            'the target has no set with "inlet" in its name: RTMsim asks for the inlet in a window'
        )
    return ExportReport(
        NAME, [path.name, mesh.name], preform.target.cell_count, losses_of(preform), notes,
        {"classes": class_table(preform)},
    )  # fmt: skip


def _sets(preform: Preform) -> list[tuple[int, np.ndarray]]:
    """What each set is, and its triangles: inlets first, then further classes, then outlets."""
    further = [
        (IS_PREFORM, np.flatnonzero(preform.of_triangle == number))
        for number in range(1, preform.classes.count)
    ]
    inlets, outlets = (
        [(kind, np.unique(np.concatenate(list(ports.values()))))] if ports else []
        for kind, ports in ((IS_INLET, preform.inlets), (IS_OUTLET, preform.outlets))
    )
    return [*inlets, *further, *outlets]


def _set_lines(number: int, ids: np.ndarray) -> list[str]:
    rows = [ids[first : first + SET_LINE] for first in range(0, len(ids), SET_LINE)]
    texts = [",".join(str(value) for value in row) for row in rows]
    begun = [f"SET {number} = ", *[" " * 8] * (len(rows) - 1)]
    ends = [",", ""]
    return [
        start + text + ends[row == len(rows) - 1]
        for row, (start, text) in enumerate(zip(begun, texts, strict=True))
    ]


def _input_file(mesh: str, preform: Preform, sets: list[tuple[int, np.ndarray]]) -> str:
    classes = preform.classes
    numbers = iter(range(1, classes.count))
    kinds = [kind for kind, _ in sets] + [IGNORED] * (MOST_SETS - len(sets))
    rows = [next(numbers) if kind == IS_PREFORM else 0 for kind in kinds]
    asked = _asked_for_inlet(preform)
    entries: list[tuple[Sequence[int | float | str], str]] = [
        ([1], "physical model"),
        ([mesh], "mesh"),
        ([END_TIME], "end of the simulation [s]"),
        ([*AIR, VISCOSITY], "p_ref [Pa] rho_ref [kg/m3] gamma viscosity of the resin [Pa s]"),
        ([INJECTION_PRESSURE, CAVITY_PRESSURE], "injection and initial cavity pressure [Pa]"),
        (_properties(classes, 0), "main preform: t [m] porosity K [m2] alpha direction"),
        *(
            (_properties(classes, row), f"set {number}: t [m] porosity K [m2] alpha direction")
            for number, row in enumerate(rows, start=1)
        ),
        (kinds, "sets: 0 ignored, 1 inlet, 2 preform, 3 outlet"),
        ([0, "results.jld2"], "restart, file"),
        ([asked, PORT_RADIUS], "inlet chosen in a window, radius [m]"),
        ([PICTURES], "pictures"),
    ]
    # One blank separates entries; the comment is one more of them.
    return "".join(
        " ".join([*(_entry(value) for value in values), "#" + text.replace(" ", "_")]) + "\n"
        for values, text in entries
    )


def _asked_for_inlet(preform: Preform) -> int:
    """0: inlets are sets; 1: chosen in a window, one preform; 2: chosen, beside the sets."""
    if preform.inlets:
        return 0
    return 2 if preform.classes.count > 1 else 1


def _properties(classes: Classes, row: int) -> list[float]:
    along, across = classes.values[row]
    return [
        float(classes.thickness[row]), float(classes.porosity[row]), float(along),
        float(across / along), *classes.direction[row].tolist(),
    ]  # fmt: skip


def _entry(value: int | float | str) -> str:
    return f"{value:.9g}" if isinstance(value, float) else str(value)
