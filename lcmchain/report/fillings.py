"""Infiltrations in words: how each ended, for the terminal and the report."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any


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
        yield (
            f"gate {name}",
            f"{1e6 * gate['injected_volume']:.4g} ml, up to {1e-5 * gate['pressure_max']:.4g} bar "
            f"and {1e6 * gate['flow_rate_max']:.4g} ml/s",
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
        yield f"stage {name}", stage_in_words(stage)
    yield "largest pressure", f"{1e-5 * report['pressure_max']:.4g} bar"
    yield (
        "balance of the resin",
        f"injected, stored and vented differ by {report['balance_error']:.1e} at most",
    )
    yield "steps", f"{report['step_count']:,} in {report['wall_s']:.3g} s of computing"
    yield "files", ", ".join(report["files"].values())


def stage_in_words(stage: Mapping[str, float]) -> str:
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
