"""Verdicts on the fields of a result: waves, fibres, shear, thickness and packing."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from lcmchain.fields.limits import LARGEST_FIBRE_VOLUME_FRACTION
from lcmchain.fields.sheet import face_centres, fibre_strains, sheet_areas
from lcmchain.fields.stack import PLY
from lcmchain.fields.wrinkle_risk import COMPRESSION, EXPECTED, LOCKING, RISK, WAVES
from lcmchain.fields.wrinkles import area_in_waves_below, elements_per_wave
from lcmchain.quantities.places import millimetres
from lcmchain.report.grades import (
    BAD_GRADE,
    DOUBTFUL,
    GOOD,
    GRADES,
    NOT_JUDGED,
    Verdict,
    grade_of,
    percent,
)
from lcmchain.thresholds import (
    BAD,
    LARGEST_FIBRE_STRAIN,
    LEAST_ELEMENTS_PER_WAVE,
    LOCAL_AREA,
)

if TYPE_CHECKING:
    import xarray as xr

    from lcmchain.scene import AnyMaterial, Scene


def field_verdicts(sheet: xr.Dataset, scene: Scene) -> list[Verdict]:
    """Judge the fields of a result.

    Parameters
    ----------
    sheet : root group of ``forming.nc``. scene : of the run.
    """
    found = [
        *_waves(sheet),
        *_wrinkle_risk(sheet),
        *_fibre_strain(sheet, scene),
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


def _fibre_strain(sheet: xr.Dataset, scene: Scene) -> Iterator[Verdict]:
    if not scene.stack.has_fibres:
        return
    largest = float(np.nanmax(fibre_strains(sheet)[:, -1]))
    grade = grade_of(largest, LARGEST_FIBRE_STRAIN, BAD * LARGEST_FIBRE_STRAIN)
    limit, breaking = percent(LARGEST_FIBRE_STRAIN), percent(BAD * LARGEST_FIBRE_STRAIN)
    text = (
        f"fibres are strained by up to {percent(largest)} (good up to {limit}, bad above "
        f"{breaking}, where the most brittle ones break: carbon; glass and aramid bear more)"
    )
    remedy = "blank.edge_length, contact.friction, tools.motion"
    yield Verdict("Fibre strain", grade, text, remedy if grade != GOOD else "")


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
