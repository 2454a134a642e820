"""The fields of a forming result, declared as data: name, unit, place and meaning.

All that depends on the kind of a field alone follows from its entry here: the variables of the
files, the names that no ply may have, how it is mapped, and its extrema in ``summary.json``.
"""

from __future__ import annotations

from dataclasses import dataclass

FACE, NODE = "face", "node"

#: How the mapping carries a field to other meshes.
MEAN, TOTAL, ANGLE_ABOUT_NORMAL = "mean", "total", "angle about the normal"

#: Extrema of a field in ``summary.json``; the size is the largest magnitude.
LEAST, MOST, SIZE = "min", "max", "size"


@dataclass(frozen=True)
class Field:
    """One field of the result files.

    Parameters
    ----------
    name : as in all files; the components of a vector end in ``_x``, ``_y`` and ``_z``.
    units : SI unit as CF writes it.
    long_name : name in words.
    location : ``"face"`` (one value per element) or ``"node"``.
    meaning : definition, for readers of the file.
    is_vector : whether the field has three components.
    mapped : ``MEAN``, ``TOTAL`` (an amount per area, whose total is kept) or
        ``ANGLE_ABOUT_NORMAL`` (changes its sign, seen from the other side).
    extrema : those in ``summary.json``, of ``LEAST``, ``MOST`` and ``SIZE``.
    """

    name: str
    units: str
    long_name: str
    location: str
    meaning: str
    is_vector: bool = False
    mapped: str = MEAN
    extrema: tuple[str, ...] = ()

    @property
    def variables(self) -> tuple[str, ...]:
        """Names of the variables that hold the field."""
        return tuple(f"{self.name}_{axis}" for axis in "xyz") if self.is_vector else (self.name,)

    def extremum(self, kind: str) -> str:
        """Name of an extremum in ``summary.json``, as ``thickness_min_m``."""
        unit = "" if self.units == "1" else f"_{self.units.replace(' ', '_')}"
        return f"{self.name}_{MOST if kind == SIZE else kind}{unit}"

    def attributes(self, variable: str) -> dict[str, str]:
        """Unit, name and definition of one of :attr:`variables`."""
        component = f", {variable[-1]} component" if self.is_vector else ""
        return {
            "units": self.units,
            "long_name": self.long_name + component,
            "comment": self.meaning,
        }


# Fields of the faces that plies turn to each other: name without the face, unit, name in words,
# definition, and whether it is a vector.
_BETWEEN_PLIES = (
    (
        "ply_pressure",
        "Pa",
        "pressure of other plies on the",
        "of a stack of plies: force of other plies on the node of the upper face along the normal, "
        "over the present area of the mid-surface that belongs to it, a quarter of each face "
        "around; negative where they pull. Both faces of an interface have the same force",
        False,
    ),
    (
        "ply_shear_stress",
        "Pa",
        "shear stress of other plies on the",
        "of a stack of plies: force of other plies on the node of the upper face along the face, "
        "over the same area",
        True,
    ),
    (
        "ply_gap",
        "m",
        "gap to another ply from the",
        "of a stack of plies: distance of the node of the upper face from the smooth surface of "
        "the ply that it faces, negative for a depth; not a number where it faces none within "
        "the thickness of the thinner ply or the reach of a law",
        False,
    ),
    (
        "slip",
        "m",
        "slip on other plies of the",
        "of a stack of plies: how far the node of the upper face has slid since the start on the "
        "plies that it touched, which it does up to a gap of a tenth of the thickness of the "
        "thinner ply or the reach of a law; the sum of the ways, which turns with the surface",
        True,
    ),
    (
        "slip_path",
        "m",
        "slip path on other plies of the",
        "of a stack of plies: length of the way that the node of the upper face has slid since the "
        "start, to and fro, while it touched another ply as for slip_top",
        False,
    ),
    (
        "ply_contact",
        "1",
        "contact with another ply of the",
        "of a stack of plies: what the node of the upper face did in the last step; apart: it "
        "felt no force of the ply that it faces, sticks: it was held against sliding, slides: its "
        "slip took energy, or nothing resisted it",
        False,
    ),
    (
        "faced_ply",
        "1",
        "number of the ply faced by the",
        "of a stack of plies: which one lies at the node of the upper face, -1 for none",
        False,
    ),
)

