"""Whether resin can flow through every cell of a formed part."""

from __future__ import annotations

import numpy as np

from lcmchain.coupling.infiltration.formed_part import NEEDED, FormedPart
from lcmchain.errors import InputError, first_few


def require_permeable(part: FormedPart) -> None:
    """Refuse cells through which nothing can flow.

    Raises
    ------
    InputError : a cell without thickness (unmapped), with no pores, or whose permeability is
        unknown, zero or negative; names the first cells and where the worst one lies.
    """
    thickness, fraction = (part.cell(name) for name in NEEDED)
    remedy = (
        "trim the mesh to the sheet, or map with a larger maximum distance",
        "the compaction law lets the textile become denser than its fibres: check it, the areal "
        "mass and the fibre density, or give a [[regions]] entry there",
        "the fibre volume fraction is out of the range of the permeability law: use another law "
        "or packing (hexagonal reaches 0.907), or a [[regions]] entry with a "
        "fibre_volume_fraction there",
        "nothing can flow there; check the law, or the file that it comes from",
        "check the file; of an open channel beside the textile make a [[race_tracks]] entry",
    )
    smaller = part.cell("permeability_2")
    larger = part.cell("permeability_1")
    _refuse(part, ~(np.isfinite(thickness) & np.isfinite(fraction)), "have no thickness: no sheet "
            "lies near them", fraction, "", remedy[0])  # fmt: skip
    _refuse(part, thickness <= 0.0, "have a thickness that is not positive", thickness, "m",
            remedy[0])  # fmt: skip
    _refuse(part, fraction >= 1.0, "have a fibre volume fraction of one or more, so no pores",
            -fraction, "", remedy[1])  # fmt: skip
    _refuse(part, fraction <= 0.0, "have a fibre volume fraction of zero or less, so no textile",
            fraction, "", remedy[4])  # fmt: skip
    _refuse(part, ~(np.isfinite(smaller) & np.isfinite(larger)), "have no permeability",
            -fraction, "fibre volume fraction", remedy[2])  # fmt: skip
    _refuse(part, np.minimum(smaller, larger) <= 0.0, "have a permeability of zero or less",
            np.minimum(smaller, larger), "m2", remedy[3])  # fmt: skip


def _refuse(
    part: FormedPart, bad: np.ndarray, what: str, order: np.ndarray, unit: str, remedy: str
) -> None:
    """Raise an error about bad cells, of which the worst has the lowest value of ``order``."""
    cells = np.flatnonzero(bad)
    if len(cells) == 0:
        return
    known = np.where(np.isfinite(order[cells]), order[cells], np.inf)
    worst = int(cells[np.argmin(known)])
    value = ""
    if np.isfinite(order[worst]):
        number = abs(order[worst]) if unit in ("", "fibre volume fraction") else order[worst]
        value = f" with {f'{unit} ' if unit.startswith('fibre') else ''}{number:.4g}"
        value += f" {unit}" if unit in ("m", "m2") else ""
    raise InputError(
        f"{len(cells)} of {part.target.cell_count} cells {what} "
        f"({first_few(part.target.cell_ids[cells])}; the worst is {part.place(worst)}{value}); "
        f"{remedy}",
        file=part.file,
    )
