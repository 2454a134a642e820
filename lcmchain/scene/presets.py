"""Published materials that scenes name: every value as a scene gives it, and what it rests on.

A value is *measured* by a test that the source describes, *stated* by a source without one (a
paper, a data sheet), or *assumed*, with the reason. No fabric but MD600 was found whose values are
complete: what is missing is carried over from MD600 and says so.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

from pydantic import BaseModel

from lcmchain.materials.fabric import FabricMaterial
from lcmchain.quantities.entry_types import wrong


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


def _measured(note: str) -> Basis:
    return Basis("measured", note)


def _stated(note: str) -> Basis:
    return Basis("stated", note)


def _assumed(note: str) -> Basis:
    return Basis("assumed", note)


#: Entries as a scene file gives them, each with its basis: by dotted key below their table.
Entries = dict[str, tuple[Any, Basis]]


def filled(values: object, published: dict[str, Entries]) -> object:
    """Return a table with its entries put over those of the preset that it names."""
    if not isinstance(values, dict) or values.get("preset") is None:
        return values
    _require_preset(values["preset"], published)
    return published_values(published, values["preset"]) | values


def _require_preset(name: object, published: Iterable[str]) -> None:
    known = list(published)
    if name not in known:
        close = difflib.get_close_matches(str(name), known, n=1, cutoff=0.3)
        hint = f'; did you mean "{close[0]}"?' if close else f"; there is {', '.join(known)}"
        raise wrong(f'there is no preset "{name}"{hint}', field="preset")


def published_values(published: dict[str, Entries], name: str | None) -> dict[str, Any]:
    """Return the entries of a preset as a scene file gives them, its name among them."""
    if name is None:
        return {}
    return {"preset": name} | {key: value for key, (value, _) in published[name].items()}


# --- fabrics --------------------------------------------------------------------------------------


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
    values: Entries

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


def _at(model: object, key: str) -> Any:
    for step in key.split("."):
        model = getattr(model, step)
    return model


def _text(value: str | float) -> str:
    return value if isinstance(value, str) else f"{value:g}"


PAPER = "Schäfer, Mitsch, Kärger"

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
_MD600 = PublishedFabric(
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


def _like_md600(name: str, description: str, own: Entries) -> PublishedFabric:
    """Complete what is known of a fabric by the values of MD600, as assumptions."""
    values = dict(own)
    for key, (value, basis) in _MD600.values.items():
        if key in own:
            continue
        reason = _AS_MD600.get(key) or _AS_MD600.get(key.split(".")[0])
        if basis.kind == "measured" or key in _AS_MD600:
            basis = Basis("assumed", f"{reason}; no published value found", carried_over=True)
        else:
            basis = replace(basis, kind="assumed", note=f"as for MD600: {basis.note}")
        values[key] = (value, basis)
    return PublishedFabric(name, description, {key: values[key] for key in _MD600.values})


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
PUBLISHED = {fabric.name: fabric for fabric in (_MD600, GLASS_PLAIN_600, CARBON_TWILL_200)}


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
        f"of its own ({', '.join(tables)}): those of MD600, a {_MD600.description}, are carried "
        f"over by assumption, so that {_listed(rests, 'and')} are no prediction; give your own "
        "(lcmchain identify)"
    ]


def _listed(words: Sequence[str], last: str) -> str:
    """Return words as they stand in a sentence."""
    *ahead, end = words
    return f"{', '.join(ahead)} {last} {end}" if ahead else end


#: Material tables as scene files give them, by name.
PRESETS = {name: fabric.entries for name, fabric in PUBLISHED.items()}
MD600 = PRESETS["MD600"]

#: Laws that take the values of a preset; the first is meant where a scene names none.
LAWS_OF_PRESET = dict.fromkeys(PRESETS, ("fabric", "fabric-with-set"))

#: A and B of the measured compaction law Φ = A (p / 1 kPa)^B, Eq. (24) and Table B.2.
MEASURED_COMPACTION = {"MD600": (0.2820, 0.0926)}


def fill_preset(material: object) -> object:
    """Merge the keys of a scene's [material] table over those of the preset that it names."""
    if not isinstance(material, dict) or material.get("preset") is None:
        return material
    preset = material["preset"]
    if not isinstance(preset, str):
        raise wrong(f'must be a name in quotes, such as "{next(iter(PRESETS))}"', field="preset")
    _require_preset(preset, PRESETS)
    law = PRESETS[preset]["law"]
    if material.get("law", law) not in LAWS_OF_PRESET[preset]:
        raise wrong(
            f'is "{material["law"]}", but the preset "{preset}" is a {law}; leave law out',
            field="law",
        )
    return _merged(PRESETS[preset], material)


def _merged(base: dict[str, Any], over: dict[str, Any]) -> dict[str, Any]:
    result = dict(base)
    for key, value in over.items():
        both_tables = isinstance(value, dict) and isinstance(base.get(key), dict)
        result[key] = _merged(base[key], value) if both_tables else value
    return result


# --- fibres and resins of a cured composite -------------------------------------------------------


_EXERCISE = "Soden, Hinton, Kaddour, Composites Science and Technology 58 (1998) 1011"


