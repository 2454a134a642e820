"""Wrong scenes: all examples and presets with one to three changes, and wrong tool files."""

from __future__ import annotations

import math
import random
import shutil
import tomllib
import warnings
from functools import cache
from pathlib import Path

import numpy as np
from contract import Case
from mutations import mutated_bytes, mutated_document, mutated_lines, near_document, to_toml

from lcmchain.draping import drape
from lcmchain.errors import LcmchainError
from lcmchain.model import build_model
from lcmchain.scene import Scene, read_scene
from lcmchain.scene.presets import PRESETS

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"

#: Elements and grid nodes above which a scene that is valid is not built: it may take long.
MOST_ELEMENTS = 5_000
FINEST_SPACING = 2e-3

_PLAIN = """
process = { time = "20 ms", gravity = true }
blank = { size = ["100 mm", "80 mm"], edge_length = "10 mm", height = "0.6 mm" }
"""
_LAWS = {
    "isotropic": """law = "isotropic"
thickness = "1 mm"
density = "7850 kg/m^3"
young_modulus = "210 GPa"
poisson_ratio = 0.3
""",
    "orthotropic": """law = "orthotropic"
thickness = "1 mm"
density = "1600 kg/m^3"
E1 = "100 GPa"
E2 = "10 GPa"
E3 = "10 GPa"
nu12 = 0.3
nu13 = 0.3
nu23 = 0.4
G12 = "5 GPa"
G13 = "5 GPa"
G23 = "3 GPa"
""",
    "stiffness": """law = "stiffness"
thickness = "1 mm"
density = "1600 kg/m^3"
membrane = ["10 2 0 0 0 0 MPa", "2 10 0 0 0 0 MPa", "0 0 5 0 0 0 MPa",
            "0 0 0 1 0 0 MPa", "0 0 0 0 1 0 MPa", "0 0 0 0 0 1 MPa"]
bending = ["10 2 0 0 0 0 MPa", "2 10 0 0 0 0 MPa", "0 0 5 0 0 0 MPa",
           "0 0 0 1 0 0 MPa", "0 0 0 0 1 0 MPa", "0 0 0 0 0 1 MPa"]
""",
}
_TOOLS = """
[[tools]]
name = "cone"
shape = { type = "cone", tip_radius = "5 mm", half_angle = "40 deg" }
position = "0 0 2 mm"
motion = { type = "table", direction = [0, 0, -1], times = "0 5 20 ms", travel = "0 2 9 mm" }
[[tools]]
name = "die"
shape = { type = "revolved_profile", solid = "right", points = ["0 -9 mm", "20 -9 mm", "40 0 mm", \
"300 0 mm"], fillet_radii = "0 3 3 0 mm" }
friction = 0.3
[[tools]]
name = "rod"
shape = { type = "cylinder", radius = "5 mm", length = "60 mm", edge_radius = "1 mm" }
position = "0 0 40 mm"
axis = [1, 0, 0]
"""


@cache
def base_texts() -> dict[str, str]:
    """Texts of the scenes that are changed, coarse enough to be built in a moment."""
    texts = {}
    for file in sorted(EXAMPLES.glob("*/scene.toml")):
        texts[file.parent.name] = file.read_text(encoding="utf-8")
    for name in PRESETS:
        texts[f"preset {name}"] = f'{_PLAIN}material = {{ preset = "{name}" }}\n{_TOOLS}'
    for name, law in _LAWS.items():
        texts[name] = f"{_PLAIN}\n[material]\n{law}{_TOOLS}"
    texts["outline"] = texts[f"preset {next(iter(PRESETS))}"].replace(
        'size = ["100 mm", "80 mm"]',
        'outline = ["0 0 mm", "90 0 mm", "70 60 mm", "10 50 mm"], fibre_angle = "30 deg"',
    )
    return texts


@cache
def base_documents() -> dict[str, dict]:
    documents = {name: tomllib.loads(text) for name, text in base_texts().items()}
    for document in documents.values():
        for sheet in document.get("plies", [document.get("blank")]):
            sheet["edge_length"] = "20 mm" if _is_large(sheet) else "10 mm"
        for tool in document.get("tools", ()):
            if tool["shape"].get("type") == "surface_mesh":
                tool["shape"]["spacing"] = "8 mm"
    return documents


def _is_large(sheet: dict) -> bool:
    return "size" in sheet and float(sheet["size"][0].split()[0]) > 150


def prepare(folder: Path) -> None:
    """Copy the files that the examples name into a folder."""
    for file in [*EXAMPLES.glob("*/*.stl"), *EXAMPLES.glob("*/*.vtu")]:
        shutil.copy(file, folder / file.name)


def sound_calls(folder: Path) -> list[list[str]]:
    """Write scenes that are right and return the calls that check them."""
    calls = []
    for name in ("stl_tool", "isotropic"):
        file = folder / f"{name}.toml"
        file.write_text(to_toml(base_documents()[name]), encoding="utf-8")
        calls.append(["check", str(file), "--out", str(folder / "out")])
    return calls


