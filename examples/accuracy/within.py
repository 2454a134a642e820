"""Do runs keep the errors that were required, and the time? Five scenes, against fine runs.

    python examples/accuracy/within.py [--out DIR] [--table F.md] [--threads N] [--only NAME ...]

Each scene is run as `lcmchain run SCENE --within ERRORS` would run it, and then on a mesh with
edges shorter by 0.6; what both differ by is the true error, up to that of the fine run. The same
scenes are run with `--budget`. None of them was used to make the choice of settings: other tools,
sizes, fabrics and fibre angles than the hemispheres, with and without holder. Results that lie in
the folder already are taken from there.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from lcmchain.study.choice import mm, read_requirement
from lcmchain.study.chooser import Chooser
from lcmchain.study.comparison import BY_NAME, differences
from lcmchain.study.runs import Study, Workers
from lcmchain.study.sources import SceneText, Variant

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from with_time import entries_with_time

HERE = Path(__file__).resolve().parent
FINER = 0.6  # edges of the fine run, by those that were chosen

HEAD = """# Requirements and what became of them

Written by `python examples/accuracy/within.py --table FILE.md`: five scenes, each with errors that
it may have (`--within`) and with a time (`--budget`). The true error is what the run differs by
from one with edges shorter by 0.6.

"""

SPHERE = """
title = "{title}"
process = {{ time = "{time}", mass_damping = "200 1/s" }}
blank = {{ size = {size}, edge_length = "8 mm", fibre_angle = "{angle}", height = "0.502 mm" }}
material = {{ preset = "{fabric}" }}
contact = {{ friction = 0.2 }}

[[tools]]
name = "punch"
shape = {{ type = "sphere_capped_punch", radius = "{radius} mm" }}
position = "0 0 {top} mm"
motion = {{ type = "stroke", direction = [0, 0, -1], distance = "{depth} mm" }}

