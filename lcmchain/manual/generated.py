"""The reference pages that are written from the code; a test compares them with what is kept.

Pages of one table each are made here: effects, published fabrics, fields. Those of the scene and of
the commands go through trees of entries (``scene_reference``) and of commands
(``command_reference``).
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

from lcmchain.atomic import replacing
from lcmchain.effects.effect import Switch
from lcmchain.effects.switches import EFFECTS, key_of
from lcmchain.fields.saved import HISTORY_FIELDS
from lcmchain.manual.command_reference import Group, command_page
from lcmchain.manual.contents import FOLDER
from lcmchain.manual.scene_reference import scene_page
from lcmchain.manual.tables import code, markdown_table
from lcmchain.quantities.fields import FIELDS, Field
from lcmchain.scene.presets import PUBLISHED, PublishedFabric


def generated_pages(root: Group) -> dict[str, str]:
    """Return the Markdown of every generated page by topic; ``root`` is the group of commands."""
    return {
        "scene-reference": scene_page(),
        "effects": effect_page(),
        "presets": preset_page(),
        "fields": field_page(),
        "commands": command_page(root),
    }


def write_generated_pages(root: Group) -> list[Path]:
    """Write the generated pages beside this file and return their paths."""
    files = []
    for topic, text in generated_pages(root).items():
        files.append(FOLDER / f"{topic}.md")
        with replacing(files[-1]) as path:
            path.write_text(text, encoding="utf-8")
    return files


# --- effects, from the files that implement them --------------------------------------------------

EFFECTS_HEAD = """# Effects

A scene has the physics that it calls for: no tool, no contact code; no growth of the compaction
stiffness, no exponential in the kernel. `check --full` lists every effect, whether it is on, why,
and, once measured on this machine, the part of the time that it takes.

`[effects]` overrides that: `effects.friction = "off"` takes an effect out of a scene that calls for
it, before anything is compiled; `"on"` puts one in where its numbers are known; `"auto"`, the
default, leaves it to the rest of the scene. What cannot be is an error that says why. Check and run
warn about every effect that is switched against what the scene calls for: such a run is a study of
the effect, not a result.

```toml
[effects]
friction = "off"
gravity = "on"
```