def drawn_rarely(draw):
    """Draw the picture of the start for every tenth case: it takes longer than all the rest."""
    count = 0

    def drawn(*arguments, **named):
        nonlocal count
        count += 1
        if count % 10 == 0:
            draw(*arguments, **named)

    return drawn


def make(rng: random.Random, folder: Path) -> Case:
    """Write a wrong scene and return the call that checks it."""
    file = folder / "scene.toml"
    if rng.random() < 0.12:
        text, what, must_refuse, files = _wrong_tool_file(rng, folder)
        content = text.encode()
    else:
        content, what, must_refuse = _wrong_scene(rng)
        files = [file]
    file.write_bytes(content)
    out = folder / "out"
    case = Case(
        ["check", str(file), "--out", str(out)], what, [file, *files], out, must_refuse,
        check=lambda: _complaint(file),
    )  # fmt: skip
    return _only_read(case, file) if _is_too_large(file) else case


def _only_read(case: Case, file: Path) -> Case:
    return Case(
        (), f"{case.what} (large, read only)", case.files, None, case.must_refuse,
        call=lambda: read_scene(file),
    )  # fmt: skip


def _is_too_large(file: Path) -> bool:
    """Whether a scene is valid and would take long to build, as it may."""
    try:
        scene = read_scene(file)
    except BaseException:  # the case itself shows what it is
        return False
    count = sum(np.prod(ply.blank.extent) / ply.blank.edge_length**2 for ply in scene.stack)
    # Beyond two million elements it must be refused at once.
    fine = MOST_ELEMENTS < count <= 2e6
    for tool in scene.tools:
        spacing = getattr(tool.shape, "spacing", 1.0)
        fine |= spacing is None or 1e-5 < spacing < FINEST_SPACING
    return fine


def _wrong_scene(rng: random.Random) -> tuple[bytes, str, bool]:
    name = rng.choice(sorted(base_texts()))
    kind = rng.random()
    if kind < 0.25:
        document, count = near_document(rng, base_documents()[name])
        return to_toml(document).encode(), f"{name}: {count} sizes changed", False
    if kind < 0.7:
        document, notes, must_refuse = base_documents()[name], [], False
        for _ in range(rng.choice([1, 1, 1, 2, 3])):
            document, note, refuse = mutated_document(rng, document)
            notes.append(note)
            # A later change may take back an earlier one.
            must_refuse = refuse
        text = to_toml(document)
        return text.encode("utf-8", "surrogatepass"), f"{name}: {', '.join(notes)}", must_refuse
    text = to_toml(base_documents()[name]) if rng.random() < 0.3 else base_texts()[name]
    if kind < 0.82:
        text, note = mutated_lines(rng, text)
        return text.encode(), f"{name}: {note}", False
    if kind < 0.93:
        content, note = mutated_bytes(rng, text.encode())
        return content, f"{name}: {note}", False
    return _monster(rng, text, name)


def _plate(number: int) -> str:
    shape = '{ type = "plate", side = "below" }'
    return f'\n[[tools]]\nname = "m{number}"\nshape = {shape}\nposition = "0 0 -500 mm"\n'


