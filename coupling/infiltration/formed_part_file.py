"""A formed part in a folder of its own: all that a filling takes of it, without its source."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from lcmchain.coupling.infiltration.formed_part import FormedPart
from lcmchain.errors import InputError
from lcmchain.fields.netcdf_file import ROOT, open_netcdf, write_netcdf
from lcmchain.mapping.target import TargetMesh

FIELDS, MESH = "part.nc", "part_mesh.npz"
#: Tables of sets of a target mesh.
SETS = ("cell_sets", "node_sets", "parts")


def write_part(folder: Path, part: FormedPart) -> None:
    """Write the fields of a part (``part.nc``, UGRID) and its mesh with numbers and sets."""
    folder.mkdir(parents=True, exist_ok=True)
    write_netcdf(folder / FIELDS, {ROOT: part.dataset})
    target = part.target
    arrays = {"points": target.points, "cell_ids": target.cell_ids, "node_ids": target.node_ids}
    about: dict[str, Any] = {
        "file": Path(part.file).name,
        "warnings": list(part.warnings),
        "blocks": [name for name, _ in target.blocks],
        "notes": list(target.notes),
        "coordinates": [str(name) for name in part.dataset.coords],
    }
    for number, (_, cells) in enumerate(target.blocks):
        arrays[f"block_{number}"] = cells
    for table in SETS:
        entries = getattr(target, table)
        about[table] = list(entries)
        arrays |= {f"{table}_{number}": rows for number, rows in enumerate(entries.values())}
    arrays["about"] = np.array(json.dumps(about))
    np.savez(folder / MESH, **arrays)  # type: ignore[arg-type]  # numpy 2.4 types its options so


def read_part(folder: Path) -> FormedPart:
    """Read a part that :func:`write_part` has written; it fills bit-identically.

    Raises
    ------
    InputError : the files are not there, or are no part.
    """
    try:
        with open_netcdf(folder / FIELDS, mask_and_scale=False) as dataset:
            dataset = dataset.load()
        with np.load(folder / MESH, allow_pickle=False) as data:
            about = json.loads(str(data["about"]))
            dataset = dataset.set_coords(about["coordinates"])
            blocks = tuple(
                (name, data[f"block_{number}"]) for number, name in enumerate(about["blocks"])
            )
            sets: dict[str, Any] = {
                table: {name: data[f"{table}_{k}"] for k, name in enumerate(about[table])}
                for table in SETS
            }
            target = TargetMesh(
                data["points"], blocks, {}, cell_ids=data["cell_ids"], node_ids=data["node_ids"],
                notes=tuple(about["notes"]), **sets,
            )  # fmt: skip
    except (OSError, KeyError, ValueError) as error:
        raise InputError(f"this is no formed part ({error})", file=folder) from None
    return FormedPart(target, dataset, about["file"], tuple(about["warnings"]))
