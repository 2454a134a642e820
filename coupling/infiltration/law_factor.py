"""How the permeability follows the fibre volume fraction where its law is known."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lcmchain.coupling.infiltration.formed_part import FormedPart
from lcmchain.coupling.infiltration.preform import PermeabilityFactor, kozeny_factor
from lcmchain.coupling.permeability import law_of
from lcmchain.errors import SimulationError
from lcmchain.mapping.sheet import FIBRE_FAMILIES
from lcmchain.scene.origin import formed_permeability
from lcmchain.scene.permeability import Permeability


class LawFactor:
    """Factor on the permeabilities of cells by a law: of the sum of both values in the plane.

    Parameters
    ----------
    law : of the scene. part : with the fibre directions of its cells.
    directory : folder to which a file that the law names is relative.
    """

    def __init__(self, law: Permeability, part: FormedPart, directory: Path | None) -> None:
        self.law, self.part = law_of(law, directory), part
        self._families = [
            np.stack([part.cell(f"{family}_{axis}") for axis in "xyz"], axis=1)
            for family in FIBRE_FAMILIES
        ]

    def __call__(self, now: np.ndarray, before: np.ndarray) -> np.ndarray:
        """Return the factors (C,) for fibre volume fractions (C,) now and in the beginning.

        Raises
        ------
        SimulationError : a fibre volume fraction is out of the range of the law.
        """
        return self._in_plane(now) / self._in_plane(before)

    def _in_plane(self, fraction: np.ndarray) -> np.ndarray:
        found = self.law.principal(fraction, *self._families, out_of_range="nan")
        total = found.k1 + found.k2
        unknown = np.flatnonzero(~(total > 0.0))
        if len(unknown):
            cell = int(unknown[0])
            raise SimulationError(
                f"{self.part.place(cell)} is compacted to a fibre volume fraction of "
                f"{fraction[cell]:.4g}, where the permeability law gives no value "
                f"({len(unknown)} cells); use a law that holds there, or close the tool less far"
            )
        return total


def factor_of(
    part: FormedPart, law: Permeability | None, directory: Path | None
) -> PermeabilityFactor:
    """Return how the permeability of a part follows its compaction.

    That is by the law of the case, or else by that of the scene that formed the part. Where there
    is none, or where it is in a file that is not at hand, it is by Kozeny and Carman.
    """
    if law is None:
        law = formed_permeability(str(part.dataset.attrs.get("scene") or ""))
        if getattr(law, "file", None) is not None:
            law = None
    return kozeny_factor if law is None else LawFactor(law, part, directory)
