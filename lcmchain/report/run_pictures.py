"""All pictures of a run, and its film where the scene asks for one."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lcmchain.errors import InputError
from lcmchain.fields.dataset import HISTORY, SHEET
from lcmchain.fields.history_group import tool_places
from lcmchain.fields.sheet import sheet_positions
from lcmchain.fields.stack import ply_names
from lcmchain.report.animation import draw_animation
from lcmchain.report.captions import CAPTIONS_OF_STAGE
from lcmchain.report.cut import Plane
from lcmchain.report.formed import draw_between_tools
from lcmchain.report.pictures import draw_field, draw_result
from lcmchain.report.run_tools import RunTools
from lcmchain.report.sections import default_planes, draw_sections
from lcmchain.report.shown import SHOWN
from lcmchain.report.stack_pictures import draw_stack_sections
from lcmchain.report.stages import last_frames, picture_name
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
