"""Results of stages, mappings and infiltrations in words, for the terminal and the report."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lcmchain.fields.dataset import HISTORY, SHEET
from lcmchain.fields.loads import has_histories, mean_force
from lcmchain.fields.saved import SAMPLE
from lcmchain.fields.stages import last_frames
from lcmchain.quantities.readable import milliseconds_text, percent
from lcmchain.report.style import PREFIX

if TYPE_CHECKING:
    import xarray as xr
    from rich.table import Table


# --- stages of the process ------------------------------------------------------------------------


def stage_chapters(
    summary: Mapping[str, Any],
    datasets: Mapping[str, xr.Dataset],
    pictures: Sequence[tuple[str, str, str]] = (),
) -> list[tuple[str, list[tuple[str, str]], list[tuple[str, str, str]]]]:
    """Return heading, rows and pictures of every stage that has begun.

    pictures : file, caption and address of all pictures of the run.
    """
    frames = dict(last_frames(datasets[HISTORY]))
    chapters = []
    for number, stage in enumerate(summary.get("stages", ()), start=1):
        name = stage["name"]
        rows = list(_rows(stage, datasets, frames.get(name)))
        rows += [
            ("resin", _stage_in_words(filling["stages"][name]))
            for filling in summary.get("infiltration", {}).values()
            if name in filling.get("stages", {})
        ]
        of_stage = [p for p in pictures if Path(p[0]).name.startswith(f"{PREFIX}{number}_{name}_")]
        chapters.append((f"{number}. {name}", rows, of_stage))
    return chapters


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


# --- infiltrations --------------------------------------------------------------------------------


def filling_in_words(report: Mapping[str, Any]) -> str:
    """Say how a filling of ``summary.json`` ended; why it failed where it did."""
    if "error" in report:
        return str(report["error"])
    # What presses on a part goes on after the part is full.
    full_at = report["fill_time_last"] if report["outcome"] == "filled" else None
    end = time_in_words(report["time"] if full_at is None else full_at)
    share = f"{report['filled_share']:.1%}"
    text = {
        "filled": f"filled after {end}",
        "reached": f"{share} filled after {end}",
        "gelled": f"{share} filled when the resin gelled after {end}",
        "trapped": f"{share} filled, the rest is trapped air, after {end}",
        "no_source": f"{share} filled when no source was left after {end}",
    }.get(report["outcome"], f"{share} filled after {end} ({report['outcome']})")
    above = _share_in_layer(report) * report["resin_mass"]
    text += f", {1e3 * (report['resin_mass'] - above):.4g} g of resin in the part"
    if report.get("flow_medium"):
        text += f" and {1e3 * above:.4g} g in the flow medium"
    vented = sum(vent["vented_volume"] for vent in report["vents"].values())
    if vented > 0.0:
        text += f", {1e6 * vented:.3g} ml vented"
    count = len(report["dry_spots"])
    if count:
        text += f", {count} dry spot{'s' if count > 1 else ''} on the way"
    return text


def _share_in_layer(report: Mapping[str, Any]) -> float:
    """Share of the resin that is in the flow medium on the part."""
    layer = report.get("flow_medium")
    if not layer or report["resin_volume"] == 0.0:
        return 0.0
    return float(layer["resin_volume"] / report["resin_volume"])


def filling_rows(report: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield names and values of what a filling did, or of why it failed."""
    if "error" in report:
        yield "failed", str(report["error"])
        return
    yield "end", filling_in_words(report)
    if report["message"]:
        yield "why it ended", report["message"]
    yield "mesh", f"{report['cell_count']:,} cells, {report['node_count']:,} nodes"
    yield "pore volume", f"{1e6 * report['pore_volume']:.4g} ml"
    for name, gate in report["gates"].items():
        back = gate.get("returned_volume", 0.0)
        yield (
            f"gate {name}",
            f"{1e6 * gate['injected_volume']:.4g} ml, up to {1e-5 * gate['pressure_max']:.4g} bar "
            f"and {1e6 * gate['flow_rate_max']:.4g} ml/s"
            + (f"; {1e6 * back:.4g} ml flowed back" if back > 1e-6 * report["pore_volume"] else ""),
        )
    for name, vent in report["vents"].items():
        yield f"vent {name}", f"{1e6 * vent['vented_volume']:.4g} ml of resin left"
    layer = report.get("flow_medium")
    if layer:
        last = layer["fill_time_last"]
        yield (
            "flow medium",
            f"{1e6 * layer['resin_volume']:.4g} of {1e6 * layer['pore_volume']:.4g} ml filled, "
            + ("not all of it" if last is None else f"all reached after {time_in_words(last)}"),
        )
    for name, stage in report.get("stages", {}).items():
        yield f"stage {name}", _stage_in_words(stage)
    yield "largest pressure", f"{1e-5 * report['pressure_max']:.4g} bar"
    yield (
        "balance of the resin",
        f"injected, stored and vented differ by {report['balance_error']:.1e} at most",
    )
    yield "steps", f"{report['step_count']:,} in {report['wall_s']:.3g} s of computing"
    yield "files", ", ".join(report["files"].values())


