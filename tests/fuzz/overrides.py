"""Wrong overrides: every way to write ``--set``, against examples that are right."""

from __future__ import annotations

import random
import re
import tomllib
from functools import cache
from pathlib import Path

from contract import Case
from mutations import NUMBERS, ODD_VALUES, TEXTS, UNITS, at, places, to_toml
from scenes import base_documents, prepare

from lcmchain.scene import read_scene
from lcmchain.scene.reading.overrides import parse_value

__all__ = ["make", "prepare"]


@cache
def _keys(name: str) -> tuple[str, ...]:
    return tuple(".".join(map(str, path)) for path in places(base_documents()[name]))


def make(rng: random.Random, folder: Path) -> Case:
    """Return the reading of a scene with one to three overrides."""
    name = rng.choice(sorted(base_documents()))
    file = folder / "scene.toml"
    file.write_text(to_toml(base_documents()[name]), encoding="utf-8")
    overrides = [_override(rng, name) for _ in range(rng.choice([1, 1, 2, 3]))]
    return Case(
        (), f"{name}: --set {overrides!r:.300}", [file], None,
        call=lambda: read_scene(file, overrides), check=lambda: _complaint(file, overrides),
    )  # fmt: skip


def _override(rng: random.Random, name: str) -> str:
    key = rng.choice(_keys(name))
    kinds = ["value", "value", "new", "index", "odd key", "raw", "long", "lines", *["near"] * 4]
    kind = rng.choice(kinds)
    value = _near(rng, name, key) if kind == "near" else _value(rng)
    if kind == "new":
        key = rng.choice(["output.vtu", "contact.damping_ratio", "process.step_safety", "title",
                          "element.type", "permeability", "tools", "mapping",
                          "element"])  # fmt: skip
    elif kind == "index":
        key = f"tools[{rng.choice([0, 1, 99, 10**9, '-1', '0][0', '', 'x'])}].friction"
    elif kind == "odd key":
        key = rng.choice(["", ".", "a..b", "blank.", ".blank", "[0]", "tools", "tools.", "blank[0]",
                          "x" * 5000, "a." * 3000 + "b", "tools." + "9" * 5000, "a b", "é", "--set",
                          "blank.size.0", "blank.size[0]", "title.x"])  # fmt: skip
    elif kind == "raw":
        return rng.choice(["", "=", "==", "a", "=1", "a=", " = ", "\n=\n", "blank.edge_length",
                           "\0=1",
                           "title=\udcff", "title=\0", "\udcff=1"])  # fmt: skip
    elif kind == "long":
        value = rng.choice(["[" * 5000, "{a=" * 2000, "1" * 9000, "0x" + "f" * 9000, "x" * 100_000,
                            "[" + "1," * 50_000 + "]", '"' + "m" * 50_000])  # fmt: skip
    elif kind == "lines":
        value = rng.choice(
            ["1\n[blank]", "1\nb = 2", "'''a\nb'''", "5 mm # no", '"5 mm" # yes', "\n"]
        )
    return f"{key}={value}"


def _near(rng: random.Random, name: str, key: str) -> str:
    """A value that is probably right: that of the scene, or a little more or less."""
    value = at(base_documents()[name], tuple(int(s) if s.isdigit() else s for s in key.split(".")))
    if isinstance(value, float):
        return str(value * rng.uniform(0.9, 1.1))
    if isinstance(value, str) and re.fullmatch(r"[\d.]+ [^\d ]+", value):
        number, _, unit = value.partition(" ")
        return f"{float(number) * rng.uniform(0.9, 1.1):.4g} {unit}"
    return to_toml({"v": value}).partition(" = ")[2].strip()


def _value(rng: random.Random) -> str:
    kind = rng.random()
    if kind < 0.4:
        return f"{rng.choice(NUMBERS)} {rng.choice(UNITS)}"
    if kind < 0.6:
        return to_toml({"v": rng.choice(ODD_VALUES)}).partition(" = ")[2].strip()
    if kind < 0.8:
        return str(rng.choice(ODD_VALUES))
    return rng.choice(TEXTS)


def _complaint(file: Path, overrides: list[str]) -> str | None:
    """Say which override an accepted scene does not hold."""
    given = dict(read_scene(file, overrides).source.given)
    document = tomllib.loads(file.read_text(encoding="utf-8"))
    for number, override in enumerate(overrides):
        key, _, text = override.partition("=")
        key = key.strip()
        later = [other.partition("=")[0].strip() for other in overrides[number + 1 :]]
        if any(other.startswith(key) or key.startswith(other) for other in later):
            continue
        value = parse_value(text.strip())
        if isinstance(value, (dict, list)) or value == "none":
            continue  # one key of the record for each entry
        named = _named(key, str(value), document)
        if named.rpartition(".")[2].isdigit():
            continue  # a value in a list
        if named not in given and f"{named}.type" not in given:
            return f"{key} was accepted, but the scene does not record it"
        recorded = given.get(named, given.get(f"{named}.type"))
        shown = str(value).lower() if isinstance(value, bool) else str(value)
        if recorded != shown:
            return f"{key} is {recorded!r} after --set {override!r}"
    return None


def _named(key: str, value: str, document: dict) -> str:
    """Write a key as the record does: entries of a list by their name."""
    parts: list[str] = []
    node: object = document
    for part in key.replace("[", ".").replace("]", "").split("."):
        if isinstance(node, list):
            names = [entry.get("name") for entry in node if isinstance(entry, dict)]
            index = names.index(part) if part in names else int(part)
            part = (names[index] if names else None) or part  # a list of tables without names
            node = node[index]
        else:
            node = node.get(part) if isinstance(node, dict) else None
        parts.append(part)
    if parts[0] in ("tools", "mapping") and len(parts) == 3 and parts[2] == "name":
        parts[1] = value  # the record has the new name
    return ".".join(parts)
