"""``report.html``: verdicts, numbers, pictures, curves and a 3D view of a run, in one file.

It needs no network. The scripts of the page draw the curves and the view from packed numbers.
"""

from __future__ import annotations

import base64
import io
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from matplotlib import colormaps
from numpy.typing import ArrayLike
from PIL import Image
from plotly.offline import get_plotlyjs

from lcmchain import __version__
from lcmchain.atomic import replacing
from lcmchain.fields.dataset import HISTORY, SHEET
from lcmchain.fields.loads import has_histories, mean_force
from lcmchain.fields.saved import SAMPLE, tool_places
from lcmchain.fields.sheet import reference_positions, sheet_faces, sheet_positions, vector
from lcmchain.fields.stack import PLY, ply_names
from lcmchain.fields.stages import STAGE, borders
from lcmchain.fields.summary import punch_index, tool_force_magnitude
from lcmchain.fields.ugrid import TIME
from lcmchain.judgements.grades import GRADES, worst_grade
from lcmchain.judgements.verdicts import verdicts
from lcmchain.report.chapters import dry_spot_rows, filling_rows, mapping_rows, stage_chapters
from lcmchain.report.numbers import (
    gripper_table,
    grouped_warnings,
    key_numbers,
    load_table,
    ply_numbers,
)
from lcmchain.report.style import (
    BETWEEN_SHOWN,
    CAPTIONS,
    SERIES,
    SHOWN,
    STACK_SHOWN,
    Shown,
    caption_of,
    colour_scale,
)
from lcmchain.report.view import boundary_edges, hangs_down
from lcmchain.results import COMPLETE
from lcmchain.scene.stages import at_work
from lcmchain.tools.table import rotation_and_shift
from lcmchain.tools.tool import tool_surface

if TYPE_CHECKING:
    import xarray as xr

    from lcmchain.effects.effect import Effect
    from lcmchain.scene import Scene
    from lcmchain.tools.tool import Tool


REPORT_FILE = "report.html"
ASSETS = Path(__file__).resolve().parent / "assets"

#: Quality of the pictures in the report; the files beside it are without loss.
WEBP_QUALITY = 88


