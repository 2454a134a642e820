"""Mutations that know nothing of the program: of bytes, of lines, and of documents of tables."""

from __future__ import annotations

import copy
import datetime
import math
import random
import re
from typing import Any

#: Values of every type that TOML has, and sizes that numbers may wrongly have.
ODD_VALUES: tuple[Any, ...] = (
    0, 1, -1, 2**31, 2**62, 10**18, 0.0, -0.0, 1e-300, 1e300, -1e300, math.nan, math.inf, -math.inf,
    True, False, "", " ", "none", "nan", "1", "5 mm", "-5 mm", "0 mm", "5 kg", "1e302 ms",
    "1e400 m",
    "1e-320 m", "nan mm", "inf mm", "5", "mm", "5 mm mm", "5 m^40", "1/0 mm", "5 mm; 6 mm",
    "5,5 mm",
    "0x10 mm", "５ mm", "5 µm", "5 \u212b", "5 mm\u0000", "\ufeff5 mm", "5\u00a0mm", "✂ 5 mm",
    "{0}",
    "%s", "../../../etc/passwd", "/dev/zero", "/", ".", "~", "a" * 300, "1" * 500, "(" * 90,
    "5 " + "m*" * 90 + "m", "5 mm^99999999999", "5 mm**0.3333", "5 dB", "5 degC", "5 mm/0",
    [], [[]], [1], [1, 2, 3], ["5 mm"], ["5 mm", "6 mm"], ["0 mm"] * 3, [0, 0, 0], [0, 0, -1],
    [math.nan, 0, 1], [1e-200, 0, 0], [1e200, 1e200, 0], [[1], [2]], ["5 mm", 5], {}, {"type": "x"},
    {"law": []}, {"type": {}}, {"name": 3}, {"preset": ["MD600"]}, [{}], [{}, {}], [{"name": "a"}],
    datetime.date(2026, 1, 1), datetime.datetime(2026, 1, 1, 12), datetime.time(1, 2),
)  # fmt: skip

UNITS = (
    "mm", "m", "cm", "um", "km", "inch", "kg", "g", "t", "ms", "s", "h", "N", "kN", "MPa",
    "mPa", "Pa",
    "GPa", "deg", "rad", "1/s", "Hz", "g/m^2", "kg/m^3", "N*s/m", "MPa/mm", "bar", "%", "",
    "parsec",
)  # fmt: skip
NUMBERS = (
    "0", "-1", "1e-12", "1e-9", "1e-6", "1e-3", "0.5", "1", "2", "10", "1e3", "1e6", "1e9", "1e30",
    "1e302", "1e400", "-1e302", "1e-302", "00", "+5", "5.", ".5", "5e", "1_000", "nan", "inf",
)  # fmt: skip
TEXTS = (
    "é",
    "日本語",
    "\u202eabc",
    "a\u0301",
    "🧵" * 20,
    "a b",
    "a/b",
    "a\\b",
    "a\nb",
    "\x1b[2J",
    "'",
    '"',
)


def mutated_bytes(rng: random.Random, content: bytes) -> tuple[bytes, str]:
    """Flip, cut, insert, repeat or swap bytes."""
    kind = rng.choice(["flip", "truncate", "insert", "repeat", "swap", "zero", "random"])
    data = bytearray(content)
    place = rng.randrange(max(len(data), 1))
    if kind == "flip":
        for _ in range(rng.choice([1, 1, 2, 8, 64])):
            if data:
                data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
    elif kind == "truncate":
        del data[place:]
    elif kind == "insert":
        data[place:place] = rng.randbytes(rng.choice([1, 2, 8, 100]))
    elif kind == "repeat":
        data[place:place] = data[place : place + rng.choice([1, 10, 1000])]
    elif kind == "swap":
        other = rng.randrange(max(len(data), 1))
        size = rng.choice([1, 16, 256])
        a, b = data[place : place + size], data[other : other + size]
        data[place : place + len(a)], data[other : other + len(b)] = b[: len(a)], a[: len(b)]
    elif kind == "zero":
        data[place : place + 64] = bytes(len(data[place : place + 64]))
    else:
        data = bytearray(rng.randbytes(rng.choice([0, 1, 100, 5000])))
    return bytes(data), f"bytes: {kind}"


def mutated_lines(rng: random.Random, text: str) -> tuple[str, str]:
    """Drop, repeat, swap or join lines, or change the encoding of a text's ends."""
    lines = text.split("\n")
    kind = rng.choice(["drop", "repeat", "swap", "join", "crlf", "cut", "block"])
    i, j = rng.randrange(len(lines)), rng.randrange(len(lines))
    if kind == "drop":
        del lines[i]
    elif kind == "repeat":
        lines.insert(j, lines[i])
    elif kind == "swap":
        lines[i], lines[j] = lines[j], lines[i]
    elif kind == "join":
        lines[i : i + 2] = ["".join(lines[i : i + 2])]
    elif kind == "crlf":
        return "\r\n".join(lines), "lines: crlf"
    elif kind == "cut":
        lines[i] = lines[i][: rng.randrange(len(lines[i]) + 1)]
    else:
        low, high = sorted((i, j))
        lines += lines[low:high]
    return "\n".join(lines), f"lines: {kind}"


