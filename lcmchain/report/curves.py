"""Forces and energies of a run as plain numbers, for the curves of the report."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from lcmchain.fields.history_group import SAMPLE
from lcmchain.fields.loads import has_histories, mean_force
from lcmchain.fields.summary import punch_index, tool_force_magnitude
from lcmchain.report.stages import borders

if TYPE_CHECKING:
    import xarray as xr

#: Digits of the numbers: more than any plot shows.
DIGITS = 6
#: Energies in the order of the legend; others follow.
ENERGIES = (
    "external", "internal", "friction", "damping", "mass_damping", "hourglass", "inelastic",
    "viscous",     "contact", "kinetic", "balance_error",
)  # fmt: skip


def curve_data(history: xr.Dataset) -> dict[str, Any]:
    """Return forces over time and travel, and the energies over time, ready for JSON.

    Of the histories where a result has them, else of the frames.

    Returns
    -------
    ``time`` [ms]; ``stages``: name and ``end`` [ms], none without stages; ``tools``: name,
    ``travel`` [mm], ``force`` [N], the mean over each interval, and ``peak`` [N], the largest of
    single steps (None of frames); ``punch``, the index of the tool whose travel is the stroke, None
    without tools; ``energies`` [J]: name, ``values``.
    """
    histories = has_histories(history)
    stem, clock = ("history_energy_", SAMPLE) if histories else ("energy_", "time")
    names = [str(name).removeprefix(stem) for name in history if str(name).startswith(stem)]
    names.sort(key=lambda name: ENERGIES.index(name) if name in ENERGIES else len(ENERGIES))
    return {
        "time": _numbers(1e3 * history[clock].values),
        "stages": [{"name": name, "end": end} for name, end in borders(history)],
        "tools": _tools(history, histories),
        "punch": punch_index(history) if history.sizes["tool"] else None,
        "energies": [
            {"name": name.replace("_", " "), "values": _numbers(history[f"{stem}{name}"].values)}
            for name in names
        ],
    }


def _tools(history: xr.Dataset, histories: bool) -> list[dict[str, Any]]:
    if not history.sizes["tool"]:
        return []
    stem = "history_tool" if histories else "tool"
    travel = 1e3 * history[f"{stem}_travel"].values
    force = mean_force(history) if histories else tool_force_magnitude(history)
    peak = history["history_tool_peak_force"].values if histories else None
    return [
        {
            "name": str(name),
            "travel": _numbers(travel[:, tool]),
            "force": _numbers(force[:, tool]),
            "peak": None if peak is None else _numbers(peak[:, tool]),
        }
        for tool, name in enumerate(history["tool"].values)
    ]


def _numbers(values: np.ndarray) -> list[float | None]:
    """Return the numbers with the digits that a plot needs, None where they are not finite."""
    return [float(f"{value:.{DIGITS}g}") if np.isfinite(value) else None for value in values]
