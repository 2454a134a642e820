"""Materials that a scene can name instead of listing their parameters."""

from __future__ import annotations

import difflib
from typing import Any

from lcmchain.quantities.entry_types import wrong

#: Bidirectional carbon non-crimp fabric MD600 (Schäfer, Mitsch, Kärger), as scene-file entries.
#:
#: Shear: Table B.1. Compaction: Table B.2 (simulation). Bending: Table B.3; its last column is
#: unreadable in the text at hand, and section 3.3 gives C13 = C23 = 0.1 MPa. Membrane: C11 = C22
#: and the transverse shear stiffness of section 3.2. Areal mass 600 g/m², thickness 1.004 mm;
#: fibre density 1810 kg/m³ from the roving's data sheet (assumed, the paper gives none).
#: Range of the shear law: the paper states no angle. Its bias-extension tests end at 60 mm, where a
#: pin-jointed net is sheared by 63.0°; beyond 30 mm the rovings slipped and the measured angle, to
#: which the law is fitted, was smaller ("slight deviations"). 60° is taken: what lies beyond it was
#: certainly not measured.
MD600 = {
    "law": "fabric",
    "name": "MD600",
    "thickness": "1.004 mm",
    "areal_mass": "600 g/m^2",
    "fibre_density": "1810 kg/m^3",
    "membrane": {
        "C11": "1000 MPa",
        "C22": "1000 MPa",
        "shear_polynomial": "0.1919 -2.3637 14.7593 -40.7199 42.3208 MPa",
        "C23": "0.1 MPa",
        "C13": "0.1 MPa",
        "shear_convention": "engineering",
        "shear_range": "60 deg",
    },
    "compaction": {"c0": "0.1563 MPa", "c1": 60.4653, "c2": 2.4528},
    "bending": {
        "C11": "38.0615 MPa",
        "C22": "43.0668 MPa",
        "C33": "0.1 MPa",
        "C12": "4.2123 MPa",
        "C23": "0.1 MPa",
        "C13": "0.1 MPa",
    },
}

PRESETS = {"MD600": MD600}

#: Laws that take the values of a preset; the first is meant where a scene names none.
LAWS_OF_PRESET = {"MD600": ("fabric", "fabric-with-set")}

#: A and B of the measured compaction law Φ = A (p / 1 kPa)^B, Eq. (24) and Table B.2.
MEASURED_COMPACTION = {"MD600": (0.2820, 0.0926)}


def fill_preset(material: Any) -> Any:
    """Merge the keys of a scene's [material] table over those of the preset that it names."""
    if not isinstance(material, dict) or material.get("preset") is None:
        return material
    preset = material["preset"]
    if not isinstance(preset, str):
        raise wrong(f'must be a name in quotes, such as "{next(iter(PRESETS))}"', field="preset")
    if preset not in PRESETS:
        close = difflib.get_close_matches(str(preset), PRESETS, n=1, cutoff=0.3)
        hint = f'; did you mean "{close[0]}"?' if close else f"; there is {', '.join(PRESETS)}"
        raise wrong(f'there is no preset "{preset}"{hint}', field="preset")
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