def _stage_in_words(stage: Mapping[str, float]) -> str:
    """Say what the resin did in a stage of the process."""
    text = (
        f"{time_in_words(stage['start'])} to {time_in_words(stage['end'])} of the resin, "
        f"{stage['filled_share']:.1%} filled at its end, pressure up to "
        f"{1e-5 * stage['pressure_max']:.3g} bar in the saved states, press force up to "
        f"{stage['force_max']:.3g} N"
    )
    for key, word in (("injected_volume", "injected"), ("vented_volume", "vented")):
        if stage[key] > 0.0:
            text += f", {1e6 * stage[key]:.3g} ml {word}"
    return text


def dry_spot_rows(report: Mapping[str, Any]) -> Iterator[tuple[str, ...]]:
    """Yield name, place, area, pore volume, time and what is left of every dry spot."""
    for spot in report.get("dry_spots", ()):
        yield (
            spot["name"],
            ", ".join(f"{1e3 * x:.1f}" for x in spot["place"]),
            f"{1e4 * spot['area']:.3g}",
            f"{1e6 * spot['pore_volume']:.3g}",
            time_in_words(spot["time"]),
            f"{1e6 * spot.get('pore_volume_left', 0.0):.3g}",
        )


def time_in_words(time: float) -> str:
    """Write a time of a filling [s]."""
    return f"{time:.4g} s" if time < 600.0 else f"{time / 60.0:.4g} min"


# --- mappings -------------------------------------------------------------------------------------


#: Units in which errors are read more easily than in SI, and what to multiply them by.
READ_IN = {"m": ("mm", 1e3), "rad": ("°", 57.29577951308232), "Pa": ("kPa", 1e-3)}


def error_table(verification: Mapping[str, Mapping[str, Any]]) -> Table:
    """Return one row a field: largest and root-mean-square error, and change there and back."""
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, title="Error that the mapping adds",
                  title_justify="left")  # fmt: skip
    table.add_column("field", no_wrap=True)
    for heading in ("largest", "cell", "rms", "there and back"):
        table.add_column(heading, justify="right")
    for name, error in verification.items():
        table.add_row(
            name,
            in_words(error["worst"], error["units"]),
            str(error["worst_cell"]),
            in_words(error["root_mean_square"], error["units"]),
            in_words(error["there_and_back"], error["units"]),
        )
    return table


def in_words(value: float | None, units: str) -> str:
    """Write an error with its unit, lengths in mm, angles in degrees, pressures in kPa."""
    if value is None:
        return ""
    unit, factor = READ_IN.get(units, (units if units != "1" else "", 1.0))
    return f"{factor * value:.2g} {unit}".strip()


def mapping_rows(report: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return names and values of what a mapping did, or of why it failed."""
    if "error" in report:
        return [("failed", str(report["error"]))]
    status = ", ".join(f"{count:,} {name}" for name, count in report["status_count"].items())
    rows = [
        ("target", f"{report['target']} ({report['kind']}), weights by {report['method']}"),
        ("cells", f"{report['cell_count']:,}: {status}"),
        ("target area covered", f"{report['target_coverage']:.2%}"),
        ("sheet area covered", f"{report['source_coverage']:.2%}"),
        (
            "farthest cell",
            f"{1e3 * report['worst_distance']:.3f} mm off the sheet (cell "
            f"{report['worst_distance_cell']}); {1e3 * report['maximum_distance']:.3g} mm allowed",
        ),
        *_registration_rows(report),
        ("largest change of a share to keep the fibre mass", f"{report['wedge_correction']:.1%}"),
        ("fibre mass moved between neighbouring cells", f"{report['moved']:.2%}"),
    ]
    if report["conservation_error"] is not None:
        rows.append(("error of the fibre mass", f"{report['conservation_error']:.2e}"))
    if report["second_family_error_max"] is not None:
        angle = math.degrees(report["second_family_error_max"])
        rows.append(
            (
                "second fibre family, if taken as perpendicular to the first",
                f"up to {angle:.1f}° off (cell {report['second_family_error_cell']})",
            )
        )
    for name, error in (report.get("verification") or {}).items():
        worst, units = in_words(error["worst"], error["units"]), error["units"]
        rows.append(
            (
                f"error added to {name.replace('_', ' ')}",
                f"up to {worst} (cell {error['worst_cell']}), "
                f"{in_words(error['root_mean_square'], units)} root mean square",
            )
        )
    rows.append(("fields", ", ".join(report["fields"])))
    rows.append(("files", ", ".join(report["files"].values())))
    return rows


def _registration_rows(report: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield how the target lies to the sheet, and whether it was moved."""
    place = report.get("registration")
    if place is None:
        return
    yield (
        "distance from the sheet, mean and root mean square",
        f"{1e3 * place['signed_mean']:.3f} mm (above the sheet positive) and "
        f"{1e3 * place['root_mean_square']:.3f} mm",
    )
    shift = ", ".join(f"{1e3 * value:.3f}" for value in place["shift"])
    turn = ", ".join(f"{math.degrees(value):.3f}" for value in place["rotation"])
    yield (
        "motion that brings it to the sheet" + (", applied" if report["registered"] else ""),
        f"turned by ({turn})° and shifted by ({shift}) mm, which leaves "
        f"{1e3 * place['root_mean_square_after']:.3f} mm root mean square",
    )
