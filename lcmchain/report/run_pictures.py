"""All pictures of a run, and its film where the scene asks for one."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib
import numpy as np
from PIL import Image

from lcmchain.atomic import replacing
from lcmchain.errors import InputError
from lcmchain.fields.dataset import HISTORY, SHEET
from lcmchain.fields.saved import tool_places
from lcmchain.fields.sheet import course_names, sheet_faces, sheet_positions
from lcmchain.fields.stack import ply_names, without_films
from lcmchain.fields.stages import last_frames
from lcmchain.fields.summary import has_forces
from lcmchain.materials.law import is_film, tells_fibres
from lcmchain.report.drawn_tools import DepthBuffer, RunTools, draw_tool
from lcmchain.report.pictures import (
    draw_between_tools,
    draw_courses,
    draw_fibre_directions,
    draw_field,
    on_faces,
)
from lcmchain.report.plots import draw_energy, draw_force, draw_force_over_travel
from lcmchain.report.renderer import axes_at, draw_colour_bar, draw_facets, draw_triad
from lcmchain.report.sections import Plane, default_planes, draw_sections
from lcmchain.report.stack_pictures import draw_plies, draw_stack_sections
from lcmchain.report.style import (
    CAPTIONS_OF_STAGE,
    RC,
    SHOWN,
    STACK_SHOWN,
    Shown,
    colour_scale,
    headline,
    new_figure,
    picture_name,
    shades_of,
)
from lcmchain.report.view import boundary_edges, hangs_down, oblique
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
    shown = [material for _, material in sheets if not is_film(material)]  # films are left out
    if field == "shear_angle" and not any(map(tells_fibres, shown)):
        raise InputError(
            'is of fibres, and the sheet has none; use "thickness" or "wrinkle_height"',
            key="output.animation_field",
        )
    without_density = any(material.fibre_density is None for material in shown)
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
        if "shear_angle" in sheet:
            draw_field(paths["shear_angle"], without_films(sheet), SHOWN[0], frame)
        else:  # a film alone has no fibres
            del paths["shear_angle"]
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
    out_dir : folder of the pictures in :data:`lcmchain.report.style.CAPTIONS`: fields that the
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


# --- the film: one view, colours and limits in all frames -----------------------------------------


# Pixels per inch, and seconds: of the whole film, of a frame at least, of the last frame.
DPI = 120
DURATION, LEAST, LAST = 6.0, 0.04, 1.5
WIDTH, HEIGHT = 8.0, 5.6  # even in pixels, as MP4 needs it


def draw_animation(
    path: Path | str,
    sheet: xr.Dataset,
    history: xr.Dataset,
    field: str,
    *,
    tools: RunTools | None = None,
    report: Callable[[int, int], None] | None = None,
) -> None:
    """Draw every saved frame, coloured by a field, into a GIF or MP4 file; whole or not at all.

    Parameters
    ----------
    path : its suffix, .gif or .mp4, chooses the kind.
    field : of the result, a name in :data:`lcmchain.report.style.SHOWN`.
    tools : transparent, where they are in each frame.
    report : called with the frames drawn and all frames.

    Raises
    ------
    InputError : the place cannot be written.
    """
    path = Path(path)
    shown = next(entry for entry in SHOWN if entry.name == field)
    images = _images(sheet, history, shown, tools, report or (lambda done, total: None))
    count = sheet.sizes[sheet[field].dims[0]]
    seconds = max(DURATION / count, LEAST)
    with replacing(path) as temporary:
        write_film(temporary, images, seconds)


def write_film(path: Path, images: Iterator[np.ndarray], seconds: float) -> None:
    """Write pixels (height, width, 3), each shown for so long [s], as GIF or MP4 by the suffix.

    MP4 takes them WIDTH times HEIGHT inches at DPI.
    """
    (_write_gif if path.suffix == ".gif" else _write_mp4)(path, images, seconds)


def _images(sheet, history, shown: Shown, tools, report) -> Iterator[np.ndarray]:
    """Yield the pixels (height, width, 3) of every frame."""
    sheet = without_films(sheet)
    faces = sheet_faces(sheet)
    rim = boundary_edges(faces)
    values = shown.factor * sheet[shown.name].values
    count = len(values)
    positions = np.stack([sheet_positions(sheet, frame) for frame in range(count)])
    view = oblique(from_below=hangs_down(positions[-1], rim))
    used = positions[:, np.unique(faces)]  # none of a film
    low, high = used.min(axis=(0, 1)), used.max(axis=(0, 1))
    size = float((high - low).max())
    box = np.stack([low, high]) + 0.06 * size * np.array([[-1.0], [1.0]])
    corners = np.stack(np.meshgrid(*box.T), axis=-1).reshape(-1, 3)
    shown_part = 1e3 * view.on_screen(corners if tools is not None else used.reshape(-1, 3))
    colours = colour_scale(values, shown)
    times = 1e3 * sheet["time"].values
    title = f"{sheet.attrs.get('title', '')}  ·  t = "
    for frame in range(count):
        with matplotlib.rc_context(RC):
            figure = new_figure(WIDTH, HEIGHT)
            axis = axes_at(figure, 0.1, 0.15, WIDTH - 1.4, HEIGHT - 0.8)
            points = 1e3 * positions[frame]
            on_elements = values[frame]
            if sheet[shown.name].attrs["location"] == "node":
                on_elements = on_faces(on_elements, faces)
            shades = shades_of(colours, on_elements)
            draw_facets(axis, points[faces], view, shades, rim=points[rim], zorder=2.0)
            if tools is not None:
                buffer = DepthBuffer(points[faces], view)
                travel = tool_places(history)[frame]
                edge = 1e3 * size / 60.0
                present = tools.in_frame(history, frame)
                for _, vertices, triangles, colour in present.within(box, travel):
                    surface = 1e3 * vertices, triangles
                    draw_tool(axis, *surface, view, colour, buffer, edge, over_sheet=False)
            _fit(axis, shown_part)
            draw_triad(axis, view)
            bar = axes_at(figure, WIDTH - 1.15, 0.9, 0.16, HEIGHT - 2.2)
            draw_colour_bar(figure, bar, colours, values, shown, extremes=False)
            headline(figure, shown.label, f"{title}{times[frame]:.4g} ms")
            figure.set_dpi(DPI)
            canvas = figure.canvas
            canvas.draw()
        yield np.asarray(canvas.buffer_rgba())[..., :3].copy()  # type: ignore[attr-defined]
        report(frame + 1, count)


def _fit(axis, shown_part: np.ndarray) -> None:
    low, high = shown_part.min(axis=0), shown_part.max(axis=0)
    axis.set_aspect("equal")
    axis.set_xlim(low[0], high[0])
    axis.set_ylim(low[1], high[1])
    axis.set_axis_off()


def _write_gif(path: Path, images: Iterator[np.ndarray], seconds: float) -> None:
    frames = [Image.fromarray(pixels) for pixels in images]
    # One palette for the film: a colour is the same value in every frame. The last frame, with the
    # first one beside it, has all colours.
    both = np.concatenate([np.asarray(frames[-1]), np.asarray(frames[0])])
    palette = Image.fromarray(both).quantize(256, Image.Quantize.MAXCOVERAGE)
    drawn = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    durations = [round(1e3 * seconds)] * (len(drawn) - 1) + [round(1e3 * LAST)]
    drawn[0].save(
        path, format="GIF", save_all=True, append_images=drawn[1:], duration=durations, loop=0
    )


def _write_mp4(path: Path, images: Iterator[np.ndarray], seconds: float) -> None:
    from imageio_ffmpeg import write_frames

    rate = 1.0 / seconds
    size = round(WIDTH * DPI), round(HEIGHT * DPI)
    writer = write_frames(
        str(path), size, fps=rate, codec="libx264", quality=8, macro_block_size=2,
        output_params=["-f", "mp4", "-movflags", "+faststart"], ffmpeg_log_level="error",
    )  # fmt: skip
    writer.send(None)
    try:
        for pixels in images:
            writer.send(np.ascontiguousarray(pixels))
        for _ in range(round(LAST * rate)):  # the last frame stays for a while
            writer.send(np.ascontiguousarray(pixels))
    finally:
        writer.close()
