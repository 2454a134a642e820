"""The page of effects, from the files that implement them."""

from __future__ import annotations

import re
from collections.abc import Callable
from types import ModuleType
from typing import Any

from lcmchain.effects.effect import Switch
from lcmchain.effects.switches import EFFECTS, key_of
from lcmchain.manual.tables import code, markdown_table

HEAD = """# Effects

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
COLUMNS = ("key", "what it adds", "called for by", "off leaves out", "off", "on")


def effect_page() -> str:
    """Return the page as Markdown."""
    rows = [_row(file) for file in EFFECTS if key_of(file)]
    return HEAD + markdown_table(COLUMNS, rows)


def _row(file: ModuleType) -> tuple[str, ...]:
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
