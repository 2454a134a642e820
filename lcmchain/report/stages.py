"""The chapter of a report on the stages of a process: rows of figures, and pictures of each end."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lcmchain.fields.dataset import HISTORY, SHEET
from lcmchain.fields.history_group import SAMPLE
from lcmchain.fields.loads import has_histories, mean_force
from lcmchain.fields.stages import STAGE, STAGE_END, STAGE_NAME
from lcmchain.quantities.durations import milliseconds_text
from lcmchain.report.captions import PREFIX
from lcmchain.report.fillings import stage_in_words
from lcmchain.report.grades import percent

if TYPE_CHECKING:
    import xarray as xr


def picture_name(number: int, name: str, what: str) -> str:
    """Return the file of a picture of a stage, counted from 1."""
    return f"{PREFIX}{number}_{name}_{what}.png"


def last_frames(history: xr.Dataset) -> list[tuple[str, int]]:
    """Return the name of every stage that has frames, and the last one of them."""
    if STAGE not in history:
        return []
    of_frames = history[STAGE].values
    names = [str(name) for name in history[STAGE_NAME].values]
    found = []
    for number, name in enumerate(names):
        own = np.flatnonzero(of_frames == number)
        if own.size:
            found.append((name, int(own[-1])))
    return found


def borders(history: xr.Dataset) -> list[tuple[str, float]]:
    """Return the name of every stage and its end [ms]; nothing without stages."""
    if STAGE not in history:
        return []
    ends = 1e3 * history[STAGE_END].values
    return [(str(name), float(end)) for name, end in zip(history[STAGE_NAME].values, ends)]


def stage_chapters(
    summary: Mapping[str, Any],
    datasets: Mapping[str, xr.Dataset],
    pictures: Sequence[tuple[str, str, str]] = (),
) -> list[tuple[str, list[tuple[str, str]], list[tuple[str, str, str]]]]:
    """Return heading, rows and pictures of every stage that has begun.

    pictures : file, caption and address of all pictures of the run.
    """
    frames = dict(last_frames(datasets[HISTORY]))
    found = []
    for number, stage in enumerate(summary.get("stages", ()), start=1):
        name = stage["name"]
        rows = list(_rows(stage, datasets, frames.get(name)))
        rows += [
            ("resin", stage_in_words(filling["stages"][name]))
            for filling in summary.get("infiltration", {}).values()
            if name in filling.get("stages", {})
        ]
        own = [p for p in pictures if Path(p[0]).name.startswith(f"{PREFIX}{number}_{name}_")]
        found.append((f"{number}. {name}", rows, own))
    return found


def _rows(
    stage: Mapping[str, Any], datasets: Mapping[str, xr.Dataset], frame: int | None
) -> Iterator[tuple[str, str]]:
    start, end = stage["start_s"], stage["end_s"]
    yield "time", f"{1e3 * start:.4g} to {1e3 * end:.4g} ms, {milliseconds_text(end - start)}"
    yield "tools at work", ", ".join(stage["tools"]) or "none"
    yield from _forces(datasets[HISTORY], stage)
    if frame is not None:
        yield from _at_the_end(datasets, frame)
    if "rest" in stage:
        yield "rest", rest_in_words(stage)


def rest_in_words(stage: Mapping[str, Any]) -> str:
    """Say whether the sheet came to rest in a stage, and how still it is."""
    rest = stage["rest"]
    part = rest["energy_part"]
    still = ""
    if part is not None:
        still = f": the kinetic energy came to {part:.1g} of what was stored in the last swing"
    if rest["reached_s"] is None:
        return f"not reached{still}; wanted is {rest['wanted']:g}"
    after = milliseconds_text(rest["reached_s"] - stage["start_s"])
    return f"reached after {after} and {rest['stops']} stops{still}"


def _forces(history: xr.Dataset, stage: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield the largest mean force of every tool within a stage."""
    if not has_histories(history) or not history.sizes.get("tool"):
        return
    time = history[SAMPLE].values
    within = (time > stage["start_s"] * (1.0 + 1e-9)) & (time <= stage["end_s"] * (1.0 + 1e-9))
    if not within.any():
        return
    force = mean_force(history)[within].max(axis=0)
    names = [str(name) for name in history["tool"].values]
    told = [f"{n} {f:.3g} N" for n, f in zip(names, force) if n in stage["tools"]]
    if told:
        yield "largest forces", ", ".join(told)


def _at_the_end(datasets: Mapping[str, xr.Dataset], frame: int) -> Iterator[tuple[str, str]]:
    sheet, history = datasets[SHEET].isel(time=frame), datasets[HISTORY].isel(time=frame)
    yield "shear angle", f"up to {np.degrees(float(np.abs(sheet['shear_angle']).max())):.1f} deg"
    if "thickness" in sheet:
        low, high = (1e3 * float(sheet["thickness"].min()), 1e3 * float(sheet["thickness"].max()))
        yield "thickness", f"{low:.3f} to {high:.3f} mm"
    if "springback" in sheet and float(sheet["springback"].max()) > 0.0:
        largest, mean = (1e3 * float(f(sheet["springback"])) for f in (np.nanmax, np.nanmean))
        yield "springback", f"up to {largest:.3g} mm, {mean:.3g} mm in the mean"
    if "energy_external" in history:
        yield "external work since the start", f"{float(history['energy_external']):.4g} J"
        internal = float(history["energy_internal"])
        if internal > 0.0:
            part = float(history["energy_kinetic"]) / internal
            yield "kinetic energy at the end", f"{percent(part)} of the internal energy"
