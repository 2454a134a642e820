"""All pictures of a run, and its film where the scene asks for one."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lcmchain.errors import InputError
from lcmchain.fields.dataset import HISTORY, SHEET
from lcmchain.fields.saved import tool_places
from lcmchain.fields.sheet import course_names, sheet_positions
from lcmchain.fields.stack import ply_names, without_films
from lcmchain.fields.stages import last_frames
from lcmchain.fields.summary import has_forces
from lcmchain.report.animation import draw_animation
from lcmchain.report.drawn_tools import RunTools
from lcmchain.report.pictures import (
    draw_between_tools,
    draw_courses,
    draw_fibre_directions,
    draw_field,
)
from lcmchain.report.plots import draw_energy, draw_force, draw_force_over_travel
from lcmchain.report.sections import Plane, default_planes, draw_sections
from lcmchain.report.shown import CAPTIONS_OF_STAGE, SHOWN, STACK_SHOWN, picture_name
from lcmchain.report.stack_pictures import draw_plies, draw_stack_sections
from lcmchain.scene.output import NO_FILM, Output

if TYPE_CHECKING:
    import xarray as xr

    from lcmchain.materials.law import Material
    from lcmchain.mesh.sheet_mesh import SheetMesh
    from lcmchain.scene import Scene
    from lcmchain.tools.table import ToolTable


def require_film(output: Output, sheets: Sequence[tuple[SheetMesh, Material]]) -> None:
    """Tell before a run whether the film that its scene asks for can be made.

    sheets : mesh and material of every ply.

    Raises
    ------
    InputError : the result will not have the field, or the writer is not installed.
    """
    if output.animation == NO_FILM:
        return
    field = output.animation_field
    needs_thickness = field in ("thickness", "fibre_volume_fraction")
    if needs_thickness and not all(mesh.has_thickness for mesh, _ in sheets):
        raise InputError(
            f'the 2D approach predicts no {field}; use "shear_angle" or "wrinkle_height"',
            key="output.animation_field",
        )
    without_density = any(material.fibre_density is None for _, material in sheets)
    if field == "fibre_volume_fraction" and without_density:
        raise InputError(
            "a material without fibre_density has no fibre_volume_fraction",
            key="output.animation_field",
        )
    if output.animation == "mp4" and importlib.util.find_spec("imageio_ffmpeg") is None:
        raise InputError(
            'an MP4 file needs imageio-ffmpeg: pip install "lcmchain[video]", or use "gif"',
            key="output.animation",
        )


def draw_stages(
    folder: Path,
    datasets: Mapping[str, xr.Dataset],
    tools: RunTools | None,
    planes: Sequence[Plane],
) -> list[Path]:
    """Draw the end of every stage; nothing without stages. Return the files."""
    files: list[Path] = []
    history = datasets[HISTORY]
    for number, (name, frame) in enumerate(last_frames(history), start=1):
        title = f"{datasets[SHEET].attrs.get('title', '')}  ·  stage {name}"
        sheet = datasets[SHEET].assign_attrs(title=title)
        groups = {**datasets, SHEET: sheet}
        travel = tool_places(history)[frame]
        present = None if tools is None else tools.in_frame(history, frame)
        paths = {what: folder / picture_name(number, name, what) for what in CAPTIONS_OF_STAGE}
        draw_field(paths["shear_angle"], sheet, SHOWN[0], frame)
        if ply_names(sheet):
            draw_stack_sections(paths["sections"], groups, planes, present, travel, frame)
        else:
            of_sheet = planes or default_planes(sheet)
            draw_sections(paths["sections"], groups, of_sheet, present, travel, frame)
        if present is not None:
            draw_between_tools(paths["tools"], sheet, present, travel, frame)
        else:
            del paths["tools"]
        files += paths.values()
    return files


def draw_run(
    scene: Scene,
    table: ToolTable,
    datasets: Mapping[str, xr.Dataset],
    folder: Path,
    report: Callable[[str], None],
) -> list[Path]:
    """Draw the last frame of a run, and its film where ``output.animation`` asks for one.

    Parameters
    ----------
    table : tools of the model, in the order of ``scene.tools``.
    datasets : groups of the result.
    report : called with what is being drawn.

    Returns
    -------
    The files written.

    Raises
    ------
    InputError : the folder cannot be written.
    """
    output = scene.output
    report("drawing")
    files: list[Path] = []
    sheet = datasets[SHEET]
    tools = RunTools.of_scene(scene, table, sheet_positions(sheet)) if scene.tools else None
    at_end = None if tools is None else tools.in_frame(datasets[HISTORY], -1)
    if output.pictures:
        planes = [
            Plane.through(np.array(s.point), np.array(s.normal), s.name) for s in output.sections
        ]
        files += draw_result(folder, datasets, tools=at_end, planes=planes)
        files += draw_stages(folder, datasets, tools, planes)
    if output.animation != NO_FILM:
        name = output.animation_field
        files.append(folder / f"animation_{name}.{output.animation}")
        draw_animation(
            files[-1], sheet, datasets[HISTORY], name, tools=tools,
            report=lambda done, total: report(f"drawing the film, frame {done} of {total}"),
        )  # fmt: skip
    return files


def draw_result(
    out_dir: Path | str,
    datasets: Mapping[str, xr.Dataset],
    frame: int = -1,
    *,
    tools: RunTools | None = None,
    planes: Sequence[Plane] = (),
) -> list[Path]:
    """Draw the formed shape, its fields and sections, and the energies and forces of the run.

    Parameters
    ----------
    out_dir : folder of the pictures in :data:`lcmchain.report.shown.CAPTIONS`: fields that the
        result has, ``fibre_directions.png``, of a stack those of every ply
        (:func:`lcmchain.report.stack_pictures.draw_plies`), of courses ``courses.png``,
        ``sections.png``, ``energy.png``, with tools ``tools.png``, and where their
        forces are known ``force.png`` and, if one of them moves, ``force_over_travel.png``.
    datasets : groups of the result, from :func:`lcmchain.fields.dataset.build_datasets`.
    frame : saved frame to draw, the last one by default.
    tools : of the run; without them there is no ``tools.png``, and sections show the sheet alone.
    planes : of the sections; by default through the middle of the blank along its fibres.

    Returns
    -------
    The files written.

    Raises
    ------
    InputError : the folder cannot be written.
    """
    out_dir = Path(out_dir)
    sheet, history = datasets[SHEET], datasets[HISTORY]
    files = []
    is_stack = bool(ply_names(sheet))
    for shown in STACK_SHOWN if is_stack else SHOWN:
        if shown.name in sheet:
            files.append(out_dir / f"{shown.name}.png")
            draw_field(files[-1], without_films(sheet), shown, frame)
    if course_names(sheet):
        files.append(out_dir / "courses.png")
        draw_courses(files[-1], sheet, frame)
    travel = tool_places(history)[frame]
    if is_stack:
        files += draw_plies(out_dir, datasets, frame)
    else:
        files.append(out_dir / "fibre_directions.png")
        draw_fibre_directions(files[-1], sheet, frame)
    if tools is not None and tools.names:
        files.append(out_dir / "tools.png")
        draw_between_tools(files[-1], sheet, tools, travel, frame)
    files.append(out_dir / "sections.png")
    if is_stack:
        draw_stack_sections(files[-1], datasets, planes, tools, travel, frame)
    else:
        planes = planes or default_planes(sheet)
        draw_sections(files[-1], datasets, planes, tools, travel, frame)
    title = str(sheet.attrs.get("title", ""))
    if any(str(name).startswith("energy_") for name in history.data_vars):
        files.append(out_dir / "energy.png")
        draw_energy(files[-1], history, title)
    if has_forces(history):
        files.append(out_dir / "force.png")
        draw_force(files[-1], history, title)
        if np.ptp(history["tool_travel"].values, axis=0).any():
            files.append(out_dir / "force_over_travel.png")
            draw_force_over_travel(files[-1], history, title)
    return files
