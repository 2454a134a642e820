"""Wrong infiltrations: the tables of a case with one to three changes, on formed sheets that are
right or have values that no forming leaves."""

from __future__ import annotations

import math
import random
import tomllib
from functools import cache
from pathlib import Path

import numpy as np
from contract import Case
from mutations import mutated_document, mutated_lines, near_document, to_toml

from lcmchain.coupling.infiltration.formed_part import read_formed_part
from lcmchain.coupling.infiltration.results import FilledPart
from lcmchain.coupling.infiltration.stage import fill
from lcmchain.fields.netcdf_file import write_netcdf
from lcmchain.fields.ugrid import UgridMesh
from lcmchain.scene import read_infiltration

COLUMNS, ROWS, LENGTH, WIDTH = 6, 3, 0.12, 0.06
SCENE = """
process = { time = "1 ms" }
blank = { size = ["30 mm", "20 mm"], edge_length = "5 mm" }
material = { preset = "MD600" }
"""
GATE = '[[gates]]\nname = "g"\nbox = ["-1 -1 -1 mm", "1 61 1 mm"]\npressure = "3 bar"\n'
VENT = '[[vents]]\nname = "v"\nbox = ["119 -1 -1 mm", "121 61 1 mm"]\n'
HEAD = 'time = "300 s"\nframes = 3\nvent_pressure = "1 bar"\n'
PLAIN = 'resin = { law = "constant", viscosity = "0.1 Pa*s", density = "1100 kg/m^3" }\n'
GELS = """
[resin]
law = "castro_macosko"
reference_viscosity = "0.1 Pa*s"
reference_temperature = "60 degC"
activation_energy = "50 kJ/mol"
gel_cure = 0.5
exponent = 1.5
cure = { law = "nth_order", rate = "0.02 1/s", energy = "1 J/mol", order = 1.0 }
temperature = { law = "constant", value = "60 degC" }
"""
TEXTS = {
    "plain": HEAD + PLAIN + GATE + VENT,
    "rate": HEAD + PLAIN + GATE.replace(
        'pressure = "3 bar"',
        'flow_rate = "0.5 1 ml/s"\ntimes = "0 20 s"\npressure_limit = "5 bar"\ncloses = "200 s"',
    ) + VENT,
    "places": HEAD + PLAIN + 'gravity = ["1 m/s^2", "0 m/s^2", "-9 m/s^2"]\ntrapped_air = true\n'
    + GATE + VENT + """
[[gates]]
name = "hole"
point = "60 30 0 mm"
radius = "3 mm"
pressure = "2 3 bar"
times = "5 60 s"
opens_on_arrival = { box = ["40 -1 -1 mm", "41 61 1 mm"] }
[[regions]]
name = "core"
point = "60 30 0 mm"
radius = "25 mm"
thickness = "2 mm"
permeability_factor = 0.4
[[race_tracks]]
name = "gap"
rim = true
width = "1 mm"
[[wetted]]
name = "w"
box = ["-1 -1 -1 mm", "30 61 1 mm"]
""",
    "film": HEAD + PLAIN + 'film = { thickness = "0.4 mm", pressure = "1 6 bar", times = "0 9 s", '
    'over = { box = ["-1 -1 -1 mm", "70 61 1 mm"] }, capillary_pressure = "0.1 bar" }\n' + VENT,
    "gels": HEAD + GELS + GATE + VENT,
    "bag": HEAD + PLAIN + GATE + VENT + '[closure]\ntype = "bag"\npressure = "4 bar"\n'
    'window = "5 s"\n',
    "gap": HEAD + PLAIN + GATE + VENT + '[closure]\ntype = "gap"\nthickness = "1 0.9 mm"\n'
    'times = "0 60 s"\nwindow = "5 s"\n',
}  # fmt: skip
PERMEABILITY = '[permeability]\nlaw = "gebart"\nfibre_radius = "30 um"\n'
#: Values that a forming result may wrongly have in one cell.
ODD = (0.0, -1.0, 1.0, math.nan, math.inf, 1e-300, 1e300, 0.95)
FIELDS = ("thickness", "fibre_volume_fraction", "permeability_1", "permeability_2",
          "permeability_direction_1_x", "fibre_direction_1_x", "areal_fibre_mass")  # fmt: skip


@cache
def base_documents() -> dict[str, dict]:
    return {name: tomllib.loads(text + PERMEABILITY) for name, text in TEXTS.items()}


