"""A verdict on a result for every check: good, doubtful or bad, in words, with what to change.

A check is doubtful where the summary warns of it, since both read the same threshold, and bad
where the number is :data:`lcmchain.thresholds.BAD` times as large, where a guard would stop a run,
or as the check itself says.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import xarray as xr

from lcmchain.fields.dataset import SHEET
from lcmchain.fields.limits import LARGEST_FIBRE_VOLUME_FRACTION
from lcmchain.fields.sheet import sheet_areas
from lcmchain.quantities.durations import milliseconds_text
from lcmchain.report.waves import elements_per_wave
from lcmchain.results import COMPLETE
from lcmchain.solver import guards
from lcmchain.thresholds import (
    BAD,
    LARGEST_BALANCE_ERROR,
    LARGEST_DAMPING_PART,
    LARGEST_FIBRE_STRAIN,
    LARGEST_HOURGLASS_PART,
    LARGEST_KINETIC_PART,
    LARGEST_KINETIC_PART_AT_END,
    LARGEST_PENETRATION,
    LARGEST_TARGET_DISTANCE,
    LEAST_ELEMENTS_PER_WAVE,
    LOCAL_AREA,
    LONGEST_DYNAMIC_PART,
)

if TYPE_CHECKING:
    from lcmchain.scene import Scene

#: The grades, worst last; what nobody can tell is not judged.
NOT_JUDGED, GOOD, DOUBTFUL, BAD_GRADE = GRADES = ("not judged", "good", "doubtful", "bad")


class Verdict(NamedTuple):
    """What a check found.

    check : its name. grade : one of ``GRADES``. text : number, limit and meaning, in words.
    remedy_key : scene entries to change, where the grade is not good.
    """

    check: str
    grade: str
    text: str
    remedy_key: str = ""


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
    sheet = datasets[SHEET]
    return [
        *_state(summary),
        *_energy_balance(summary),
        *_inertia(summary),
        *_rest(summary),
        *_damping(summary),
        *_process_time(summary, scene),
        *_hourglass(summary),
        *_waves(sheet),
        *_halvings(summary),
        *_penetration(summary, scene),
        *_fibre_strain(sheet, scene),
        *_shear(sheet, scene),
        *_fibre_volume(sheet),
        *_mappings(summary),
    ]


def worst_grade(found: list[Verdict]) -> str:
    """Return the worst of the grades."""
    return max((verdict.grade for verdict in found), key=GRADES.index, default=NOT_JUDGED)


def _state(summary: Mapping[str, Any]) -> Iterator[Verdict]:
    state = summary.get("state", COMPLETE)
    if state == COMPLETE:
        yield Verdict("Run", GOOD, "complete: the process was computed to its end")
    elif _has_ended(summary):
        text = f"{state}. The process was computed to its end, and its fields are whole"
        yield Verdict("Run", BAD_GRADE, text, "what the reason names")
    else:
        text = f"{state}. What follows is of the frames up to then"
        yield Verdict("Run", BAD_GRADE, text, "what the reason names")


def _has_ended(summary: Mapping[str, Any]) -> bool:
    """Tell whether the process was computed to its end, whatever came after."""
    if summary.get("state", COMPLETE) == COMPLETE:
        return True
    end = summary.get("process_time_s", np.inf)
    return bool(np.isclose(summary.get("time_reached_s", 0.0), end, rtol=1e-9))


def _share(
    check: str,
    part: float,
    limit: float,
    quantity: str,
    consequence: str,
    remedy: str,
    worst: float | None = None,
) -> Verdict:
    """Judge a share: doubtful above its limit, bad above ``worst``, by default BAD times it.

    quantity : what the share is, with its place as {}; consequence : of one that is too large.
    """
    grade = _grade(part, limit, BAD * limit if worst is None else worst)
    text = f"{quantity.format(percent(part))} (good up to {percent(limit)})"
    if grade == GOOD:
        return Verdict(check, grade, text)
    return Verdict(check, grade, f"{text}: {consequence}", remedy)


def percent(part: float) -> str:
    """Return a share in percent, with as many digits as say something."""
    return "less than 0.01 %" if 0.0 <= part < 1e-4 else f"{100.0 * part:.3g} %"


def _grade(value: float, limit: float, worst: float) -> str:
    if not value > limit:
        return GOOD
    return DOUBTFUL if value <= worst else BAD_GRADE


# --- energies -------------------------------------------------------------------------------------


def _energy_balance(summary: Mapping[str, Any]) -> Iterator[Verdict]:
    if "balance_error_max" in summary:
        yield _share(
            "Energy balance",
            summary["balance_error_max"],
            LARGEST_BALANCE_ERROR,
            "off by {} of the largest internal energy",
            "energy is lost or comes from nowhere",
            "process.step_safety, element.cross_terms",
        )


def _inertia(summary: Mapping[str, Any]) -> Iterator[Verdict]:
    if "kinetic_to_internal_over_tenth_of_stroke" in summary:
        yield _share(
            "Quasi-static",
            summary["kinetic_to_internal_over_tenth_of_stroke"],
            LARGEST_KINETIC_PART,
            f"over {percent(LONGEST_DYNAMIC_PART)} of the stroke the kinetic energy exceeds "
            "{} of the internal energy",
            "inertia is part of forces and shape",
            "process.time",
        )


def _rest(summary: Mapping[str, Any]) -> Iterator[Verdict]:
    # a stopped run has not come to its end
    if "kinetic_to_internal_end" in summary and _has_ended(summary):
        yield _share(
            "At rest at the end",
            summary["kinetic_to_internal_end"],
            LARGEST_KINETIC_PART_AT_END,
            "in the last frame the kinetic energy is {} of the internal energy",
            "the sheet still moves, and its shape is not the final one",
            "process.time, process.mass_damping",
        )


def _damping(summary: Mapping[str, Any]) -> Iterator[Verdict]:
    if "damping_to_external" in summary:
        yield _share(
            "Damping",
            summary["damping_to_external"],
            LARGEST_DAMPING_PART,
            "damping took {} of the external work",
            "the mean forces over the stroke are too high by it" + _of_punch(summary),
            "process.mass_damping, process.damping_average, process.time",
        )


def _of_punch(summary: Mapping[str, Any]) -> str:
    """Say what damping and inertia take of the largest force of the punch."""
    loads = summary.get("tool_loads", {}).get(summary.get("punch", ""), {})
    parts = loads.get("parts_at_maximum")
    if parts is None:
        return ""
    return (
        f"; of the {parts['force_N']:.3g} N of {summary['punch']} around its maximum damping makes "
        f"{parts['damping_N']:.2g} N and inertia {parts['inertia_N']:.2g} N"
    )


def _hourglass(summary: Mapping[str, Any]) -> Iterator[Verdict]:
    if "hourglass_to_internal" in summary:
        yield _share(
            "Resolution by elements",
            summary["hourglass_to_internal"],
            LARGEST_HOURGLASS_PART,
            "the hourglass energy is {} of the internal energy",
            "the elements are too coarse for the radii of the tools",
            "blank.edge_length",
            worst=guards.LARGEST_HOURGLASS_PART,
        )


def _waves(sheet: xr.Dataset) -> Iterator[Verdict]:
    found = elements_per_wave(sheet)
    if found is None:
        return
    if not np.isfinite(found).any():
        yield Verdict("Resolution of wrinkles", GOOD, "the sheet has no waves")
        return
    few, none = (
        _area_where(sheet, found < count)
        for count in (LEAST_ELEMENTS_PER_WAVE, 0.5 * LEAST_ELEMENTS_PER_WAVE)
    )
    grade = BAD_GRADE if none > LOCAL_AREA else DOUBTFUL if few else GOOD
    text = (
        f"the shortest wave has {found.min():.1f} elements; {_area(few)} lies in waves of fewer "
        f"than {LEAST_ELEMENTS_PER_WAVE}"
    )
    remedy = "blank.edge_length" if grade != GOOD else ""
    yield Verdict("Resolution of wrinkles", grade, text, remedy)


# --- time -----------------------------------------------------------------------------------------


def _process_time(summary: Mapping[str, Any], scene: Scene) -> Iterator[Verdict]:
    needed = summary.get("process_time_needed_s")
    moved = scene.process.gravity or any(tool.motion.moves for tool in scene.tools)
    if needed is None or not moved:
        return
    time = scene.process.time
    grade = _grade(-time, -needed["least_s"], -needed["shear_period_s"])
    text = (
        f"{1e3 * time:.4g} ms; the sheet, whose slowest shear vibration takes "
        f"{milliseconds_text(needed['shear_period_s'])}, needs at least "
        f"{milliseconds_text(needed['least_s'])}"
    )
    if time >= needed["sufficient_s"]:
        text += "; nothing should change with a longer process"
    else:
        sufficient = milliseconds_text(needed["sufficient_s"])
        text += f", and from {sufficient} on nothing should change any more"
    yield Verdict("Process time", grade, text, "process.time" if grade != GOOD else "")


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


# --- contact --------------------------------------------------------------------------------------


def _penetration(summary: Mapping[str, Any], scene: Scene) -> Iterator[Verdict]:
    depths = summary.get("penetration_max_m")
    if not depths:
        return
    tool, depth = max(depths.items(), key=lambda item: item[1])
    thickness = scene.material.thickness
    limit = LARGEST_PENETRATION * thickness
    grade = _grade(depth, limit, guards.DEEPEST_PENETRATION * thickness)
    text = f"nodes reach up to {1e3 * depth:.3f} mm into {tool} (good up to {1e3 * limit:.2g} mm)"
    yield Verdict("Penetration", grade, text, "contact.penalty" if grade != GOOD else "")


# --- fields ---------------------------------------------------------------------------------------


def _fibre_strain(sheet: xr.Dataset, scene: Scene) -> Iterator[Verdict]:
    if not scene.material.has_fibres:
        return
    strain = np.abs([sheet[f"fibre_strain_{family}"].values[-1] for family in (1, 2)])
    largest = float(np.nanmax(strain))
    grade = _grade(largest, LARGEST_FIBRE_STRAIN, BAD * LARGEST_FIBRE_STRAIN)
    limit, breaking = percent(LARGEST_FIBRE_STRAIN), percent(BAD * LARGEST_FIBRE_STRAIN)
    text = (
        f"fibres are strained by up to {percent(largest)} (good up to {limit}; carbon fibres break "
        f"at {breaking})"
    )
    remedy = "blank.edge_length, contact.friction, tools.motion"
    yield Verdict("Fibre strain", grade, text, remedy if grade != GOOD else "")


def _shear(sheet: xr.Dataset, scene: Scene) -> Iterator[Verdict]:
    if not scene.material.has_fibres:
        return
    angle = np.abs(sheet["shear_angle"].values)
    found = f"sheared by up to {np.degrees(np.nanmax(angle)):.1f} deg"
    membrane = "material.membrane"
    tested, locking = (
        getattr(getattr(scene.material, "membrane", None), name, None)
        for name in ("shear_range", "locking_angle")
    )
    if tested is None and locking is None:
        text = f"{found}; the scene does not say up to which angle the shear law was measured"
        yield Verdict("Shear angle", NOT_JUDGED, text, f"{membrane}.shear_range")
        return
    grade = GOOD
    for limit, meaning in (
        (tested, "up to which the shear law was measured"),
        (locking, "where the fabric locks"),
    ):
        if limit is not None:
            part = _area_over(sheet, angle, limit)
            grade = max(grade, _grade(part, 0.0, LOCAL_AREA), key=GRADES.index)
            found += f"; {_area(part)} beyond {np.degrees(limit):.3g} deg, {meaning}"
    remedy = f"{membrane}.shear_range, {membrane}.locking_angle, tools.motion"
    yield Verdict("Shear angle", grade, found, remedy if grade != GOOD else "")


def _fibre_volume(sheet: xr.Dataset) -> Iterator[Verdict]:
    if "fibre_volume_fraction" not in sheet:
        return
    fraction = sheet["fibre_volume_fraction"].values
    thickness = 1e3 * sheet["thickness"].values
    part = _area_over(sheet, fraction, LARGEST_FIBRE_VOLUME_FRACTION)
    grade = _grade(part, 0.0, LOCAL_AREA)
    text = (
        f"thickness {np.nanmin(thickness):.3f} to {np.nanmax(thickness):.3f} mm and fibre volume "
        f"fraction up to {np.nanmax(fraction):.2f} in all frames; {_area(part)} above "
        f"{LARGEST_FIBRE_VOLUME_FRACTION:g}, to which round fibres can hardly be packed"
    )
    remedy = "tools.position, tools.motion, material.compaction, material.membrane.locking_angle"
    yield Verdict("Thickness and packing", grade, text, remedy if grade != GOOD else "")


def _area(part: float) -> str:
    return "nothing" if part == 0.0 else f"{percent(part)} of the area"


def _area_over(sheet: xr.Dataset, values: np.ndarray, limit: float) -> float:
    """Return the part of the undeformed area where values (F, face_count) ever exceed a limit."""
    return _area_where(sheet, np.any(values > limit, axis=0))


def _area_where(sheet: xr.Dataset, there: np.ndarray) -> float:
    areas = sheet_areas(sheet, 0)
    return float(areas[there].sum() / areas.sum())


# --- mapping --------------------------------------------------------------------------------------


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