[[tools]]
name = "die"
shape = {{ type = "plate_with_hole", hole_radius = "{hole} mm", fillet_radius = "{fillet} mm", side = "below" }}
"""  # noqa: E501
HOLDER = """
[[tools]]
name = "holder"
shape = {{ type = "plate_with_hole", hole_radius = "{hole} mm", fillet_radius = "{fillet} mm", side = "above" }}
position = "0 0 {top} mm"
motion = {{ type = "guided", direction = [0, 0, -1], mass = "0.8 kg", ramp = "10 ms" }}
"""  # noqa: E501


def scene(name: str) -> SceneText:
    """Return one of the scenes."""
    if name == "elongated dome (STL)":
        return SceneText.from_file(
            HERE.parent / "stl_tool" / "scene.toml", entries_with_time("stl_tool")
        )
    common = {"top": 1.004, "fabric": "MD600", "angle": "0 deg", "time": "200 ms"}
    if name == "small sphere, no holder":
        values = common | {"size": '["160 mm", "160 mm"]', "radius": 40, "depth": 40, "hole": 42,
                           "fillet": 6, "time": "120 ms"}  # fmt: skip
        text = SPHERE
    elif name == "rectangular blank at 45°":
        values = common | {"size": '["300 mm", "220 mm"]', "radius": 60, "depth": 50, "hole": 62,
                           "fillet": 10, "angle": "45 deg"}  # fmt: skip
        text = SPHERE + HOLDER
    elif name == "shallow dome at 30°":
        values = common | {"size": '["240 mm", "240 mm"]', "radius": 90, "depth": 25, "hole": 70,
                           "fillet": 15, "angle": "30 deg"}  # fmt: skip
        text = SPHERE + HOLDER
    else:
        values = common | {"size": '["240 mm", "240 mm"]', "radius": 55, "depth": 45, "hole": 58,
                           "fillet": 10}  # fmt: skip
        text = SPHERE + HOLDER
    shear = [0.1, -1.2, 8.0, -22.0, 24.0]  # a softer fabric, tensor strain
    overrides = ()
    if name == "softer fabric":
        row = " ".join(str(value) for value in shear)
        overrides = (f'material.membrane.shear_polynomial="{row} MPa"',)
    path = str(HERE / "scene.toml")
    return SceneText(text.format(title=name, **values), path, overrides)


REQUIREMENTS = {
    "small sphere, no holder": ("3 deg shear, 2 % thickness", "10 s"),
    "rectangular blank at 45°": ("2 deg shear, 2 % thickness", "20 s"),
    "shallow dome at 30°": ("1 deg shear, 1 % thickness", "20 s"),
    "softer fabric": ("2 deg shear, 2 % v_f, 2 mm contour", "20 s"),
    "elongated dome (STL)": ("2 deg shear, 2 % thickness", "15 s"),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("results/within"))
    parser.add_argument("--table", type=Path, help="Markdown file to write")
    parser.add_argument("--threads", type=int, default=None)
    parser.add_argument("--only", nargs="+", choices=REQUIREMENTS, default=list(REQUIREMENTS))
    arguments = parser.parse_args()
    lines = [
        "| scene | requirement | chosen | estimated | true error | of what is allowed "
        "| solver time | pilots |",
        "|---|---|---|---|---|---:|---:|---:|",
        *(kept_requirement(arguments, name) for name in arguments.only),
        "",
        "| scene | budget | solver time | of the budget | chosen |",
        "|---|---:|---:|---:|---|",
        *(kept_budget(arguments, name) for name in arguments.only),
    ]
    text = HEAD + "\n".join(lines) + "\n"
    print(text)
    if arguments.table is not None:
        arguments.table.write_text(text, encoding="utf-8")


def kept_requirement(arguments, name: str) -> str:
    """Run a scene within its requirement and then finely, and return the row of the table."""
    text, requirement = scene(name), read_requirement(REQUIREMENTS[name][0], None)
    folder = arguments.out / name.replace(" ", "_")
    chooser = Chooser(text, folder, requirement, threads=arguments.threads)
    study = Study(text, folder, Workers(1, arguments.threads))
    last = None

    def make(chosen):
        nonlocal last
        last = study.outcome(chooser.variant_of(chosen))
        return last

    choice = chooser.run(make)
    # the scene itself, finer; and slower where inertia was found to leave too much
    entries = [f'blank.edge_length="{1e3 * FINER * choice.edge_length:.9g} mm"']
    if choice.settings.time > 1.0:
        time = choice.settings.time * text.scene().process.time
        entries.append(f'process.time="{1e3 * time:.9g} ms"')
    fine = study.outcome(Variant(f"finer than {mm(choice.edge_length)}", "within", tuple(entries)))
    true = differences(last, fine)
    part = max(true[q].typical / allowed for q, allowed in requirement.errors.items())
    row = [
        name,
        REQUIREMENTS[name][0],
        ", ".join([mm(choice.edge_length), *choice.settings.in_words()]),
        ", ".join(BY_NAME[q].text(choice.found[q]) for q in requirement.errors),
        ", ".join(BY_NAME[q].text(true[q].typical) for q in requirement.errors),
        f"{part:.2f}",
        f"{choice.seconds:.1f} s",
        f"{choice.pilot_seconds:.1f} s",
    ]
    print(row, choice.notes, flush=True)
    return f"| {' | '.join(row)} |"


def kept_budget(arguments, name: str) -> str:
    """Run a scene within its budget, and return the row of the table."""
    text, requirement = scene(name), read_requirement(None, REQUIREMENTS[name][1])
    folder = arguments.out / f"{name.replace(' ', '_')}_budget"
    chooser = Chooser(text, folder, requirement, threads=arguments.threads)
    study = Study(text, folder, Workers(1, arguments.threads))

    def make(chosen):
        return study.outcome(chooser.variant_of(chosen))

    choice = chooser.run(make)
    row = [
        name,
        REQUIREMENTS[name][1],
        f"{choice.seconds:.1f} s",
        f"{choice.seconds / requirement.budget:.2f}",
        mm(choice.edge_length),
    ]
    print(row, flush=True)
    return f"| {' | '.join(row)} |"


if __name__ == "__main__":
    main()