def places(node: Any, path: tuple = ()) -> list[tuple]:
    """Paths of all values of a document."""
    found = [path] if path else []
    if isinstance(node, dict):
        steps = list(node)
    elif isinstance(node, list):
        steps = list(range(len(node)))
    else:
        return found
    return found + [inner for step in steps for inner in places(node[step], (*path, step))]


def at(document: Any, path: tuple) -> Any:
    for step in path:
        document = document[step]
    return document


def mutated_document(rng: random.Random, document: dict) -> tuple[dict, str, bool]:
    """Change one value or key; return the document, what was done, whether none may accept it."""
    document = copy.deepcopy(document)
    path = rng.choice(places(document))
    holder, step = at(document, path[:-1]), path[-1]
    value = holder[step]
    where = ".".join(map(str, path))
    kind = rng.choice(["odd", "odd", "number", "unit", "drop", "extra", "misspell", "wrap", "scale",
                       "scale", "scale", "text", "repeat", "lengthen", "move"])  # fmt: skip
    must_refuse = False
    if kind == "odd":
        holder[step] = rng.choice(ODD_VALUES)
    elif kind in ("number", "unit", "scale") and isinstance(value, str) and " " in value:
        number, _, unit = value.partition(" ")
        if kind == "number":
            holder[step] = f"{rng.choice(NUMBERS)} {unit}"
        elif kind == "unit":
            holder[step] = f"{number} {rng.choice(UNITS)}".strip()
        else:
            holder[step] = _scaled(rng, number, unit)
    elif kind in ("number", "scale") and isinstance(value, (int, float)):
        holder[step] = rng.choice([0, -1, 1, 2, 1e-9, 1e9, math.nan, math.inf, 1e308, 10**17, 0.5])
        if kind == "scale":
            holder[step] = value * rng.uniform(0.5, 2.0)
    elif kind == "drop":
        del holder[step]
    elif kind in ("extra", "misspell"):
        table, name = (holder, step) if isinstance(step, str) else (None, None)
        if table is None:
            holder[step] = rng.choice(ODD_VALUES)
        elif kind == "extra":
            table[f"{name}_{rng.choice('xyz')}{rng.randrange(99)}"] = value
            must_refuse = True
        else:
            del table[name]
            table[_misspelt(rng, name)] = value
            must_refuse = True
    elif kind == "wrap":
        for _ in range(rng.choice([1, 1, 2, 30])):
            value = [value] if rng.random() < 0.5 else {"inner": value}
        holder[step] = value
    elif kind == "repeat" and isinstance(holder, list):
        holder += [copy.deepcopy(value)] * rng.choice([1, 2, 50])
    elif kind == "lengthen" and isinstance(value, str):
        holder[step] = value * rng.choice([2, 100, 20_000])
    elif kind == "move":
        other = rng.choice(places(document))
        holder[step] = copy.deepcopy(at(document, other))
    else:
        holder[step] = rng.choice(TEXTS) + (value if isinstance(value, str) else "")
        kind = "text"
    return document, f"{kind} at {where}", must_refuse


def near_document(rng: random.Random, document: dict) -> tuple[dict, int]:
    """Change many sizes a little or by some factor; return the document and how many."""
    document = copy.deepcopy(document)
    width, share, count = rng.choice([0.02, 0.1, 0.3]), rng.choice([0.1, 0.5, 1.0]), 0
    for path in places(document):
        holder, value = at(document, path[:-1]), at(document, path)
        if rng.random() > share:
            continue
        factor = 10.0 ** rng.uniform(-width, width)
        if isinstance(value, str) and re.fullmatch(r"-?[\d.]+ [^\d ]+", value):
            number, _, unit = value.partition(" ")
            holder[path[-1]] = f"{float(number) * factor:.5g} {unit}"
            count += 1
        elif isinstance(value, float):
            holder[path[-1]] = value * factor
            count += 1
    return document, count


def _scaled(rng: random.Random, number: str, unit: str) -> str:
    try:
        width = rng.choice([0.1, 0.5, 4.0])
        scaled = float(number) * 10.0 ** rng.uniform(-width, width) * rng.choice([1, 1, 1, -1])
    except ValueError:
        scaled = rng.uniform(-100.0, 100.0)
    return f"{scaled:.4g} {unit}"


def _misspelt(rng: random.Random, name: str) -> str:
    letters = list(name)
    i = rng.randrange(len(letters))
    if rng.random() < 0.5 and len(letters) > 1:
        del letters[i]
    else:
        letters.insert(i, rng.choice("qxz"))
    return "".join(letters)


def to_toml(document: dict) -> str:
    """Write a document as TOML, every table in one line."""
    return "".join(f"{_key(key)} = {_value(value)}\n" for key, value in document.items())


def _key(key: str) -> str:
    plain = key and all(c.isascii() and (c.isalnum() or c in "-_") for c in key)
    return key if plain else _text(key)


def _text(text: str) -> str:
    escaped = "".join(f"\\u{ord(c):04x}" if c < " " or c in '"\\\x7f' else c for c in text)
    return f'"{escaped}"'


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_key(k)} = {_value(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_value, value)) + "]"
    if isinstance(value, (datetime.date, datetime.time)):
        return value.isoformat()
    return repr(value)
