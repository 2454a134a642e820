"""Whether fibres strain by more than they bear, or than was allowed with a lowered modulus."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from lcmchain.fields.sheet import fibre_strains
from lcmchain.judgements.grades import GOOD, Verdict, grade_of
from lcmchain.quantities.readable import percent, two_digits_up
from lcmchain.scene import Scene
from lcmchain.thresholds import BAD, LARGEST_FIBRE_STRAIN

if TYPE_CHECKING:
    import xarray as xr

# Fibres that hardly strain could have any modulus: none lower than this part is recommended.
LEAST_FACTOR = 0.01


def fibre_strain_measures(sheet: xr.Dataset, scene: Scene) -> dict[str, Any]:
    """Return the largest fibre strain of all frames and what it says of the modulus.

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
