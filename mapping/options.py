"""What a mapping may be told, in one place for the command, for scenes and for Python."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class MappingOptions:
    """How a forming result is mapped onto a mesh.

    Parameters
    ----------
    kind : ``"infiltration"`` (surface cells) or ``"structure"`` (solids, else shells).
    method : ``"overlap"`` or ``"closest"``.
    order : 1 takes a field as constant within each face of the sheet, 2 as linear.
    maximum_distance : how far [m] from the sheet a cell may lie, by default one edge length of
        the sheet, or the radius of a typical cell where that is larger.
    length_unit : unit of the target's coordinates; what is written is in metres.
    frame : saved frame to map, counted from 0, or backwards from -1, the last one.
    time : of the saved state [s], the nearest is taken; instead of ``frame``.
    all_frames : carry the target along with the material and write every saved state, with the
        weights of the one that is mapped.
    register : map as if the target lay where a small rigid motion brings it to the sheet; what is
        written keeps the target's own coordinates.
    verify : estimate the error that the mapping adds to every field; takes some ten times as long.
    thickness_limit : largest relative difference of the thickness of a solid from the formed one.
    allow_unmapped : write cells without a sheet nearby as not-a-number instead of failing.
    allow_ambiguous : take the nearer of two layers of the sheet that lie about as near instead of
        failing.
    allow_incomplete : map the fields of a run that did not come to its end, with a warning,
        instead of refusing them.
    weights_file : ``.npz`` with stored weights: used where it exists, else written.
    picture : draw source and target side by side.
    exports : formats of other programs to write beside the mapped file, by their names in
        :data:`lcmchain.mapping.formats.FORMATS`.
    """

    kind: str = "structure"
    method: str = "overlap"
    order: int = 2
    maximum_distance: float | None = None
    length_unit: str = "m"
    frame: int = -1
    time: float | None = None
    all_frames: bool = False
    register: bool = False
    verify: bool = False
    thickness_limit: float = 0.1
    allow_unmapped: bool = False
    allow_ambiguous: bool = False
    allow_incomplete: bool = False
    weights_file: Path | str | None = None
    picture: bool = True
    exports: tuple[str, ...] = ()