def _monster(rng: random.Random, text: str, name: str) -> tuple[bytes, str, bool]:
    """Encodings, depth and sizes."""
    depth, count = rng.choice([10, 500, 5000, 50_000]), rng.choice([100, 10_000, 200_000])
    monsters = {
        "byte-order mark": (b"\xef\xbb\xbf" + text.encode(), False),
        "UTF-16": (text.encode("utf-16"), True),
        "Latin-1": (f'title = "é"\n{text}'.encode("latin-1"), True),
        "nested brackets": (f"{text}\n[x]\na = {'[' * depth}{']' * depth}\n".encode(), True),
        "nested tables": (f"{text}\n[x]\na = {'{a=' * depth}1{'}' * depth}\n".encode(), True),
        "dotted key": (f"{text}\n[{'.'.join('a' * depth)}]\n".encode(), True),
        "long unit": (f'{text}\n[output]\nhistory_interval = "1 {"m" * count}"\n'.encode(), True),
        "long product": (f'{text}\n[x]\nhistory_interval = "1 {"s*" * count}s"\n'.encode(), True),
        "long number": (f'{text}\n[output]\nhistory_interval = "{"1" * count} s"\n'.encode(), True),
        "long key": (f"{text}\n[output]\n{'k' * count} = 1\n".encode(), True),
        "long whole number": (f"{text}\n[output]\nvtu = {'1' * count}\n".encode(), True),
        "many keys": (
            (f"{text}\n[output]\n" + "".join(f"k{i} = {i}\n" for i in range(count))).encode(), True
        ),
        "many tools": (
            (text + "".join(map(_plate, range(count // 50)))).encode(),
            count > 10_000,
        ),
        "many empty tools": ((text + "\n[[tools]]\n" * count).encode(), True),
        "many spaces": (text.replace(" = ", " = " + " " * count).encode(), False),
        "nothing": (b"", True),
        "zeros": (bytes(1000), True),
    }  # fmt: skip
    kind = rng.choice(sorted(monsters))
    content, must_refuse = monsters[kind]
    # Where the text is a single-line document, a table may stand there already.
    return content, f"{name}: {kind}", must_refuse


def _wrong_tool_file(rng: random.Random, folder: Path) -> tuple[str, str, bool, list[Path]]:
    """A scene with a sound tool entry whose file is wrong."""
    corners = rng.choice([_cube(), _cube(), _random_soup(rng)])
    kind = rng.choice(
        ["flat", "nan", "inf", "huge", "tiny", "turned", "repeated", "point", "bytes",
         "ascii bytes",
         "count", "named otherwise", "text", "empty", "sound", "few"]
    )  # fmt: skip
    must_refuse = kind in ("nan", "inf", "point", "text", "empty")
    name = "tool.stl"
    if kind == "flat":
        corners[..., 2] = 0.0
    elif kind in ("nan", "inf"):
        corners[rng.randrange(len(corners)), 0, 0] = math.nan if kind == "nan" else math.inf
    elif kind in ("huge", "tiny"):
        corners[rng.randrange(len(corners)), 1] *= 1e30 if kind == "huge" else 1e-30
    elif kind == "turned":
        corners[rng.randrange(len(corners))] = corners[rng.randrange(len(corners)), ::-1]
    elif kind == "repeated":
        corners = np.concatenate([corners, corners[: rng.randrange(len(corners))]])
    elif kind == "point":
        corners[...] = corners[0, 0]
    elif kind == "few":
        corners = corners[: rng.randrange(3)]
    content = _binary_stl(corners)
    if kind == "bytes":
        content, _ = mutated_bytes(rng, content)
    elif kind == "ascii bytes":
        content, _ = mutated_bytes(rng, _ascii_stl(corners))
    elif kind == "count":
        content = content[:80] + rng.randbytes(4) + content[84:]
    elif kind == "named otherwise":
        name = rng.choice(["tool.obj", "tool.vtu", "tool.ply", "tool.xyz", "tool", "tool.msh"])
    elif kind in ("text", "empty"):
        content = b"" if kind == "empty" else b"solid nothing\n" + bytes(range(256))
    (folder / name).write_bytes(content)
    text = _PLAIN + 'material = { preset = "MD600" }\n[[tools]]\nname = "stl"\n'
    text += f'shape = {{ type = "surface_mesh", file = "{name}", length_unit = "mm", '
    text += f'spacing = "{rng.choice([4, 8, 30])} mm" }}\nposition = "0 0 90 mm"\n'
    return text, f"tool file: {kind}", must_refuse, [folder / name]


def _cube() -> np.ndarray:
    """Triangles of a cube of 40 mm, shape [12, 3, 3]."""
    corner = np.array([[x, y, z] for z in (0, 40) for y in (0, 40) for x in (0, 40)], dtype=float)
    quads = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))
    return np.array([corner[[q[i] for i in t]] for q in quads for t in ((0, 1, 2), (0, 2, 3))])


def _random_soup(rng: random.Random) -> np.ndarray:
    return np.array([[[rng.uniform(0, 40) for _ in "xyz"] for _ in "abc"] for _ in range(9)])


def _binary_stl(corners: np.ndarray) -> bytes:
    record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    rows = np.zeros(len(corners), record)
    with np.errstate(over="ignore"):
        rows["corners"] = corners
    return bytes(80) + np.uint32(len(corners)).tobytes() + rows.tobytes()


def _ascii_stl(corners: np.ndarray) -> bytes:
    facets = "".join(
        "facet normal 0 0 0\nouter loop\n"
        + "".join("vertex {:g} {:g} {:g}\n".format(*corner) for corner in triangle)
        + "endloop\nendfacet\n"
        for triangle in corners
    )
    return f"solid tool\n{facets}endsolid tool\n".encode()


def _complaint(file: Path) -> str | None:
    """Say what is wrong with a scene that was accepted: numbers that are none."""
    scene: Scene = read_scene(file)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            if not scene.element.has_forces:
                net = drape(scene)
                said = net.is_whole or net.missing()
                return None if said else "a net that is not whole and does not say so"
            model = build_model(scene)
    except LcmchainError as error:
        return f"check accepted what the model refuses: {error}"
    for body in model.bodies:
        if not np.isfinite(body.mesh.node_positions).all():
            return "nodes that are not finite"
        if not all(map(math.isfinite, body.material.wave_stiffness())):
            return "a stiffness that is not finite"
    for name, column in model.tools._asdict().items():
        # A profile may reach to infinity, as that of a plate does; what no tool needs is not there.
        if column is not None and column.dtype.kind == "f" and np.isnan(column).any():
            return f"a column {name} of the tools that is no number"
    return None