def write_report(
    folder: Path | str,
    scene: Scene,
    effects: Sequence[Effect],
    datasets: Mapping[str, xr.Dataset],
    summary: Mapping[str, Any],
    *,
    pictures: Sequence[str] = (),
) -> Path:
    """Write ``report.html`` into the folder of the results, complete or not at all.

    Parameters
    ----------
    folder : of the results.
    scene : of the run.
    effects : from :func:`lcmchain.check.run_effects`.
    datasets : groups of ``forming.nc``, also of a run that was stopped.
    summary : content of ``summary.json``; what it does not hold is left out.
    pictures : names of PNG files of the run in the folder.

    Raises
    ------
    InputError : the folder cannot be written.
    OutputError : writing failed on the way.
    """
    environment = Environment(
        loader=FileSystemLoader(ASSETS), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    packed = list(_pictures(Path(folder), pictures))
    chapters = stage_chapters(summary, datasets, packed)
    in_chapters = {picture[0] for _, _, own in chapters for picture in own}
    text = environment.get_template("report.html").render(
        _content(scene, effects, datasets, summary),
        stages=chapters,
        pictures=[picture for picture in packed if picture[0] not in in_chapters],
        style=(ASSETS / "report.css").read_text(encoding="utf-8"),
        script=(ASSETS / "report.js").read_text(encoding="utf-8"),
        plotly=get_plotlyjs(),
    )
    path = Path(folder) / REPORT_FILE
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return path


def _content(
    scene: Scene,
    effects: Sequence[Effect],
    datasets: Mapping[str, xr.Dataset],
    summary: Mapping[str, Any],
) -> dict[str, Any]:
    sheet, history = datasets[SHEET], datasets[HISTORY]
    checks = verdicts(summary, scene, datasets)
    counts = {grade: sum(v.grade == grade for v in checks) for grade in reversed(GRADES)}
    return {
        "title": scene.title,
        "version": __version__,
        "state": summary.get("state", COMPLETE),
        "worst": worst_grade(checks),
        "counts": {grade: count for grade, count in counts.items() if count},
        "verdicts": checks,
        "numbers": [*key_numbers(summary), *ply_numbers(summary)],
        "loads": [
            (what, *table)
            for what, table in (
                ("tools", load_table(summary)),
                ("grippers", gripper_table(summary)),
            )
            if table[1]
        ],
        "warnings": grouped_warnings(summary),
        "data": {
            "series": SERIES,
            "curves": curve_data(history),
            "view": view_data(sheet, tool_data(scene, sheet, history)),
        },
        "effects": effects,
        "given": scene.source.given,
        "defaulted": scene.source.defaulted,
        "mappings": [(name, mapping_rows(r)) for name, r in summary.get("mapping", {}).items()],
        "fillings": [
            (name, list(filling_rows(r)), list(dry_spot_rows(r)))
            for name, r in summary.get("infiltration", {}).items()
        ],
        "provenance": list(_provenance_rows(summary.get("provenance", {}))),
        "scene_text": scene.source.text,
    }


def _pictures(folder: Path, names: Sequence[str]) -> Iterator[tuple[str, str, str]]:
    """Yield file name, caption and data address of pictures in the order of ``CAPTIONS``."""
    order = list(CAPTIONS)
    for name in sorted(names, key=lambda n: order.index(n) if n in order else len(order)):
        packed = io.BytesIO()
        with Image.open(folder / name) as picture:
            picture.convert("RGB").save(packed, "WEBP", quality=WEBP_QUALITY)
        address = f"data:image/webp;base64,{base64.b64encode(packed.getvalue()).decode()}"
        yield name, caption_of(name), address


def _provenance_rows(origin: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield names and values of what :func:`lcmchain.provenance.provenance` gathers."""
    for name, value in origin.items():
        if name == "files":
            for entry in value:
                yield f"SHA-256 of {entry['file']} ({entry['key']})", entry["sha256"]
        elif name == "libraries":
            yield from value.items()
        elif value is not None:
            label = name.replace("_", " ").replace("sha256", "SHA-256")
            yield label, str(value)


# --- data for the scripts of the page -------------------------------------------------------------


def _packed(values: ArrayLike, kind: str) -> str:
    """Return the numbers as base64; ``kind`` is ``"<f4"`` or ``"<i4"``."""
    return base64.b64encode(np.ascontiguousarray(values, dtype=kind).tobytes()).decode()


# --- curves of the run ----------------------------------------------------------------------------


#: Digits of the numbers: more than any plot shows.
DIGITS = 6
#: Energies in the order of the legend; others follow.
ENERGIES = (
    "external", "internal", "friction", "damping", "mass_damping", "hourglass", "inelastic",
    "viscous",     "contact", "kinetic", "balance_error",
)  # fmt: skip


def curve_data(history: xr.Dataset) -> dict[str, Any]:
    """Return forces over time and travel, and the energies over time, ready for JSON.

    They are those of the histories where a result has them, else those of the frames.

    Returns
    -------
    ``time`` [ms]; ``stages``: name and ``end`` [ms], none without stages; ``tools``: name,
    ``travel`` [mm], ``force`` [N], the mean over each interval, and ``peak`` [N], the largest of
    single steps (None of frames); ``punch``, the index of the tool whose travel is the stroke, None
    without tools; ``energies`` [J]: name, ``values``.
    """
    histories = has_histories(history)
    stem, clock = ("history_energy_", SAMPLE) if histories else ("energy_", "time")
    names = [str(name).removeprefix(stem) for name in history if str(name).startswith(stem)]
    names.sort(key=lambda name: ENERGIES.index(name) if name in ENERGIES else len(ENERGIES))
    return {
        "time": _numbers(1e3 * history[clock].values),
        "stages": [{"name": name, "end": end} for name, end in borders(history)],
        "tools": _tools(history, histories),
        "punch": punch_index(history) if history.sizes["tool"] else None,
        "energies": [
            {"name": name.replace("_", " "), "values": _numbers(history[f"{stem}{name}"].values)}
            for name in names
        ],
    }


def _tools(history: xr.Dataset, histories: bool) -> list[dict[str, Any]]:
    if not history.sizes["tool"]:
        return []
    stem = "history_tool" if histories else "tool"
    travel = 1e3 * history[f"{stem}_travel"].values
    force = mean_force(history) if histories else tool_force_magnitude(history)
    peak = history["history_tool_peak_force"].values if histories else None
    return [
        {
            "name": str(name),
            "travel": _numbers(travel[:, tool]),
            "force": _numbers(force[:, tool]),
            "peak": None if peak is None else _numbers(peak[:, tool]),
        }
        for tool, name in enumerate(history["tool"].values)
    ]


def _numbers(values: np.ndarray) -> list[float | None]:
    """Return the numbers with the digits that a plot needs, None where they are not finite."""
    return [float(f"{value:.{DIGITS}g}") if np.isfinite(value) else None for value in values]


# --- formed shape and its fields ------------------------------------------------------------------


#: Most saved frames that the view holds, and what positions and fields of all may take [byte].
MOST_FRAMES = 12
BUDGET = 5_000_000

#: Colours of a scale, evenly spaced.
COLOURS = 24

_PRESSURE, _STRAIN = ("kPa", 1e-3), ("%", 100.0)
_RISK = ("", 1.0, "YlOrRd", False, 2, 0.0, 1.0)
_AREAL_MASS = ("g/m²", 1e3, "YlGnBu", False, 1)
#: How fields are shown of which no picture is drawn.
_OTHERS = (
    Shown("fibre_strain_1", "Strain of fibre 1", *_STRAIN, "PuOr_r", True, 3),
    Shown("fibre_strain_2", "Strain of fibre 2", *_STRAIN, "PuOr_r", True, 3),
    Shown("fibre_strain_3", "Strain of fibre 3", *_STRAIN, "PuOr_r", True, 3),
    Shown("strain_across", "Strain across the fibres", *_STRAIN, "PuOr_r", True, 2),
    Shown("shear_angle_23", "Shear angle, fibres 2, 3", "°", 180.0 / np.pi, "RdBu_r", True, 1),
    Shown("shear_angle_31", "Shear angle, fibres 3, 1", "°", 180.0 / np.pi, "RdBu_r", True, 1),
    Shown("compaction_pressure", "Compaction pressure", *_PRESSURE, "viridis", False, 2),
    Shown("bending_pressure", "Pressure of bending", *_PRESSURE, "viridis", False, 2),
    Shown("wrinkle_risk_compression", "Risk by compression", *_RISK),
    Shown("wrinkle_risk_locking", "Nearness of locking", *_RISK),
    Shown("wrinkle_risk_waves", "Risk by unresolved waves", *_RISK),
    Shown("areal_fibre_mass", "Fibre mass per area", *_AREAL_MASS),
    *(
        Shown(f"permeability_{i}", f"Principal permeability {i}", "µm²", 1e12, "cividis", False, 3)
        for i in (1, 2, 3)
    ),
    Shown("tool_pressure_top", "Tools on the upper face", *_PRESSURE, "viridis", False, 2),
    Shown("tool_pressure_bottom", "Tools on the lower face", *_PRESSURE, "viridis", False, 2),
    Shown("tool_pressure", "Tools on both faces", *_PRESSURE, "viridis", False, 2),
    *BETWEEN_SHOWN,
    Shown("ply_pressure_bottom", "Other plies on the lower face", *_PRESSURE, "viridis", False, 2),
    Shown("slip_path_bottom", "Slip path of the lower face", "mm", 1e3, "cividis", False, 2),
    Shown("ply_gap_top", "Gap over the upper face", "mm", 1e3, "PuOr_r", True, 3),
    Shown("ply_gap_bottom", "Gap under the lower face", "mm", 1e3, "PuOr_r", True, 3),
    *STACK_SHOWN,
    Shown("stack_areal_fibre_mass", "Fibre mass per area of the stack", *_AREAL_MASS),
    Shown("stack_ply_count", "Plies over each other", "", 1.0, "viridis", False, 0),
    Shown("pore_pressure", "Pressure in the pores", *_PRESSURE, "viridis", False, 2),
    Shown("displacement", "Displacement", "mm", 1e3, "cividis", False, 2),
)
_SHOWN: dict[str, Shown] = {shown.name: shown for shown in (*SHOWN, *_OTHERS)}


def view_data(sheet: xr.Dataset, tools: list[dict[str, Any]] | None = None) -> dict[str, Any]:
    """Return shape and scalar fields of some frames, the first and the last among them, for JSON.

    Parameters
    ----------
    sheet : root group of a result.
    tools : from :func:`tool_data`.

    Returns
    -------
    ``faces``: nodes (face_count, 4), a triangle repeats its last; ``frames``: number in the result,
    time [ms], ``positions`` [mm]; ``fields``: name, title, unit, ``place`` ("face" or "node"),
    limits and colours, ``values`` by frame; ``plies``: of a stack, name and ranges of faces and
    nodes of every ply; ``hangs_down``: whether the sheet is drawn downwards.
    Arrays are base64 of little-endian int32 and float32.
    """
    faces = sheet_faces(sheet)
    names, plies = ply_names(sheet), []
    for number, name in enumerate(names):
        own = np.flatnonzero(sheet[PLY].values == number)
        plies.append(
            {
                "name": name,
                "faces": [int(own[0]), int(own[-1]) + 1],
                "nodes": [int(faces[own].min()), int(faces[own].max()) + 1],
            }
        )
    fields = list(_fields(sheet))
    nodes = len(reference_positions(sheet))
    size = 4 * (3 * nodes + sum(values.shape[1] for _, _, values in fields))
    frames = chosen_frames(sheet.sizes[TIME], size)
    return {
        "faces": _packed(faces, "<i4"),
        "frames": [
            {
                "number": int(frame),
                "time": 1e3 * float(sheet[TIME].values[frame]),
                "positions": _packed(1e3 * sheet_positions(sheet, int(frame)), "<f4"),
            }
            for frame in frames
        ],
        "fields": [_field(shown, place, values, frames) for shown, place, values in fields],
        "hangs_down": bool(hangs_down(sheet_positions(sheet), boundary_edges(faces))),
        "tools": tools or [],
        "plies": plies,
    }


def chosen_frames(frame_count: int, size: int) -> list[int]:
    """Return frames, evenly spaced, the last always and the first if there is room for two.

    size : of one frame [byte].
    """
    count = int(np.clip(BUDGET // size, 1, min(MOST_FRAMES, frame_count)))
    if count == 1:
        return [frame_count - 1]
    return np.unique(np.linspace(0, frame_count - 1, count).round().astype(int)).tolist()


def _fields(sheet: xr.Dataset) -> Iterator[tuple[Shown, str, np.ndarray]]:
    """Yield every scalar field with its place and values (F, n) in the unit shown."""
    places = {sheet["sheet_face_nodes"].dims[0]: "face", sheet["displacement_x"].dims[-1]: "node"}
    shown_first = [name for name in _SHOWN if name in sheet]
    for name in dict.fromkeys([*shown_first, *map(str, sheet.data_vars)]):
        dims = sheet[name].dims
        if len(dims) != 2 or dims[0] != TIME or dims[1] not in places or _is_component(name):
            continue
        shown = _SHOWN.get(name) or _as_declared(name, sheet[name].attrs)
        yield shown, places[dims[1]], shown.factor * sheet[name].values
    length = np.linalg.norm(vector(sheet, "displacement"), axis=-1)
    shown = _SHOWN["displacement"]
    yield shown, "node", shown.factor * length


def _is_component(name: str) -> bool:
    return name.endswith(("_x", "_y", "_z"))


def _as_declared(name: str, attributes: Mapping[str, Any]) -> Shown:
    """Show a field without an entry here, such as one that a law remembers, in its own unit."""
    title = str(attributes.get("long_name", name.replace("_", " ")))
    unit = str(attributes.get("units", ""))
    return Shown(name, title[:1].upper() + title[1:], unit if unit != "1" else "", 1.0, "viridis",
                 False, 4)  # fmt: skip


def _field(shown: Shown, place: str, values: np.ndarray, frames: list[int]) -> dict[str, Any]:
    low, high = _limits(shown, values[-1])
    return {
        "name": shown.name,
        "title": shown.title,
        "unit": shown.unit,
        "decimals": shown.decimals,
        "place": place,
        "low": low,
        "high": high,
        "colours": _colours(shown.colour_map),
        "values": [_packed(values[frame], "<f4") for frame in frames],
    }


def _limits(shown: Shown, values: np.ndarray) -> tuple[float, float]:
    """Return the values of the first and the last colour, as in the pictures where there is one."""
    if shown.signed and shown not in SHOWN:  # pictures round up to whole units: too much here
        _, limit = colour_scale(np.abs(values), _SHOWN["displacement"]).get_clim()
        return -float(limit or 1.0), float(limit or 1.0)
    low, high = colour_scale(values, shown).get_clim()
    return float(low), float(high if high > low else low + 1.0)  # all zero


def _colours(name: str) -> list[list[Any]]:
    places = np.linspace(0.0, 1.0, COLOURS)
    rgb = (255.0 * colormaps[name](places)[:, :3]).round().astype(int)
    return [[float(place), f"rgb({r},{g},{b})"] for place, (r, g, b) in zip(places, rgb)]


# --- tools around the shape -----------------------------------------------------------------------


#: Surfaces with more triangles than this in all are left out, the finest first.
MOST_TRIANGLES = 60_000
# Room around the sheet that tools are cut to, in parts of its length.
MARGIN = (0.08, 0.08, 0.25)


def tool_data(scene: Scene, sheet: xr.Dataset, history: xr.Dataset) -> list[dict[str, Any]]:
    """Return index, name, ``points`` [mm] and ``triangles`` of every tool, and its ``shift`` [mm].

    Parameters
    ----------
    scene : with the tools in the order of the result.
    sheet, history : root group and ``/history`` of the result.

    Returns
    -------
    Plain values for JSON; arrays as in :func:`view_data`. ``shift`` has
    three numbers for every saved frame, ``works`` whether the tool is at work in it; with ``turn``
    of a tool that turns, the nine of a rotation that comes before. A tool outside the room around
    the sheet is left out, and so is one that is never at work.
    """
    corners = np.concatenate([reference_positions(sheet), sheet_positions(sheet)])
    low, high = corners.min(axis=0), corners.max(axis=0)
    margin = np.array(MARGIN) * float(max(high - low))
    box = np.array([low - margin, high + margin])
    surfaces = [tool_surface(tool, scene.source.directory, box) for tool in scene.tools]
    tools: list[dict[str, Any]] = []
    places = tool_places(history)
    for index in _shown(surfaces):
        points, triangles = surfaces[index]
        tool = scene.tools[index]
        works = _at_work(scene, tool, history)
        if not any(works):
            continue
        rotations, shifts = _places(tool, places[:, index])
        tools.append(
            {
                "index": index,
                "name": tool.name,
                "points": _packed(1e3 * points, "<f4"),
                "triangles": _packed(triangles, "<i4"),
                "shift": np.round(1e3 * shifts, 4).tolist(),
                "works": works,
            }
        )
        if rotations is not None:
            tools[-1]["turn"] = np.round(rotations.reshape(-1, 9), 6).tolist()
    return tools


def _places(tool: Tool, travels: np.ndarray) -> tuple[np.ndarray | None, np.ndarray]:
    """Return rotations (F, 3, 3) of a tool, None without, and shifts (F, 3) [m] in all frames."""
    key = f'tool "{tool.name}"'
    entries = tool.motion.table_entries(tool.local_axes(key=key)[2], math.inf, key=key)
    direction, axis, point = (entries[name] for name in ("direction", "turn_axis", "turn_point"))
    where = [rotation_and_shift(direction, axis, point, float(travel)) for travel in travels]
    shifts = np.array([shift for _, shift in where]).reshape(-1, 3)
    if not axis.any():
        return None, shifts
    return np.array([rotation for rotation, _ in where]), shifts


def _at_work(scene: Scene, tool: Tool, history: xr.Dataset) -> list[bool]:
    """Tell in which saved frames a tool is at work."""
    if STAGE not in history:
        return [True] * history.sizes["time"]
    by_stage = [at_work(tool, stage) for stage in scene.stages]
    return [by_stage[int(number)] for number in history[STAGE].values]


def _shown(surfaces: list[tuple[np.ndarray, np.ndarray]]) -> list[int]:
    """Return the tools with a surface in the room, the coarsest first, up to ``MOST_TRIANGLES``."""
    chosen, room = [], MOST_TRIANGLES
    for index in sorted(range(len(surfaces)), key=lambda i: len(surfaces[i][1])):
        room -= len(surfaces[index][1])
        if len(surfaces[index][1]) and room >= 0:
            chosen.append(index)
    return sorted(chosen)
