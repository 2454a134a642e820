"""Materials that a scene can name instead of listing their parameters."""

from __future__ import annotations

import difflib
from typing import Any

from lcmchain.quantities.entry_types import wrong
from lcmchain.scene.fabrics import PUBLISHED

#: Material tables as scene files give them, by name.
PRESETS = {name: fabric.entries for name, fabric in PUBLISHED.items()}
MD600 = PRESETS["MD600"]

#: Laws that take the values of a preset; the first is meant where a scene names none.
LAWS_OF_PRESET = dict.fromkeys(PRESETS, ("fabric", "fabric-with-set"))

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
