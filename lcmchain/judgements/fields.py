"""Where the fields of a result leave what holds: waves, strain of fibres, shear, packing.

Each has a warning, which a run gives with the value that cures it, or a verdict of the report, or
both side by side.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from lcmchain.fields.sheet import (
    face_centres,
    fibre_strains,
    sheet_areas,
    sheet_faces,
    sheet_positions,
)
from lcmchain.fields.stack import PLY
from lcmchain.fields.wrinkles import COMPRESSION, EXPECTED, LOCKING, RISK, WAVES, elements_per_wave
from lcmchain.judgements.crossings import crossing_warnings
from lcmchain.judgements.grades import (
    BAD_GRADE,
    DOUBTFUL,
    GOOD,
    GRADES,
    NOT_JUDGED,
    Verdict,
    grade_of,
)
from lcmchain.materials.features.pressure_table import PressureTable
from lcmchain.materials.features.shear_compaction import coupling_of
from lcmchain.materials.law import Material
from lcmchain.quantities.fields import NO_THICKNESS
from lcmchain.quantities.readable import millimetres, percent, two_digits_up
from lcmchain.scene import Scene
from lcmchain.thresholds import BAD, LARGEST_FIBRE_STRAIN, LEAST_ELEMENTS_PER_WAVE, LOCAL_AREA

if TYPE_CHECKING:
    import xarray as xr

    from lcmchain.scene import AnyMaterial

#: Fibre volume fraction above which round fibres can hardly be packed (hexagonal: 0.907).
LARGEST_FIBRE_VOLUME_FRACTION = 0.9
# Fibres that hardly strain could have any modulus: none lower than this part is recommended.
LEAST_FACTOR = 0.01


def field_warnings(sheet: xr.Dataset, material: Material) -> list[str]:
    """Say what the model does not predict, and where the fields leave its range."""
    missing = [] if "thickness" in sheet else [NO_THICKNESS]
    return [
        *missing,
        *packing_warnings(sheet, material),
        *shear_range_warnings(sheet, material),
        *compaction_range_warnings(sheet, material),
        *(wave_warnings(sheet) if "wrinkle_height" in sheet else []),
        *crossing_warnings(sheet, material.thickness),
    ]


def field_verdicts(sheet: xr.Dataset, scene: Scene) -> list[Verdict]:
    """Judge the fields of a result.

    Parameters
    ----------
    sheet : root group of ``forming.nc``. scene : of the run.
    """
    verdicts = [
        *_waves(sheet),
        *_wrinkle_risk(sheet),
        *fibre_strain_verdict(sheet, scene),
        *_shear(sheet, scene),
        *_fibre_volume(sheet),
    ]
    own_words = scene.stack.in_own_words
    return [verdict._replace(remedy_key=own_words(verdict.remedy_key)) for verdict in verdicts]


# --- wrinkles -------------------------------------------------------------------------------------


def wave_warnings(sheet: xr.Dataset, frame: int = -1) -> list[str]:
    """Say where waves of a frame have too few elements."""
    elements = elements_per_wave(sheet, frame)
    part = _area_where(sheet, elements < LEAST_ELEMENTS_PER_WAVE)
    if part == 0.0:
        return []
    place = millimetres(face_centres(sheet, formed=True)[int(np.argmin(elements))], 1)
    return [
        f"waves are unresolved: down to {elements.min():.1f} elements per wavelength, at {place}, "
        f"and fewer than {LEAST_ELEMENTS_PER_WAVE} in {part:.2%} of the area, so that their height "
        "and length are those of the mesh; use a smaller blank.edge_length"
    ]


def _waves(sheet: xr.Dataset) -> Iterator[Verdict]:
    if "wrinkle_height" not in sheet:  # a model that predicts no wrinkles
        return
    elements = elements_per_wave(sheet)
    if not np.isfinite(elements).any():
        yield Verdict("Resolution of wrinkles", GOOD, "the sheet has no waves")
        return
    few, none = (
        _area_where(sheet, elements < count)
        for count in (LEAST_ELEMENTS_PER_WAVE, 0.5 * LEAST_ELEMENTS_PER_WAVE)
    )
    grade = BAD_GRADE if none > LOCAL_AREA else DOUBTFUL if few else GOOD
    text = (
        f"the shortest wave has {elements.min():.1f} elements; {_area(few)} lies in waves of fewer "
        f"than {LEAST_ELEMENTS_PER_WAVE}"
    )
    remedy = "blank.edge_length" if grade != GOOD else ""
    yield Verdict("Resolution of wrinkles", grade, text, remedy)


def _wrinkle_risk(sheet: xr.Dataset) -> Iterator[Verdict]:
    """Say where wrinkles are to be expected; never bad, since it is a forecast."""
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


# --- strain of fibres -----------------------------------------------------------------------------


def fibre_strain_measures(sheet: xr.Dataset, scene: Scene) -> dict[str, Any]:
    """Return the largest fibre strain of all frames, and the modulus that it allows.

    Returns
    -------
    Under the names of ``summary.json``: ``fibre_modulus_factor``, ``fibre_strain_largest``
    (magnitude, of all families in all frames), ``fibre_strain_allowed`` and
    ``fibre_modulus_factor_possible``, with which the largest strain would come to what is allowed
    if the forces in the fibres stayed the same: an estimate, which holds for small strains. Nothing
    for a material without fibres.
    """
    if not scene.stack.has_fibres:
        return {}
    process = scene.process
    largest = float(np.nanmax(fibre_strains(sheet)))
    possible = process.fibre_modulus_factor * largest / process.fibre_strain_allowed
    possible = min(max(possible, LEAST_FACTOR), 1.0)
    return {
        "fibre_modulus_factor": process.fibre_modulus_factor,
        "fibre_strain_largest": largest,
        "fibre_strain_allowed": process.fibre_strain_allowed,
        "fibre_modulus_factor_possible": float(two_digits_up(possible)),
    }


def fibre_strain_warnings(measures: Mapping[str, Any]) -> list[str]:
    """Say in words where fibres strain by more than they bear, or than was allowed.

    The limit of the last frame (``fibre_strain_max``) is that of the report's verdict. With a
    lowered modulus the limit is what was allowed, in all frames.
    """
    factor = measures.get("fibre_modulus_factor", 1.0)
    if factor == 1.0 or measures["fibre_strain_largest"] <= measures["fibre_strain_allowed"]:
        return _beyond_what_fibres_bear(measures)
    possible = measures["fibre_modulus_factor_possible"]
    cure = "leave it out" if possible == 1.0 else f"use {possible:g}"
    largest = float(two_digits_up(measures["fibre_strain_largest"]))
    return [
        f"fibres strain by up to {100 * measures['fibre_strain_largest']:.2g} % (allowed: "
        f"{100 * measures['fibre_strain_allowed']:.2g} %) with process.fibre_modulus_factor = "
        f"{factor:g}: "
        f"{cure}, or state that this strain does no harm, process.fibre_strain_allowed = "
        f"{largest:g}"
    ]


def _beyond_what_fibres_bear(measures: Mapping[str, Any]) -> list[str]:
    largest = measures.get("fibre_strain_max", 0.0)
    if "fibre_modulus_factor" not in measures or not largest > LARGEST_FIBRE_STRAIN:
        return []
    return [
        f"fibres are strained by up to {100 * largest:.2g} % (good up to "
        f"{100 * LARGEST_FIBRE_STRAIN:g} %): the sheet is stretched between tools that hold it, or "
        "elements lock; lower the friction or the force that holds it, or use a smaller "
        "blank.edge_length"
    ]


def fibre_strain_verdict(sheet: xr.Dataset, scene: Scene) -> Iterator[Verdict]:
    """Judge the strain of the fibres in the last frame."""
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


# --- shear ----------------------------------------------------------------------------------------


def shear_range_warnings(sheet: xr.Dataset, material: Material) -> list[str]:
    """Say where the sheet was sheared beyond the range in which its law was measured."""
    if material.shear_range is None:
        return []
    angle = np.abs(sheet["shear_angle"].values)
    over = (angle > material.shear_range).any(axis=0)
    if not over.any():
        return []
    frame, worst = map(int, np.unravel_index(np.argmax(angle), angle.shape))
    return [
        f"the shear angle exceeds {np.degrees(material.shear_range):.3g} deg, up to which the "
        f"shear law was measured, in {_share(sheet, over)}, up to "
        f"{np.degrees(angle[frame, worst]):.1f} deg {_where(sheet, frame, worst)}: the law is "
        "extrapolated there, and neither the angle nor force, thickness and wrinkles that depend "
        "on it rest on a test; measure further, or state where the fabric locks "
        "(material.membrane.locking_angle)"
    ]


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
    words = f"sheared by up to {np.degrees(np.nanmax(angle)):.1f} deg"
    tested, locking = (
        getattr(getattr(material, "membrane", None), name, None)
        for name in ("shear_range", "locking_angle")
    )
    if tested is None and locking is None:
        text = f"{words}; the scene does not say up to which angle the shear law was measured"
        return Verdict(check, NOT_JUDGED, text, f"{membrane}.shear_range")
    grade = GOOD
    for limit, meaning in (
        (tested, "up to which the shear law was measured"),
        (locking, "where the fabric locks"),
    ):
        if limit is not None:
            part = _area_over(sheet, angle, limit)
            grade = max(grade, grade_of(part, 0.0, LOCAL_AREA), key=GRADES.index)
            words += f"; {_area(part)} beyond {np.degrees(limit):.3g} deg, {meaning}"
    remedy = f"{membrane}.shear_range, {membrane}.locking_angle, tools.motion"
    return Verdict(check, grade, words, remedy if grade != GOOD else "")


# --- thickness and packing ------------------------------------------------------------------------


def packing_warnings(sheet: xr.Dataset, material: Material) -> list[str]:
    """Say where fibres were packed more densely than they can be, in any frame.

    A sheet without a thickness is taken with its initial one.
    """
    if material.fibre_density is None:
        return []
    if "fibre_volume_fraction" in sheet:
        fraction = sheet["fibre_volume_fraction"].values
    else:
        full = material.fibre_density * material.thickness
        fraction = sheet["areal_fibre_mass"].values / full
    over = np.any(fraction > LARGEST_FIBRE_VOLUME_FRACTION, axis=0)
    if not over.any():
        return []
    frame, worst = map(int, np.unravel_index(np.argmax(fraction), fraction.shape))
    angle = np.degrees(np.abs(sheet["shear_angle"].values[frame, worst]))
    thickness = (
        f"thickness {1e3 * sheet['thickness'].values[frame, worst]:.3f} mm"
        if "thickness" in sheet
        else "at the initial thickness"
    )
    return [
        f"the fibre volume fraction exceeds {LARGEST_FIBRE_VOLUME_FRACTION:g} in "
        f"{_share(sheet, over)}, up to {fraction[frame, worst]:.2f} {_where(sheet, frame, worst)} "
        f"(shear angle {angle:.1f} deg, {thickness}), more than fibres can "
        "be packed to: the compaction law does not know the shear"
    ]


def compaction_range_warnings(sheet: xr.Dataset, material: Material) -> list[str]:
    """Say where the sheet left the table by which its shear and compaction are coupled."""
    table = coupling_of(material)
    if not isinstance(table, PressureTable) or "thickness" not in sheet:
        return []
    angle = np.abs(sheet["shear_angle"].values)
    stretch = sheet["thickness"].values / material.thickness
    sheared = angle > table.last_angle
    over = (sheared | table.beyond(stretch, np.sin(angle))).any(axis=0)
    if not over.any():
        return []
    return [
        f"{_share(sheet, over)} left the table of material.compaction.table, which ends at "
        f"{np.degrees(table.last_angle):.3g} deg of shear and {table.thinnest:.3g} of the free "
        f"thickness: {_share(sheet, sheared.any(axis=0))} by the shear, up to "
        f"{np.degrees(angle.max()):.1f} deg. Pressures are extrapolated there; measure further"
    ]


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


# --- where and how much ---------------------------------------------------------------------------


def _share(sheet: xr.Dataset, over: np.ndarray) -> str:
    """Return how many elements and how much of the undeformed area, in words."""
    count = int(over.sum())
    elements = "element" if count == 1 else "elements"
    return f"{count} {elements} ({_area_where(sheet, over):.2%} of the area)"


def _where(sheet: xr.Dataset, frame: int, element: int) -> str:
    corners = np.unique(sheet_faces(sheet)[element])
    place = millimetres(sheet_positions(sheet, frame)[corners].mean(axis=0), 1)
    time = 1e3 * float(sheet["time"].values[frame])
    return f"in element {element} at {place} at {time:.4g} ms"


def _area(part: float) -> str:
    """Return a part of the area in words."""
    return "nothing" if part == 0.0 else f"{percent(part)} of the area"


def _area_over(sheet: xr.Dataset, values: np.ndarray, limit: float) -> float:
    """Return the part of the undeformed area where values (F, face_count) ever exceed a limit."""
    return _area_where(sheet, np.any(values > limit, axis=0))


def _area_where(sheet: xr.Dataset, there: np.ndarray) -> float:
    """Return the part of the undeformed area in some faces (face_count,)."""
    areas = sheet_areas(sheet, 0)
    return float(areas[there].sum() / areas.sum())