An effect of the elements or of pressures that a scene does not have costs nothing: its argument is
`None`, or its law a class without it, and the compiler removes the code; its arrays have no entries
(`pytest tests/effects/test_switches.py tests/effects/test_effect_cost.py`). Weight and damping are
made with zeros where they are off, and friction is a test for each pack of nodes in contact.
`python examples/without_code/compare.py` times a free plate against sources from which the code of
all that it does not have is deleted ([Speed](speed.md#effects)).

`lcmchain bench --effects` measures the part of a step's time that goes with each effect of the
hemisphere, in turn on the formed sheet; `lcmchain study effects SCENE` does it for any scene. From
Python, `lcmchain.effects.switches.switchable_effects(scene)` lists what the other setting would
change, and `lcmchain.check.effect_cost.measure_effects(scene)` measures it.

"""
EFFECTS_COLUMNS = ("key", "what it adds", "called for by", "off leaves out", "off", "on")


def effect_page() -> str:
    """Return the page as Markdown."""
    rows = [_effect_row(file) for file in EFFECTS if key_of(file)]
    return EFFECTS_HEAD + markdown_table(EFFECTS_COLUMNS, rows)


def _effect_row(file: ModuleType) -> tuple[str, ...]:
    switch: Switch = file.SWITCH
    return (
        code(key_of(file)),
        _first_sentence(file.__doc__ or ""),
        switch.entry,
        switch.without,
        _answer(switch.off, switch.unless),
        _answer(switch.on, ""),
    )


def _answer(turn: Callable[[Any], Any], unless: str) -> str:
    reason = getattr(turn, "reason", "")
    if reason:
        return f"no: {reason}"
    return f"yes, but not {unless}" if unless else "yes"


def _first_sentence(head: str) -> str:
    """Return what a file says that it adds."""
    found = re.search(r"^Adds: (.*?)[.:;](?:\s|$)", head, re.M | re.S)
    if found is None:
        raise ValueError("the head of an effect must say what it adds")
    return " ".join(found.group(1).split())


# --- published fabrics, from their data -----------------------------------------------------------

PRESETS_HEAD = """# Published fabrics

The fabrics that `material.preset` knows, with every value and what it rests on: *measured* by a
test that the source describes, *stated* by a paper or a data sheet, or *assumed*. `check --full`
prints the same for the values that a scene takes from its preset; keys given beside `preset`
replace its values. The law is that of [Materials](materials.md#fabric).

Only MD600 is published completely. Of the woven fabrics no source at hand gives shear, compaction
and bending together: those values are **carried over** from MD600. `check`, runs, reports and
coupons name the laws that a fabric does not have of its own, and what of the result is no
prediction for it, until tests of your own replace them
([Identification](identification.md); `lcmchain new coupon` writes a scene with all values spelled
out). They differ from MD600 in mass, fibre density and thickness, and serve to try a scene with a
sheet of about that weight.

`glass-plain-600` has **no shear law of its own**. The measured curves of a plain weave that are at
hand ([two sizes](identification.md#one-fabric-two-sizes)) are of another fabric, 743 g/m² and
1.2 mm of commingled glass and polypropylene: they are not passed off as its law.
`python examples/identification/two_sizes.py` identifies that one.
"""


def preset_page() -> str:
    """Return the page as Markdown."""
    return "\n".join([PRESETS_HEAD, *(_fabric_section(fabric) for fabric in PUBLISHED.values())])


def _fabric_section(fabric: PublishedFabric) -> str:
    rows = [
        (
            code(key),
            code(value if isinstance(value, str) else f"{value:g}"),
            f"**carried over**: {basis.note}" if basis.carried_over else str(basis),
        )
        for key, (value, basis) in fabric.values.items()
    ]
    table = markdown_table(("key", "value", "rests on"), rows)
    return (
        f"## {fabric.name}\n\n{fabric.description[0].upper()}{fabric.description[1:]}.\n\n{table}"
    )


# --- fields of a result, from the field table -----------------------------------------------------

FIELDS_HEAD = """# Fields

Every field of `forming.nc`, `forming.vtu` and the files of mapped meshes, with its unit and its
definition. A vector stands as three scalars that end in `_x`, `_y` and `_z`. A result holds the
fields that its element and its scene define: the 2D approach has no thickness, and permeabilities
need a `[permeability]` table; a law with memory adds what it remembers, under its own names. How
the files are built is said in [Run and check](run.md#what-comes-out).
"""
HISTORIES = """## Histories

In the group `/history`, over `history_time` and, but for the energies, over `tool`. The interval is
`output.history_interval`; a sample lies at the step nearest to its multiple. `history_energy_` and
the name of a part of the [energy balance](time-integration.md#energy-balance) is that part, and
`history_energy_mass_damping` what of the damping is not that of contacts. `tool_force`,
`tool_travel` and `energy_*` without `history_` are those of the saved frames, and of their last
step alone.
"""


def field_page() -> str:
    """Return the page as Markdown."""
    parts = [FIELDS_HEAD]
    for location, title in (("face", "Fields of the faces"), ("node", "Fields of the nodes")):
        rows = [_field_row(field) for field in FIELDS.values() if field.location == location]
        parts += [f"## {title}\n", markdown_table(("field", "unit", "meaning"), rows)]
    rows = [_field_row(field) for field in HISTORY_FIELDS.values()]
    parts += [HISTORIES, markdown_table(("field", "unit", "meaning"), rows)]
    return "\n".join(parts)


def _field_row(field: Field) -> tuple[str, str, str]:
    name = code(field.name) + (" (vector)" if field.is_vector else "")
    return name, field.units, field.meaning
