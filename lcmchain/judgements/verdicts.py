"""A verdict on a result for every check: good, doubtful or bad, in words, with what to change.

A check is doubtful where the summary warns of it: both read the same threshold. It is bad where the
number is :data:`lcmchain.thresholds.BAD` times as large, where a guard would stop a run, or as the
check itself says. Of the depth between plies a run warns where it is bad alone: single nodes at the
rim of a ply are doubtful for a moment.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from lcmchain.fields.dataset import SHEET
from lcmchain.judgements.contact import (
    hidden_compaction_verdict,
    penetration_verdict,
    ply_depth_verdict,
)
from lcmchain.judgements.fields import field_verdicts
from lcmchain.judgements.grades import BAD_GRADE, DOUBTFUL, GOOD, Verdict
from lcmchain.judgements.quasi_static import (
    balance_verdict,
    damping_verdict,
    has_ended,
    hourglass_verdict,
    inertia_verdict,
    process_time_verdict,
    rest_verdict,
    snap_verdict,
)
from lcmchain.quantities.readable import percent
from lcmchain.results import COMPLETE
from lcmchain.scene import Scene
from lcmchain.thresholds import LARGEST_TARGET_DISTANCE

if TYPE_CHECKING:
    import xarray as xr


def verdicts(
    summary: Mapping[str, Any], scene: Scene, datasets: Mapping[str, xr.Dataset]
) -> list[Verdict]:
    """Judge a result, also one that a guard has stopped; what it does not hold is left out.

    Parameters
    ----------
    summary : content of ``summary.json``, of which any entry may be missing.
    scene : of the run.
    datasets : groups of ``forming.nc``.
    """
    return [
        *_state(summary),
        *balance_verdict(summary, scene),
        *inertia_verdict(summary, scene),
        *rest_verdict(summary, scene),
        *damping_verdict(summary, scene),
        *process_time_verdict(summary, scene),
        *snap_verdict(summary, scene),
        *hourglass_verdict(summary),
        *_halvings(summary),
        *penetration_verdict(summary, scene),
        *ply_depth_verdict(summary),
        *hidden_compaction_verdict(summary),
        *field_verdicts(datasets[SHEET], scene),
        *_mappings(summary),
    ]


def _state(summary: Mapping[str, Any]) -> Iterator[Verdict]:
    state = summary.get("state", COMPLETE)
    if state == COMPLETE:
        yield Verdict("Run", GOOD, "complete: the process was computed to its end")
    elif has_ended(summary):
        text = f"{state}. The process was computed to its end, and its fields are whole"
        yield Verdict("Run", BAD_GRADE, text, "what the reason names")
    else:
        text = f"{state}. What follows is of the frames up to then"
        yield Verdict("Run", BAD_GRADE, text, "what the reason names")


def _halvings(summary: Mapping[str, Any]) -> Iterator[Verdict]:
    count = summary.get("step_halvings")
    if count is None:
        return
    if count == 0:
        yield Verdict("Time step", GOOD, "the stable step held all along; it was never halved")
        return
    times = "once" if count == 1 else f"{count} times"
    text = f"halved {times}, since values were no numbers; the warnings name the places"
    yield Verdict("Time step", DOUBTFUL, text, "process.step_safety")


# --- mappings -------------------------------------------------------------------------------------


def _mappings(summary: Mapping[str, Any]) -> Iterator[Verdict]:
    for name, report in summary.get("mapping", {}).items():
        yield _mapping(f"Mapping to {name}", f'mapping "{name}"', report)


def _mapping(check: str, key: str, report: Mapping[str, Any]) -> Verdict:
    if "error" in report:
        return Verdict(check, BAD_GRADE, f"failed: {report['error']}", key)
    count = report["status_count"]
    unmapped, extrapolated = count.get("unmapped", 0), count.get("extrapolated", 0)
    text = (
        f"{percent(report['target_coverage'])} of the target's area covered; of "
        f"{report['cell_count']:,} cells {extrapolated:,} reach beyond the edge of the sheet and "
        f"{unmapped:,} hold no values; farthest {1e3 * report['worst_distance']:.2f} mm off"
    )
    off, where = _distance_of_target(report)
    text += where
    if unmapped:
        return Verdict(check, BAD_GRADE, text, f"{key}.mesh, {key}.maximum_distance")
    if extrapolated:
        return Verdict(check, DOUBTFUL, text, f"{key}.mesh")
    if off:
        return Verdict(check, DOUBTFUL, text, f"{key}.mesh, {key}.registration")
    return Verdict(check, GOOD, text)


def _distance_of_target(report: Mapping[str, Any]) -> tuple[bool, str]:
    """Whether the target lay too far off the sheet when it was mapped, and how far."""
    place = report.get("registration")
    if place is None:
        return False, ""
    distance = place["root_mean_square_after" if report["registered"] else "root_mean_square"]
    too_far = distance > LARGEST_TARGET_DISTANCE * place["thickness"]
    return too_far, f", {1e3 * distance:.3f} mm as root mean square"
