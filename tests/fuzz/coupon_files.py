"""Wrong coupon files: the examples with wrong cells, headers, rows and bytes."""

from __future__ import annotations

import json
import math
import random
import tomllib
from pathlib import Path

from contract import Case
from mutations import UNITS, mutated_bytes, mutated_lines
from scenes import EXAMPLES

LAWS = ("shear", "compaction", "bending", "bending-loop", "shear-loop")
CELLS = (
    "", " ", "nan", "inf", "-inf", "1e400", "1e308", "-1e308", "1e-320", "0", "-1", "1,5",
    "1.5.2", "x",
    "é", "1_0", "0x10", '"', '""', "=1+1", "1e5000", "None", "True", "9" * 400, "\0", "５",
)  # fmt: skip


def make(rng: random.Random, folder: Path) -> Case:
    """Write a wrong coupon file and return the call that identifies a law from it."""
    law = rng.choice(LAWS)
    text = (EXAMPLES / "identification" / f"{law}.csv").read_text(encoding="utf-8")
    file = folder / "data.csv"
    must_refuse = False
    kind = rng.choice(["cell", "cell", "cell", "column", "header", "scale", "rows", "lines",
                       "bytes",
                       "separator", "encoding", "law", "size", "wide"])  # fmt: skip
    options: list[str] = []
    rows = [line.split(",") for line in text.strip().split("\n")]
    if kind == "cell":
        row, column = rng.randrange(2, len(rows)), rng.randrange(len(rows[1]))
        rows[row][column] = rng.choice(CELLS)
        must_refuse = not _is_finite(rows[row][column]) and rows[row][column] not in ('"', '""')
    elif kind == "column":
        column = rng.randrange(len(rows[1]))
        value = rng.choice([*CELLS, "5"])
        for row in rows[2:]:
            row[column] = value
    elif kind == "header":
        column = rng.randrange(len(rows[1]))
        name = rows[1][column].split(" [")[0]
        rows[1][column] = rng.choice(
            [name, f"{name} [{rng.choice(UNITS)}]", f"{name[1:]} [mm]", f"{name} [mm", "",
             name * 999,
             rows[1][0], f"{name} [{'m' * 50_000}]", f"{name} (mm)", f'"{name} [mm]',
             "specimen", "time"]
        )  # fmt: skip
    elif kind == "scale":
        factor = 10.0 ** rng.uniform(-320, 300)
        column = rng.randrange(len(rows[1]))
        for row in rows[2:]:
            row[column] = f"{float(row[column]) * factor:.6g}"
    elif kind == "rows":
        rows = rows[:2] + rng.sample(rows[2:], rng.choice([0, 1, 3, 7, 9, len(rows) - 2]))
    elif kind == "law":
        law = rng.choice(LAWS)
    elif kind == "size":
        option = rng.choice({"shear": ["--length", "--width", "--thickness"],
                             "compaction": ["--thickness", "--areal-mass", "--fibre-density"],
                             "bending": ["--thickness", "--areal-mass", "--angle"],
                             "bending-loop": ["--thickness"],
                             "shear-loop": ["--thickness", "--side"]}[law])  # fmt: skip
        options = [
            option,
            rng.choice(
                [
                    "5",
                    "-5 mm",
                    "0 mm",
                    "1e302 m",
                    "1e-9 m",
                    "1e5 m",
                    "5 mm",
                    "1 kg",
                    "nan mm",
                    "89.9 deg",
                    "1e-6 deg",
                    "1 kg/m^2",
                    "9 kg/m^3",
                    "",
                ]
            ),
        ]
    elif kind == "wide":
        count = rng.choice([100, 20_000])
        rows = [[*row, *["1"] * count] for row in rows]
    content = "\n".join(",".join(row) for row in rows).encode() + b"\n"
    if kind == "lines":
        content = mutated_lines(rng, text)[0].encode()
    elif kind == "bytes":
        content = mutated_bytes(rng, content)[0]
    elif kind == "separator":
        content = content.replace(b",", rng.choice([b";", b"\t", b" ", b"|", b",,", b", "]))
    elif kind == "encoding":
        encoding = rng.choice(["utf-16", "utf-8-sig", "latin-1", "utf-32"])
        content = content.decode().encode(encoding)
    file.write_bytes(content)
    out = folder / "out"
    return Case(
        ["identify", law, str(file), "--out", str(out), *options], f"{law}: {kind} {options}",
        [file],
        out, must_refuse, check=lambda: _complaint(out),
    )  # fmt: skip


def _is_finite(cell: str) -> bool:
    try:
        return math.isfinite(float(cell))
    except ValueError:
        return False


def _complaint(out: Path) -> str | None:
    """Say what is wrong with an identification that was written."""
    for name in ("parameters.toml", "fit.png", "identification.json"):
        if not (out / name).is_file():
            return f"there is no {name}"
    tomllib.loads((out / "parameters.toml").read_text(encoding="utf-8"))
    result = json.loads((out / "identification.json").read_text(encoding="utf-8"))
    for name, parameter in result["parameters"].items():
        if parameter["value"] is None:
            return f"{name} is no number"
    return None
