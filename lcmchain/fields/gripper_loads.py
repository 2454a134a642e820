"""What grippers take and pull: from the histories of a result."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from lcmchain.fields.history_group import SAMPLE
from lcmchain.fields.sheet import vector

if TYPE_CHECKING:
    import xarray as xr


def gripper_loads(history: xr.Dataset) -> dict[str, dict[str, float]]:
    """Return the forces of every gripper under the names of ``summary.json``.

    Returns
    -------
    For each gripper ``force_max_N``, the largest mean over an interval of the histories, with
    ``force_max_time_s``, its end; ``force_end_N``, that of the last interval; ``travel_end_m``, how
    far its place has moved; and ``let_go_s``, when it let go, where it did.
    """
    if "gripper" not in history:
        return {}
    time = history[SAMPLE].values
    force = np.linalg.norm(vector(history, "history_gripper_force"), axis=-1)
    travel = np.linalg.norm(vector(history, "history_gripper_travel"), axis=-1)
    let_go = history["gripper_let_go"].values
    loads: dict[str, dict[str, float]] = {}
    for number, name in enumerate(str(name) for name in history["gripper"].values):
        top = int(np.argmax(force[:, number]))
        loads[name] = {
            "force_max_N": float(force[top, number]),
            "force_max_time_s": float(time[top]),
            "force_end_N": float(force[-1, number]),
            "travel_end_m": float(travel[-1, number]),
        }
        if np.isfinite(let_go[number]):
            loads[name]["let_go_s"] = float(let_go[number])
    return loads
