"""Files of a target that follows the material: netCDF over time, and a series for ParaView."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lcmchain.fields.table import FIELDS
from lcmchain.fields.ugrid import TIME, UgridMesh, saved_times
from lcmchain.fields.vtu import frame_file, write_frame_list
from lcmchain.mapping.files import cell_fields, compact, write_vtu
from lcmchain.mapping.frames import MappedFrame
from lcmchain.mapping.registration import Registration
from lcmchain.mapping.target import TargetMesh
from lcmchain.mapping.transfer import ERROR, turned

if TYPE_CHECKING:
    import xarray as xr


def write_frames(
    path: Path | str,
    dataset: xr.Dataset,
    frames: Iterable[MappedFrame],
    target: TargetMesh,
    motion: Registration | None,
) -> xr.Dataset:
    """Write every frame as VTU and the PVD file that lists them; return the fields over time.

    Parameters
    ----------
    path : of the PVD file; the frames lie in the folder ``<name>_frames`` beside it.
    dataset : the mapped fields in the frame of the weights.
    target : as its file has it, in that frame.
    motion : that brought the target to the sheet; what is written is moved back.

    Returns
    -------
    The dataset with the dimension ``time`` on every field, and with the motion of the nodes as
    ``reference_position`` (in the first frame) and ``displacement``, as in a forming result. What
    says how the cells were mapped is that of the weights, and the same at all times.
    """
    used, _ = compact(target.corners)
    mesh = UgridMesh("target", topology_dimension=3 if target.is_solid else 2)
    on_cells = [name for name, v in dataset.data_vars.items() if v.dims == (mesh.cell_dimension,)]
    times: list[float] = []
    positions: list[np.ndarray] = []
    values: dict[str, list[np.ndarray]] = {}
    for number, frame in enumerate(frames):
        frame = _moved_back(frame, motion)
        write_vtu(frame_file(path, number), frame.sheet, frame.target, frame.weights, frame.mapped)
        times.append(frame.time)
        positions.append(frame.target.points[used])
        fields = cell_fields(frame.sheet, frame.weights, frame.mapped)
        for name in map(str, on_cells):
            of_mapping = name.startswith("mapping_") or name.endswith(ERROR)
            if not of_mapping and dataset[name].dtype.kind == "f":
                found = fields[name][0] if name in fields else np.full(target.cell_count, np.nan)
                values.setdefault(name, []).append(found)
    write_frame_list(path, times)

    over_time = dataset.drop_vars(TIME, errors="ignore")
    over_time = over_time.assign_coords({TIME: saved_times(np.array(times))})
    if TIME in dataset.variables:
        over_time.attrs["mapping_time_s"] = float(dataset[TIME])  # the state of the weights
    for name, series in values.items():
        over_time[name] = mesh.on_cells(np.stack(series), dataset[name].attrs)
    displacement = np.stack(positions) - positions[0]
    for name, vectors in (("reference_position", positions[0]), ("displacement", displacement)):
        field = FIELDS[name]
        for axis, variable in enumerate(field.variables):
            parts = np.ascontiguousarray(vectors[..., axis])
            over_time[variable] = mesh.on_nodes(parts, field.attributes(variable))
    return over_time


def _moved_back(frame: MappedFrame, motion: Registration | None) -> MappedFrame:
    if motion is None:
        return frame
    points = motion.restored(frame.target.points)
    mapped = turned(frame.mapped, motion.matrix.T)
    return replace(frame, target=replace(frame.target, points=points), mapped=mapped)