_FIELDS = (
    Field(
        "thickness",
        "m",
        "thickness",
        FACE,
        "distance of the top from the bottom face along the normal of the mid-surface, at the "
        "element centre",
        extrema=(LEAST, MOST),
    ),
    Field(
        "fibre_volume_fraction",
        "1",
        "fibre volume fraction",
        FACE,
        "volume of the fibres per volume of the textile: the initial fraction, areal mass / "
        "(fibre density * thickness), divided by the determinant of the deformation gradient",
        extrema=(MOST,),
    ),
    Field(
        "areal_fibre_mass",
        "kg m-2",
        "fibre mass per area",
        FACE,
        "fibre mass per current area of the mid-surface; the area of a face is half the length of "
        "the cross product of its diagonals, and the sum of the products is the fibre mass",
        mapped=TOTAL,
    ),
    Field(
        "shear_angle",
        "rad",
        "shear angle",
        FACE,
        "a right angle minus the angle from fibre 1 to fibre 2 about the normal of the sheet: "
        "positive where the angle between the fibres has become smaller. Of families that were at "
        "another angle, that angle takes the place of the right one; of a single family it is the "
        "angle to the material line that was across the fibres",
        mapped=ANGLE_ABOUT_NORMAL,
        extrema=(SIZE,),
    ),
    *(
        Field(
            f"shear_angle_{first}{second}",
            "rad",
            f"shear angle of the fibres {first} and {second}",
            FACE,
            f"of a fabric with three families, as shear_angle from fibre {first} to fibre {second}",
            mapped=ANGLE_ABOUT_NORMAL,
        )
        for first, second in ((2, 3), (3, 1))
    ),
    Field(
        "fibre_direction_1",
        "1",
        "direction of fibre 1",
        FACE,
        "unit vector along the first fibre family in the formed textile",
        is_vector=True,
    ),
    Field(
        "fibre_direction_2",
        "1",
        "direction of fibre 2",
        FACE,
        "unit vector along the second fibre family in the formed textile",
        is_vector=True,
    ),
    Field(
        "fibre_direction_3",
        "1",
        "direction of fibre 3",
        FACE,
        "unit vector along the third fibre family in the formed textile",
        is_vector=True,
    ),
    Field(
        "fibre_strain_1",
        "1",
        "strain of fibre 1",
        FACE,
        "current length over initial length of the first fibre family, minus one",
    ),
    Field(
        "fibre_strain_2",
        "1",
        "strain of fibre 2",
        FACE,
        "current length over initial length of the second fibre family, minus one",
    ),
    Field(
        "fibre_strain_3",
        "1",
        "strain of fibre 3",
        FACE,
        "current length over initial length of the third fibre family, minus one",
    ),
    Field(
        "strain_across",
        "1",
        "strain across the fibres",
        FACE,
        "of a fabric with one family: current length over initial length of the material line that "
        "was across the fibres, minus one; positive where gaps open between them",
    ),
    Field(
        "compaction_pressure",
        "Pa",
        "compaction pressure",
        FACE,
        "what presses the element together from outside, the mean of both faces over the present "
        "area of the mid-surface, from the forces of the element; zero in a freely bent sheet, "
        "negative where the faces are pulled apart",
    ),
    Field(
        "bending_pressure",
        "Pa",
        "pressure of bending",
        FACE,
        "what presses the element together from within, above all the bending, whose energy falls "
        "with the thickness; with the compaction pressure it is minus the Cauchy stress normal to "
        "the sheet",
    ),
    Field(
        "pore_pressure",
        "Pa",
        "pore pressure",
        FACE,
        "pressure of the fluid in the pores of the element relative to that of the surroundings; "
        "with the compaction pressure, which the fibres bear, it is what presses on both faces",
    ),
    Field(
        "wrinkle_risk",
        "1",
        "wrinkle risk",
        FACE,
        "largest of its parts wrinkle_risk_compression, wrinkle_risk_locking and "
        "wrinkle_risk_waves; from 1 on wrinkles are to be expected, which a coarse mesh may hide",
    ),
    Field(
        "wrinkle_risk_compression",
        "1",
        "wrinkle risk by compressed fibres",
        FACE,
        "mean compressive strain of a family of fibres over the longest wave that counts as "
        "wrinkle, over the strain at which a strip of the fabric buckles to that wave; 0 in "
        "tension, and where a tool is nearer than the thickness",
    ),
    Field(
        "wrinkle_risk_locking",
        "1",
        "nearness of locking",
        FACE,
        "shear angle over the one from which on the law locks; of the nearest pair of families",
    ),
    Field(
        "wrinkle_risk_waves",
        "1",
        "wrinkle risk by unresolved waves",
        FACE,
        "least elements that resolve a wave, 8, over those of the shortest wave along a fibre "
        "there; 0 without a wave, and where a tool is nearer than the thickness",
    ),
    Field(
        "stack_thickness",
        "m",
        "thickness of the stack",
        FACE,
        "of a stack of plies: thicknesses of all plies that the normal through the centre of the "
        "face meets, its own among them, gaps left out",
    ),
    Field(
        "stack_areal_fibre_mass",
        "kg m-2",
        "fibre mass per area of the stack",
        FACE,
        "of a stack of plies: areal fibre masses of the same plies",
    ),
    Field(
        "stack_fibre_volume_fraction",
        "1",
        "fibre volume fraction of the stack",
        FACE,
        "of a stack of plies: volume of the fibres of the same plies over their thickness",
    ),
    Field(
        "stack_ply_count",
        "1",
        "number of plies",
        FACE,
        "of a stack of plies: how many lie over each other at the face",
    ),
    *(
        Field(
            f"permeability_{number}",
            "m2",
            f"principal permeability {number}",
            FACE,
            meaning,
        )
        for number, meaning in (
            (1, "larger principal permeability in the plane of the sheet"),
            (2, "smaller principal permeability in the plane of the sheet"),
            (3, "permeability through the thickness"),
        )
    ),
    *(
        Field(
            f"permeability_direction_{number}",
            "1",
            f"direction of principal permeability {number}",
            FACE,
            meaning,
            is_vector=True,
        )
        for number, meaning in (
            (1, "unit vector without a sense, in the plane of the sheet"),
            (2, "unit vector without a sense, in the plane of the sheet, across the first"),
            (3, "unit vector without a sense, along the normal of the sheet"),
        )
    ),
    Field(
        "tool_pressure_top",
        "Pa",
        "pressure of the tools on the upper face",
        NODE,
        "normal contact forces of all tools on the node of the upper face, over the present area "
        "of the mid-surface that belongs to it, a quarter of each face around",
    ),
    Field(
        "tool_pressure_bottom",
        "Pa",
        "pressure of the tools on the lower face",
        NODE,
        "as tool_pressure_top, of the node of the lower face",
    ),
    Field(
        "tool_pressure",
        "Pa",
        "pressure of the tools",
        NODE,
        "as tool_pressure_top, of the nodes of the solid, each of which lies on one face; on the "
        "mid-surface of the 2D approach the sum of what presses from above and below",
    ),
    *(
        Field(
            f"{stem}_{side}",
            units,
            f"{long_name} {face} face",
            NODE,
            meaning if side == "top" else f"as {stem}_top, of the node of the lower face",
            is_vector=is_vector,
        )
        for stem, units, long_name, meaning, is_vector in _BETWEEN_PLIES
        for side, face in (("top", "upper"), ("bottom", "lower"))
    ),
    Field(
        "wrinkle_height",
        "m",
        "height of wrinkles",
        NODE,
        "distance of the mid-surface from a smoothed copy of itself, along the normal of the copy, "
        "positive towards the upper face; waves up to output.wrinkle_length are smoothed away. At "
        "most the clear distance to the tool below a crest or above a trough: a sheet that lies on "
        "a tool has the tool's shape",
        extrema=(SIZE,),
    ),
    Field(
        "springback",
        "m",
        "springback",
        NODE,
        "distance from where the node was at the end of the stage that stages.springback_from "
        "names, without the motion of the sheet as a whole: the best fit of both shapes is taken "
        "off; 0 before",
    ),
    Field(
        "displacement",
        "m",
        "displacement",
        NODE,
        "current minus reference position",
        is_vector=True,
    ),
    Field(
        "reference_position",
        "m",
        "reference position",
        NODE,
        "position before forming; the coordinates of the mesh are those of the last frame",
        is_vector=True,
    ),
)

#: Every field by name.
FIELDS: dict[str, Field] = {field.name: field for field in _FIELDS}

#: The field that each variable of the files belongs to.
FIELD_OF_VARIABLE: dict[str, Field] = {
    variable: field for field in _FIELDS for variable in field.variables
}

#: Most families of fibres that a result tells of; a single one has no second direction.
MOST_FAMILIES = 3

#: Fields that are sums over the plies of a stack: what is mapped ply by ply adds them up itself.
OF_STACK = tuple(name for name in FIELDS if name.startswith("stack_"))

#: Fields of the faces that plies turn to each other.
BETWEEN_PLIES = tuple(f"{stem}_{side}" for stem, *_ in _BETWEEN_PLIES for side in ("top", "bottom"))

#: What a result of the 2D approach says about the thickness, in the file and in its summary.
NO_THICKNESS = (
    'element = "membrane-shell" predicts no thickness, and therefore no fibre volume fraction, no '
    "compaction pressure and no permeability"
)
