"""What a study keeps of a run: the formed sheet in its last state, and numbers.

One netCDF file per run, written whole or not at all. It carries the fingerprint of what decides
the numbers, so that an interrupted study takes from it what it has, and nothing that has changed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from lcmchain.fields.loads import quoted_force
from lcmchain.fields.netcdf_file import ROOT, open_netcdf, write_netcdf
from lcmchain.fields.saved import HISTORY
from lcmchain.fields.sheet import reference_positions, sheet_faces, sheet_positions
from lcmchain.fields.stack import PLY
from lcmchain.judgements.grades import GOOD, GRADES
from lcmchain.judgements.verdicts import verdicts

if TYPE_CHECKING:
    from lcmchain.scene import Scene

#: Fields of faces that are compared, as in ``forming.nc``; a run keeps those that it has.
FIELDS = ("shear_angle", "thickness", "fibre_volume_fraction")

#: Entries of ``summary.json`` that are kept, where a run has them.
NUMBERS = (
    "element_count", "step_count", "us_per_element_step", "compile_s",
    "thickness_min_m", "thickness_max_m", "shear_angle_max_rad", "fibre_volume_fraction_max",
    "fibre_strain_max", "wrinkle_height_max_m", "punch_force_max_N", "clamp_force_max_N",
    "forming_work_J", "kinetic_to_internal_max",
    "balance_error_max", "mass_added_total", "mass_added_largest",
)  # fmt: skip


#: Checks that judge the mesh: nothing else makes them better.
OF_THE_MESH = ("Resolution by elements", "Resolution of wrinkles")


@dataclass(frozen=True, eq=False)
class Outcome:
    """What a study keeps of one run.

    Parameters
    ----------
    seconds : solver time, without compilation [s]. threads : that it took.
    reference, formed : positions of the nodes of the mid-surface [m], (N, 3), undeformed and at
        the end; faces : their corners (F, 4), -1 in the last column of a triangle.
    ply : of a stack, that every face belongs to (F,), from 0 the lowest; empty for one sheet.
    values : of the faces at the end by name, (F,), as in ``forming.nc``.
    numbers : by name as in ``summary.json``, ``forming_work_J``, the work put in from outside, and
        of a coupon ``clamp_force_max_N``.
    force : of the punch [N] over the part of the process that has passed, rows of (part, force),
        (M, 2); empty without tools.
    doubts : grades of the checks of the program that are not good, by name: their place in
        :data:`lcmchain.judgements.grades.GRADES`.
    failure : why there is no result, in words; empty where there is one.
    """

    seconds: float
    threads: int = 1
    reference: np.ndarray = field(default_factory=lambda: np.empty((0, 3)))
    formed: np.ndarray = field(default_factory=lambda: np.empty((0, 3)))
    faces: np.ndarray = field(default_factory=lambda: np.empty((0, 4), dtype=np.int64))
    values: dict[str, np.ndarray] = field(default_factory=dict)
    numbers: dict[str, float] = field(default_factory=dict)
    force: np.ndarray = field(default_factory=lambda: np.empty((0, 2)))
    failure: str = ""
    doubts: dict[str, int] = field(default_factory=dict)
    ply: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=np.int64))

    @property
    def plies(self) -> list[np.ndarray]:
        """Rows of the faces of every ply, the lowest first; all of one sheet."""
        if len(self.ply) == 0:
            return [np.arange(len(self.faces))]
        return [np.flatnonzero(self.ply == number) for number in range(int(self.ply.max()) + 1)]

    def worse_than(self, other: Outcome) -> list[str]:
        """Return the checks with a worse grade than in another run, those of the mesh left out."""
        return [
            check
            for check, grade in self.doubts.items()
            if check not in OF_THE_MESH and grade > other.doubts.get(check, 0)
        ]

    def equals(self, other: Outcome) -> bool:
        """Tell whether the results are the same to the last bit; times may differ."""
        arrays = ("reference", "formed", "faces", "force", "ply")
        return (
            self.failure == other.failure
            and self.values.keys() == other.values.keys()
            and all(np.array_equal(getattr(self, n), getattr(other, n)) for n in arrays)
            and all(np.array_equal(self.values[n], other.values[n]) for n in self.values)
        )


def outcome_of(datasets: dict[str, xr.Dataset], summary: dict, scene: Scene) -> Outcome:
    """Return what is kept of a forming result (groups of ``forming.nc``, ``summary.json``)."""
    numbers = dict(summary)
    if "energy" in summary:
        numbers["forming_work_J"] = summary["energy"]["external"]
    else:  # a net that is laid knows no forces
        numbers.pop("punch_force_max_N", None)
    kept = outcome_of_sheet(datasets, numbers, float(summary["wall_s"]), int(summary["threads"]))
    good = GRADES.index(GOOD)
    grades = {v.check: GRADES.index(v.grade) for v in verdicts(summary, scene, datasets)}
    doubts = {check: grade for check, grade in grades.items() if grade > good}
    return replace(kept, force=_force_of(datasets[HISTORY], summary), doubts=doubts)


def outcome_of_sheet(
    datasets: Mapping[str, xr.Dataset], numbers: Mapping, seconds: float, threads: int
) -> Outcome:
    """Return what is kept of a formed sheet and its numbers by the names of ``NUMBERS``.

    Parameters
    ----------
    datasets : groups of ``forming.nc``, of which the root is taken.
    seconds : solver time [s]. threads : that it took.
    """
    sheet = datasets[ROOT]
    faces = sheet_faces(sheet).copy()
    faces[faces[:, 3] == faces[:, 2], 3] = -1
    return Outcome(
        seconds=seconds,
        threads=threads,
        reference=reference_positions(sheet),
        formed=sheet_positions(sheet),
        faces=faces,
        values={n: np.asarray(sheet[n].values[-1], dtype=float) for n in FIELDS if n in sheet},
        numbers={n: float(numbers[n]) for n in NUMBERS if numbers.get(n) is not None},
        ply=_ply_of(sheet),
    )


def _ply_of(sheet: xr.Dataset) -> np.ndarray:
    """Return the ply of every face of a stack, none for one sheet."""
    values = sheet[PLY].values if PLY in sheet else np.empty(0)
    return np.asarray(values, dtype=np.int64)


def _force_of(history: xr.Dataset, summary: dict) -> np.ndarray:
    """Return the force of the punch over the part of the process that has passed, (M, 2)."""
    if "punch" not in summary:
        return np.empty((0, 2))
    time, force = quoted_force(history)
    punch = [str(name) for name in history["tool"].values].index(summary["punch"])
    return np.column_stack([time / float(summary["process_time_s"]), force[:, punch]])


def write_outcome(path: Path, outcome: Outcome, fingerprint: str) -> None:
    """Write an outcome with the fingerprint of all that decides it."""
    dataset = xr.Dataset(
        {
            "reference_position": (("node", "axis"), outcome.reference, {"units": "m"}),
            "formed_position": (("node", "axis"), outcome.formed, {"units": "m"}),
            "face_nodes": (("face", "corner"), outcome.faces.astype(np.int32)),
            "punch_force": (("sample", "part_and_force"), outcome.force),
            **{f"face_{name}": ("face", values) for name, values in outcome.values.items()},
            **({"ply": ("face", outcome.ply.astype(np.int32))} if len(outcome.ply) else {}),
        },
        attrs={
            "fingerprint": fingerprint,
            "seconds": outcome.seconds,
            "threads": outcome.threads,
            "failure": outcome.failure,
            **{f"number_{name}": value for name, value in outcome.numbers.items()},
            **{f"doubt_{check}": grade for check, grade in outcome.doubts.items()},
        },
    )
    write_netcdf(path, {ROOT: dataset})


def read_outcome(path: Path, fingerprint: str) -> Outcome | None:
    """Read an outcome; None where there is none, or that of another run."""
    if not path.is_file():
        return None
    try:
        with open_netcdf(path) as dataset:
            dataset = dataset.load()
    except (OSError, ValueError):  # cut off by a full disk, say: the run is made again
        return None
    about = dataset.attrs
    if about.get("fingerprint") != fingerprint:
        return None
    return Outcome(
        seconds=float(about["seconds"]),
        threads=int(about["threads"]),
        reference=dataset["reference_position"].values,
        formed=dataset["formed_position"].values,
        faces=dataset["face_nodes"].values.astype(np.int64),
        values={
            str(name).removeprefix("face_"): dataset[name].values
            for name in dataset.data_vars
            if str(name).removeprefix("face_") in FIELDS
        },
        numbers={
            name.removeprefix("number_"): float(value)
            for name, value in about.items()
            if name.startswith("number_")
        },
        force=dataset["punch_force"].values,
        failure=str(about["failure"]),
        ply=np.asarray(dataset["ply"].values if "ply" in dataset else np.empty(0), dtype=np.int64),
        doubts={
            name.removeprefix("doubt_"): int(grade)
            for name, grade in about.items()
            if name.startswith("doubt_")
        },
    )