def prepare(folder: Path) -> None:
    """Write a formed sheet that is right."""
    _write_formed(folder / "forming.nc")


def make(rng: random.Random, folder: Path) -> Case:
    """Return a filling with a wrong case, a wrong sheet, or a case that is nearly right."""
    name = rng.choice(sorted(base_documents()))
    document, must_refuse = base_documents()[name], False
    case, formed = folder / "case.toml", folder / "forming.nc"
    kind = rng.choice(["document", "document", "document", "near", "lines", "sheet"])
    what = ""
    if kind == "near":
        document, count = near_document(rng, document)
        what = f"{count} sizes a little off"
    elif kind == "document":
        for _ in range(rng.choice([1, 1, 2, 3])):
            document, told, refuse = mutated_document(rng, document)
            must_refuse |= refuse
            what += f"{told}; "
        must_refuse = must_refuse and what.count(";") == 1
    text = to_toml(document)
    if kind == "lines":
        text, what = mutated_lines(rng, text)
    elif kind == "sheet":
        formed = folder / "wrong.nc"
        field, value = rng.choice(FIELDS), rng.choice(ODD)
        _write_formed(formed, field, value, everywhere=rng.random() < 0.3)
        what = f"{field} = {value}"
    case.write_text(text, encoding="utf-8", errors="replace")
    filled: list[FilledPart] = []
    return Case(
        (), f"{name}: {what}", [case, formed], None, must_refuse, lambda: _complaint(filled),
        lambda: filled.append(fill(read_formed_part(formed), read_infiltration(case))),
    )  # fmt: skip


def _write_formed(
    path: Path, odd: str = "", value: float = 0.0, *, everywhere: bool = False
) -> None:
    x, y = np.linspace(0.0, LENGTH, COLUMNS + 1), np.linspace(0.0, WIDTH, ROWS + 1)
    points = np.stack([c.ravel() for c in np.meshgrid(x, y, [0.0], indexing="ij")], axis=1)
    node = np.arange(len(points)).reshape(COLUMNS + 1, ROWS + 1)
    quads = np.stack([node[:-1, :-1], node[1:, :-1], node[1:, 1:], node[:-1, 1:]], axis=-1)
    quads = quads.reshape(-1, 4)
    values = {"thickness": 1.1e-3, "fibre_volume_fraction": 0.6 / (1810.0 * 1.1e-3),
              "areal_fibre_mass": 0.6, "shear_angle": 0.0, "permeability_1": 1e-10,
              "permeability_2": 1e-10, "permeability_3": 1e-11}  # fmt: skip
    for stem, count in (("fibre_direction", 2), ("permeability_direction", 3)):
        for number in range(1, count + 1):
            for axis, letter in enumerate("xyz"):
                values[f"{stem}_{number}_{letter}"] = float(axis == number - 1)
    units = {"thickness": "m", "areal_fibre_mass": "kg m-2", "shear_angle": "rad"}
    units |= {f"permeability_{number}": "m2" for number in (1, 2, 3)}
    mesh = UgridMesh("sheet")
    variables = {**mesh.topology(quads, long_name="sheet"), **mesh.node_positions(points)}
    for name, number in values.items():
        own = np.full(len(quads), number)
        if name == odd:
            own[slice(None) if everywhere else 7] = value
        variables[name] = mesh.on_cells(own, {"units": units.get(name, "1"), "long_name": name})
    about = {"Conventions": "CF-1.11 UGRID-1.0", "state": "complete", "scene": SCENE}
    path.unlink(missing_ok=True)
    write_netcdf(path, {"/": mesh.dataset(variables, about)})


def _complaint(filled: list[FilledPart]) -> str | None:
    """Say what is wrong with a filling that was accepted."""
    (found,) = filled
    for name in ("fill", "pressure", "resin_volume", "velocity", "thickness"):
        if not np.isfinite(getattr(found, name)).all():
            return f"{name} is not finite"
    if found.fill.min() < 0.0 or found.fill.max() > 1.0 + 1e-9:
        return f"a fill factor of {found.fill.min():g} or {found.fill.max():g}"
    entered = found.history.injected[-1].sum() + found.history.stored[0] + found.state.from_film
    worst = np.abs(found.history.balance_error).max()
    if worst > 1e-9 * max(entered, 1e-300):
        return f"the resin is out of balance by {worst:g} of {entered:g} m³"
    return None
