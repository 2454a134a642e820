"""Numbers, parts and sets of a target as variables of the files that a mapping writes."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping

import numpy as np

from lcmchain.fields.ugrid import Described
from lcmchain.mapping.target.mesh import TargetMesh
from lcmchain.mesh_files.readers.by_meshio import CELL_SET, NODE_SET, PART

MOST_MARKED_PARTS = 100

# A variable's name, and a word of flag_meanings, consist of these (CF 1.11, 2.3 and 3.5).
_NOT_IN_NAMES = re.compile(r"[^A-Za-z0-9_]+")
_NOT_IN_XML = re.compile(r"[<>&\"'\x00-\x1f\x7f-\x9f\ud800-\udfff\ufffe\uffff]")


def cell_variables(target: TargetMesh) -> dict[str, Described]:
    """Return number, part and membership in sets of every cell, for netCDF.

    ``part`` counts the parts from 1, 0 is none; its attributes name them. Every set is a variable
    of 0 and 1.
    """
    variables: dict[str, Described] = {
        "cell_id": (target.cell_ids, {"long_name": "number of the cell in the target file",
                                      "units": "1"})
    }  # fmt: skip
    if target.parts:
        names = list(target.parts)
        words = _distinct(["none", *names])
        about = {
            "long_name": "part of the target file that the cell belongs to",
            "units": "1",
            "flag_values": np.arange(len(words), dtype=np.int32),
            "flag_meanings": " ".join(words),
            "part_names": "\n".join(names),
        }
        variables["part"] = (_part_numbers(target), about)
    return variables | _memberships("cell_set", target.cell_sets, target.cell_count)


def node_variables(target: TargetMesh) -> dict[str, Described]:
    """Return number and membership in sets of every node, for netCDF."""
    about = {"long_name": "number of the node in the target file", "units": "1"}
    sets = _memberships("node_set", target.node_sets, len(target.points))
    return {"node_id": (target.node_ids, about)} | sets


def cell_data(target: TargetMesh) -> dict[str, np.ndarray]:
    """Return number, part and membership in parts and sets of every cell, for VTU.

    Each array of 0 and 1 is called as what it marks: ``cell_set:NAME``, ``part:NAME``. Of very many
    parts there is the number only.
    """
    data = {"cell_id": target.cell_ids}
    if target.parts:
        data["part"] = _part_numbers(target)
    parts = target.parts if len(target.parts) <= MOST_MARKED_PARTS else {}
    data |= _marked(PART, parts, target.cell_count)
    return data | _marked(CELL_SET, target.cell_sets, target.cell_count)


def point_data(target: TargetMesh) -> dict[str, np.ndarray]:
    """Return number and membership in sets of every node, for VTU."""
    return {"node_id": target.node_ids} | _marked(NODE_SET, target.node_sets, len(target.points))


def _part_numbers(target: TargetMesh) -> np.ndarray:
    """Part of each cell counted from 1, 0 where it has none, shape (C,)."""
    numbers = np.zeros(target.cell_count, dtype=np.int32)
    for number, rows in enumerate(target.parts.values(), start=1):
        numbers[rows] = number
    return numbers


def _memberships(kind: str, sets: Mapping[str, np.ndarray], count: int) -> dict[str, Described]:
    variables = {}
    for (name, rows), word in zip(sets.items(), _distinct(sets), strict=True):
        about = {
            "long_name": f"{kind.replace('_', ' ')} {name} of the target file",
            "set_name": name,
            "units": "1",
            "flag_values": np.array([0, 1], dtype=np.int8),
            "flag_meanings": "outside member",
        }
        variables[f"{kind}_{word}"] = (_marks(rows, count), about)
    return variables


def _marks(rows: np.ndarray, count: int) -> np.ndarray:
    marks = np.zeros(count, dtype=np.int8)
    marks[rows] = 1
    return marks


def _marked(kind: str, sets: Mapping[str, np.ndarray], count: int) -> dict[str, np.ndarray]:
    """Arrays of 0 and 1 named by what they mark, without what meshio does not escape in XML."""
    names = _distinct(sets, _NOT_IN_XML)
    return {
        kind + name: _marks(rows, count) for name, rows in zip(names, sets.values(), strict=True)
    }


def _distinct(names: Iterable[str], forbidden: re.Pattern = _NOT_IN_NAMES) -> list[str]:
    """Names without what is forbidden in them, no two alike."""
    words: dict[str, None] = {}
    for name in names:
        word = base = forbidden.sub("_", name) or "unnamed"
        number = 1
        while word in words:
            number += 1
            word = f"{base}_{number}"
        words[word] = None
    return list(words)
