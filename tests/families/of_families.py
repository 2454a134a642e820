"""Fabrics of one, two and three families for the tests; the numbers are nobody's."""

from __future__ import annotations

from typing import Any

from lcmchain.materials.fibre_families import FibreFamiliesMaterial

COMMON: dict[str, Any] = {
    "thickness": "1.004 mm",
    "areal_mass": "600 g/m^2",
    "fibre_density": "1810 kg/m^3",
    "membrane": {"C23": "0.1 MPa", "C13": "0.1 MPa"},
    "compaction": {"c0": "0.1563 MPa", "c1": 60.4653, "c2": 2.4528},
    "bending": {"C33": "0.1 MPa", "C23": "0.1 MPa", "C13": "0.1 MPa", "in_plane": 0.0},
}
MD600_SHEAR = "0.1919 -2.3637 14.7593 -40.7199 42.3208 MPa"


def fibres(angle: float, tension=1000.0, compression=1000.0, bending=40.0) -> dict[str, Any]:
    """A family at an angle [deg], moduli in MPa."""
    return {
        "angle": f"{angle} deg",
        "tension": None if tension is None else f"{tension} MPa",
        "compression": f"{compression} MPa",
        "bending": f"{bending} MPa",
    }


def pair(first: int, second: int, shear=MD600_SHEAR, **entries: Any) -> dict[str, Any]:
    """Shear between two families."""
    return {
        "between": [first, second], "shear_polynomial": shear, "torsion": "4.2123 MPa"
    } | entries  # fmt: skip


def across(**entries: Any) -> dict[str, Any]:
    """What holds a single family together."""
    return {
        "tension": "2 MPa",
        "compression": "0.5 MPa",
        "bending": "1 MPa",
        "shear_polynomial": "0.2 0 1 0 0 MPa",
        "torsion": "2 MPa",
    } | entries


def fabric(*families: dict, **entries: Any) -> FibreFamiliesMaterial:
    """A fabric of families, with entries replaced."""
    given = [{k: v for k, v in family.items() if v is not None} for family in families]
    return FibreFamiliesMaterial.model_validate({"fibres": given} | COMMON | entries)


def unidirectional(angle=0.0, **entries: Any) -> FibreFamiliesMaterial:
    """One family, soft in compression."""
    return fabric(fibres(angle, compression=20.0), across=across(), **entries)


def like_md600(turn=0.0, **of_pair: Any) -> FibreFamiliesMaterial:
    """Two families at a right angle that are MD600, turned in the ply."""
    return fabric(
        fibres(turn, bending=38.0615),
        fibres(turn + 90.0, bending=43.0668),
        shear=[pair(1, 2, **of_pair)],
    )


def triaxial(turn=0.0, *, compression=1000.0, shear=()) -> FibreFamiliesMaterial:
    """Three equal families at 0, 60 and -60 degrees."""
    return fabric(
        *(fibres(turn + angle, compression=compression) for angle in (0.0, 60.0, -60.0)),
        shear=list(shear),
    )
