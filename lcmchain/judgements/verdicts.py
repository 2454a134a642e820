"""A verdict on a result for every check: good, doubtful or bad, in words, with what to change.

A check is doubtful where the summary warns of it, since both read the same threshold, and bad
where the number is :data:`lcmchain.thresholds.BAD` times as large, where a guard would stop a run,
or as the check itself says. The depth between plies is judged here alone: single nodes at the rim
of a ply exceed it for a moment, of which a run need not warn.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from lcmchain.fields.dataset import SHEET
from lcmchain.fields.limits import LARGEST_FIBRE_VOLUME_FRACTION
from lcmchain.fields.sheet import face_centres, sheet_areas
from lcmchain.fields.stack import PLY
from lcmchain.fields.wrinkle_risk import COMPRESSION, EXPECTED, LOCKING, RISK, WAVES
from lcmchain.fields.wrinkles import area_in_waves_below, elements_per_wave
from lcmchain.judgements.contact import (
    hidden_compaction_verdict,
    penetration_verdict,
    ply_depth_verdict,
)
from lcmchain.judgements.fibre_strain import fibre_strain_verdict
from lcmchain.judgements.grades import (
    BAD_GRADE,
    DOUBTFUL,
    GOOD,
    GRADES,
    NOT_JUDGED,
    Verdict,
    grade_of,
)
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
from lcmchain.quantities.readable import millimetres, percent
from lcmchain.results import COMPLETE
from lcmchain.thresholds import (
    LARGEST_TARGET_DISTANCE,
    LEAST_ELEMENTS_PER_WAVE,
    LOCAL_AREA,
)

if TYPE_CHECKING:
    import xarray as xr

    from lcmchain.scene import AnyMaterial, Scene


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


# --- fields of the sheet --------------------------------------------------------------------------


def field_verdicts(sheet: xr.Dataset, scene: Scene) -> list[Verdict]:
    """Judge the fields of a result.

    Parameters
    ----------
    sheet : root group of ``forming.nc``. scene : of the run.
    """
    found = [
        *_waves(sheet),
        *_wrinkle_risk(sheet),
        *fibre_strain_verdict(sheet, scene),
        *_shear(sheet, scene),
        *_fibre_volume(sheet),
    ]
    own_words = scene.stack.in_own_words
    return [verdict._replace(remedy_key=own_words(verdict.remedy_key)) for verdict in found]


def _waves(sheet: xr.Dataset) -> Iterator[Verdict]:
    if "wrinkle_height" not in sheet:  # a model that predicts no wrinkles
        return
    found = elements_per_wave(sheet)
    if not np.isfinite(found).any():
        yield Verdict("Resolution of wrinkles", GOOD, "the sheet has no waves")
        return
    few, none = (
        area_in_waves_below(sheet, found, count)
        for count in (LEAST_ELEMENTS_PER_WAVE, 0.5 * LEAST_ELEMENTS_PER_WAVE)
    )
    grade = BAD_GRADE if none > LOCAL_AREA else DOUBTFUL if few else GOOD
    text = (
        f"the shortest wave has {found.min():.1f} elements; {_area(few)} lies in waves of fewer "
        f"than {LEAST_ELEMENTS_PER_WAVE}"
    )
    remedy = "blank.edge_length" if grade != GOOD else ""
    yield Verdict("Resolution of wrinkles", grade, text, remedy)


def _wrinkle_risk(sheet: xr.Dataset) -> Iterator[Verdict]:
    """Say where to look; never bad, for it is a forecast."""
    if RISK not in sheet:
        return
    last = sheet.isel(time=-1)
    areas = {
        name: _area_where(sheet, last[name].values >= EXPECTED)
        for name in (RISK, COMPRESSION, LOCKING, WAVES)
        if name in last
    }
    if areas[RISK] == 0.0:
        yield Verdict("Wrinkle risk", GOOD, "no wrinkles are to be expected beside those shown")
        return
    words = {COMPRESSION: "compressed fibres", LOCKING: "locking", WAVES: "waves of few elements"}
    causes = [f"{_area(areas[name])} by {word}" for name, word in words.items() if areas.get(name)]
    place = millimetres(face_centres(sheet, formed=True)[int(np.nanargmax(last[RISK].values))], 1)
    text = (
        f"wrinkles are to be expected in {_area(areas[RISK])} ({', '.join(causes)}), most at "
        f"{place}; this mesh may hide them"
    )
    grade = grade_of(areas[RISK], LOCAL_AREA, 1.0)
    yield Verdict("Wrinkle risk", grade, text, "blank.edge_length" if grade != GOOD else "")


def _shear(sheet: xr.Dataset, scene: Scene) -> Iterator[Verdict]:
    """Judge the shear of every fabric by its own law."""
    stack = scene.stack
    materials = {key: own for key, own in stack.materials.items() if own.has_fibres}
    for key, material in materials.items():
        plies = [number for number, ply in enumerate(stack) if ply.material_key == key]
        faces = np.ones(sheet.sizes["sheet_face"], dtype=bool)
        if PLY in sheet:
            faces = np.isin(sheet[PLY].values, plies)
        check = "Shear angle" if len(materials) == 1 else f"Shear angle of {material.name}"
        yield _shear_of(sheet, faces, check, f"{key}.membrane", material)


def _shear_of(
    sheet: xr.Dataset, faces: np.ndarray, check: str, membrane: str, material: AnyMaterial
) -> Verdict:
    """Judge the shear of some faces (face_count,).

    membrane : scene entry of the law in the plane.
    """
    angle = np.where(faces, np.abs(sheet["shear_angle"].values), np.nan)
    found = f"sheared by up to {np.degrees(np.nanmax(angle)):.1f} deg"
    tested, locking = (
        getattr(getattr(material, "membrane", None), name, None)
        for name in ("shear_range", "locking_angle")
    )
    if tested is None and locking is None:
        text = f"{found}; the scene does not say up to which angle the shear law was measured"
        return Verdict(check, NOT_JUDGED, text, f"{membrane}.shear_range")
    grade = GOOD
    for limit, meaning in (
        (tested, "up to which the shear law was measured"),
        (locking, "where the fabric locks"),
    ):
        if limit is not None:
            part = _area_over(sheet, angle, limit)
            grade = max(grade, grade_of(part, 0.0, LOCAL_AREA), key=GRADES.index)
            found += f"; {_area(part)} beyond {np.degrees(limit):.3g} deg, {meaning}"
    remedy = f"{membrane}.shear_range, {membrane}.locking_angle, tools.motion"
    return Verdict(check, grade, found, remedy if grade != GOOD else "")


def _fibre_volume(sheet: xr.Dataset) -> Iterator[Verdict]:
    if "fibre_volume_fraction" not in sheet:
        return
    fraction = sheet["fibre_volume_fraction"].values
    thickness = 1e3 * sheet["thickness"].values
    part = _area_over(sheet, fraction, LARGEST_FIBRE_VOLUME_FRACTION)
    grade = grade_of(part, 0.0, LOCAL_AREA)
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
