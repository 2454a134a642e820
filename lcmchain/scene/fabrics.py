"""Published fabrics: every value of a material table, and what it rests on.

A value is *measured* by a test that the source describes, *stated* by a source without one (a
paper, a data sheet), or *assumed*, with the reason. No fabric but MD600 was found whose values are
complete: what is missing is carried over from MD600 and says so.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

from pydantic import BaseModel

from lcmchain.materials.fabric import FabricMaterial


@dataclass(frozen=True)
class Basis:
    """What a value rests on: the kind, and the source or the reason.

    ``carried_over`` marks a value of another fabric, which a user should replace by a test.
    """

    kind: Literal["measured", "stated", "assumed"]
    note: str
    carried_over: bool = False

    def __str__(self) -> str:
        return f"{self.kind} ({self.note})"


@dataclass(frozen=True)
class PublishedFabric:
    """A fabric that scenes name by ``material.preset``.

    Parameters
    ----------
    name : value of ``material.preset``; description : what it is, in a line.
    values : by dotted key below ``material``, the value as a scene file gives it and its basis.
    """

    name: str
    description: str
    values: dict[str, tuple[Any, Basis]]

    @cached_property
    def entries(self) -> dict[str, Any]:
        """The material table as a scene file gives it."""
        table: dict[str, Any] = {"law": "fabric", "name": self.name}
        for key, (value, _) in self.values.items():
            *path, last = key.split(".")
            inner = table
            for step in path:
                inner = inner.setdefault(step, {})
            inner[last] = value
        return table

    @cached_property
    def material(self) -> FabricMaterial:
        """The validated material."""
        return FabricMaterial.model_validate(self.entries)

    def kept(self, material: BaseModel) -> list[tuple[str, str, Basis]]:
        """Return key, value and basis of what a scene's material has taken from here unchanged."""
        return [
            (f"material.{key}", _text(value), basis)
            for key, (value, basis) in self.values.items()
            if _at(material, key) == _at(self.material, key)
        ]


def _at(model: Any, key: str) -> Any:
    for step in key.split("."):
        model = getattr(model, step)
    return model


def _text(value: Any) -> str:
    return value if isinstance(value, str) else f"{value:g}"


PAPER = "Schäfer, Mitsch, Kärger"


def _measured(note: str) -> Basis:
    return Basis("measured", note)


def _stated(note: str) -> Basis:
    return Basis("stated", note)


def _assumed(note: str) -> Basis:
    return Basis("assumed", note)


_STIFF_FIBRES = _assumed(f"high enough that fibres hardly stretch, {PAPER}, section 3.2")
_SOFT_SHEAR = _assumed(f"low, to leave the bending alone, {PAPER}, section 3.2")
_SOFT_BENDING = _assumed(f"low, of little influence in thin sheets, {PAPER}, section 3.3")
_SHEAR = _measured(f"bias extension, {PAPER}, Table B.1")
_COMPACTION = _measured(f"between plates, {PAPER}, Table B.2, simulation")
_CANTILEVER = _measured(f"cantilever, {PAPER}, Table B.3")

#: Bidirectional carbon non-crimp fabric.
#:
#: Bending: the last column of Table B.3 is unreadable in the text at hand, and section 3.3 gives
#: C13 = C23 = 0.1 MPa. Range of the shear law: the paper states no angle. Its bias-extension tests
#: end at 60 mm, where a pin-jointed net is sheared by 63.0°; beyond 30 mm the rovings slipped and
#: the measured angle, to which the law is fitted, was smaller ("slight deviations"). 60° is taken:
#: what lies beyond it was certainly not measured.
MD600 = PublishedFabric(
    "MD600",
    "biaxial carbon non-crimp fabric, 0°/90°, 600 g/m²",
    {
        "thickness": ("1.004 mm", _stated(f"{PAPER}, section 3.1")),
        "areal_mass": ("600 g/m^2", _stated(f"two layers of about 300 g/m², {PAPER}, section 3.1")),
        "fibre_density": (
            "1810 kg/m^3",
            _assumed("that of the roving's data sheet; the paper gives none"),
        ),
        "membrane.C11": ("1000 MPa", _STIFF_FIBRES),
        "membrane.C22": ("1000 MPa", _STIFF_FIBRES),
        "membrane.shear_polynomial": ("0.1919 -2.3637 14.7593 -40.7199 42.3208 MPa", _SHEAR),
        "membrane.C23": ("0.1 MPa", _SOFT_SHEAR),
        "membrane.C13": ("0.1 MPa", _SOFT_SHEAR),
        "membrane.shear_convention": (
            "engineering",
            _assumed("the reading usual for Voigt notation; the paper does not say"),
        ),
        "membrane.shear_range": (
            "60 deg",
            _assumed("just below the 63° of a pin-jointed net at the end of the test"),
        ),
        "compaction.c0": ("0.1563 MPa", _COMPACTION),
        "compaction.c1": (60.4653, _COMPACTION),
        "compaction.c2": (2.4528, _COMPACTION),
        "bending.C11": ("38.0615 MPa", _CANTILEVER),
        "bending.C22": ("43.0668 MPa", _CANTILEVER),
        "bending.C33": ("0.1 MPa", _SOFT_BENDING),
        "bending.C12": ("4.2123 MPa", _CANTILEVER),
        "bending.C23": ("0.1 MPa", _SOFT_BENDING),
        "bending.C13": ("0.1 MPa", _SOFT_BENDING),
    },
)