#: Published fibres by name: every value as a scene file gives it, and what it rests on.
FIBRES: dict[str, Entries] = {
    "T300": {
        "E1": ("230 GPa", _stated(f"{_EXERCISE}, Table 1")),
        "E2": ("15 GPa", _stated(f"{_EXERCISE}, Table 1")),
        "G12": ("15 GPa", _stated(f"{_EXERCISE}, Table 1")),
        "nu12": (0.2, _stated(f"{_EXERCISE}, Table 1")),
        "nu23": (0.0714, _stated(f"E2 / (2 G23) - 1 with G23 = 7 GPa, {_EXERCISE}, Table 1")),
        "density": ("1760 kg/m^3", _stated("Toray, data sheet T300")),
    },
    "AS4": {
        "E1": ("225 GPa", _stated(f"{_EXERCISE}, Table 1")),
        "E2": ("15 GPa", _stated(f"{_EXERCISE}, Table 1")),
        "G12": ("15 GPa", _stated(f"{_EXERCISE}, Table 1")),
        "nu12": (0.2, _stated(f"{_EXERCISE}, Table 1")),
        "nu23": (0.0714, _stated(f"E2 / (2 G23) - 1 with G23 = 7 GPa, {_EXERCISE}, Table 1")),
        "density": ("1790 kg/m^3", _stated("Hexcel, data sheet HexTow AS4")),
    },
    "E-glass": {
        "E1": ("74 GPa", _stated(f"Silenka E-glass 1200 tex, {_EXERCISE}, Table 1")),
        "nu12": (0.2, _stated(f"Silenka E-glass 1200 tex, {_EXERCISE}, Table 1")),
        "density": (
            "2540 kg/m^3",
            _stated("Handbook of Properties of Textile and Technical Fibres, Table 1.4"),
        ),
    },
}

#: Published resins by name.
RESINS: dict[str, Entries] = {
    "MY750": {
        "E": ("3.35 GPa", _stated(f"epoxy MY750/HY917/DY063, {_EXERCISE}, Table 2")),
        "nu": (0.35, _stated(f"epoxy MY750/HY917/DY063, {_EXERCISE}, Table 2")),
        "density": ("1200 kg/m^3", Basis("assumed", "usual for a cured epoxy resin")),
    },
    "3501-6": {
        "E": ("4.2 GPa", _stated(f"epoxy 3501-6, {_EXERCISE}, Table 2")),
        "nu": (0.34, _stated(f"epoxy 3501-6, {_EXERCISE}, Table 2")),
        "density": ("1265 kg/m^3", _stated("Hexcel, data sheet HexPly 3501-6")),
    },
}


# --- resins that flow -----------------------------------------------------------------------------


_CHEN = Basis(
    "stated",
    "Chen, Macosko, Journal of Applied Polymer Science 62 (1996) 567; two public transcriptions "
    "agree",
)

#: No resin was found whose viscosity, cure and gel point are all published in numbers that could be
#: traced. What is here is one complete viscosity law and three fits of one resin's cure; each was
#: taken from a public transcription and has been compared with others as its note says.
#:
#: Viscosity laws after Castro and Macosko by name.
VISCOSITIES: dict[str, Entries] = {
    # Cyanate ester AroCy L-10, a thin resin for transfer moulding.
    "AroCy-L10": {
        "reference_viscosity": ("3.32e-8 Pa*s", _CHEN),
        "activation_energy": ("42.9 kJ/mol", _CHEN),
        "gel_cure": (0.64, Basis("stated", f"{_CHEN.note.partition(';')[0]}; one transcription")),
        "exponent": (2.32, _CHEN),
        "exponent_slope": (1.4, _CHEN),
    },
}


def _epoxy(source: str, values: tuple[Any, ...]) -> Entries:
    keys = (
        "rate_1", "energy_1", "rate_2", "energy_2", "order_1", "autocatalytic_order", "order",
    )  # fmt: skip
    note = f"{source}; one public transcription, like the two other fits of this resin"
    return {key: (value, Basis("stated", note)) for key, value in zip(keys, values, strict=True)}


#: Rates of cure by name. All three describe the epoxy RTM6: what separates them is what a fit to
#: calorimetry is worth.
CURES: dict[str, Entries] = {
    "RTM6-Karkanas": _epoxy(
        "P. I. Karkanas, PhD thesis, Cranfield University, 1998",
        ("2.6e4 1/s", "74.69 kJ/mol", "5.78e4 1/s", "57.88 kJ/mol", 0.449, 1.217, 1.786),
    ),
    "RTM6-Pantelelis": _epoxy(
        "N. G. Pantelelis, 2005",
        ("2.54e4 1/s", "71.46 kJ/mol", "6.05e4 1/s", "61.25 kJ/mol", 0.492, 1.252, 1.75),
    ),
    "RTM6-Hein": _epoxy(
        "R. Hein, 2018; there as ln(rate) = 11.149 and 8.762",
        ("69494 1/s", "75.549 kJ/mol", "6387 1/s", "50.911 kJ/mol", 0.489, 1.549, 2.179),
    ),
}