_AS_MD600 = {
    "membrane.shear_polynomial": "the shear stress of MD600 at the same angle",
    "membrane.shear_range": "the range of the law that is carried over",
    "compaction": "the pressure of MD600 at the same fibre volume fraction",
    "bending": "the bending modulus of MD600, so that the stiffness goes with thickness³",
}


def _like_md600(name: str, description: str, own: dict[str, tuple[Any, Basis]]) -> PublishedFabric:
    """Complete what is known of a fabric by the values of MD600, as assumptions."""
    values = dict(own)
    for key, (value, basis) in MD600.values.items():
        if key in own:
            continue
        reason = _AS_MD600.get(key) or _AS_MD600.get(key.split(".")[0])
        if basis.kind == "measured" or key in _AS_MD600:
            basis = Basis("assumed", f"{reason}; no published value found", carried_over=True)
        else:
            basis = replace(basis, kind="assumed", note=f"as for MD600: {basis.note}")
        values[key] = (value, basis)
    return PublishedFabric(name, description, {key: values[key] for key in MD600.values})


_SAME_PACKING = _assumed(
    "so that the unloaded fabric has the fibre volume fraction of MD600, 0.330; measure yours"
)

#: Thickness: areal mass over fibre density and over 0.3302, the fibre volume fraction of MD600.
GLASS_PLAIN_600 = _like_md600(
    "glass-plain-600",
    "plain weave of E-glass, 600 g/m²",
    {
        "thickness": ("0.715 mm", _SAME_PACKING),
        "areal_mass": (
            "600 g/m^2",
            _stated("R&G, selection guide glass fibre fabric: plain, Interglas finish FK 144"),
        ),
        "fibre_density": (
            "2540 kg/m^3",
            _stated("E-glass, Handbook of Properties of Textile and Technical Fibres, Table 1.4"),
        ),
    },
)

CARBON_TWILL_200 = _like_md600(
    "carbon-twill-200",
    "twill of carbon fibres T300, 200 g/m²",
    {
        "thickness": ("0.342 mm", _SAME_PACKING),
        "areal_mass": (
            "200 g/m^2",
            _stated("R&G, selection guide carbon fibre fabric: twill, HTA 40 or T300"),
        ),
        "fibre_density": (
            "1770 kg/m^3",
            _stated(
                "T-300, Strengthening Design of Reinforced Concrete with FRP, Table 3.1, after "
                "Gibson 1994"
            ),
        ),
    },
)

#: All published fabrics by name; ``material.preset`` takes these names.
PUBLISHED = {fabric.name: fabric for fabric in (MD600, GLASS_PLAIN_600, CARBON_TWILL_200)}


def preset_basis(material: BaseModel) -> list[tuple[str, str, Basis]]:
    """Return key, value and basis of all that a material takes from its preset, if it names one."""
    name = getattr(material, "preset", None)
    return PUBLISHED[name].kept(material) if name else []


#: By table: what a fabric lacks whose values there are another's, and what that makes no
#: prediction.
_LACKS = {
    "membrane": ("shear law", "shear angles, outline, forces"),
    "compaction": ("compaction law", "thickness, pressures"),
    "bending": ("bending stiffness", "wrinkles"),
}


def preset_remarks(material: BaseModel) -> list[str]:
    """Say what of a material is that of a fabric that is not its own, and what rests on it."""
    carried = [key for key, _, basis in preset_basis(material) if basis.carried_over]
    if not carried:
        return []
    tables = sorted({key.split(".")[1] for key in carried})
    lacks, rests = zip(*(own for table, own in _LACKS.items() if table in tables), strict=True)
    return [
        f'material.preset = "{getattr(material, "preset", "")}" has no {_listed(lacks, "or")} '
        f"of its own ({', '.join(tables)}): those of MD600, a {MD600.description}, are carried "
        f"over by assumption, so that {_listed(rests, 'and')} are no prediction; give your own "
        "(lcmchain identify)"
    ]


def _listed(words: Sequence[str], last: str) -> str:
    """Return words as they stand in a sentence."""
    *ahead, end = words
    return f"{', '.join(ahead)} {last} {end}" if ahead else end
