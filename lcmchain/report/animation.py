"""A film of the forming: the same view, colours and limits in every saved frame."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib
import numpy as np

from lcmchain.atomic import replacing
from lcmchain.fields.saved import tool_places
from lcmchain.fields.sheet import sheet_faces, sheet_positions
from lcmchain.report.drawn_tools import DepthBuffer, RunTools, draw_tool
from lcmchain.report.pictures import on_faces
from lcmchain.report.renderer import axes_at, draw_colour_bar, draw_facets, draw_triad
from lcmchain.report.shown import SHOWN, Shown, colour_scale
from lcmchain.report.style import RC, headline, new_figure
from lcmchain.report.view import boundary_edges, hangs_down, oblique

if TYPE_CHECKING:
    import xarray as xr

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
    field : of the result, a name in :data:`lcmchain.report.shown.SHOWN`.
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
    faces = sheet_faces(sheet)
    rim = boundary_edges(faces)
    values = shown.factor * sheet[shown.name].values
    count = len(values)
    positions = np.stack([sheet_positions(sheet, frame) for frame in range(count)])
    view = oblique(from_below=hangs_down(positions[-1], rim))
    low, high = positions.min(axis=(0, 1)), positions.max(axis=(0, 1))
    size = float((high - low).max())
    box = np.stack([low, high]) + 0.06 * size * np.array([[-1.0], [1.0]])
    corners = np.stack(np.meshgrid(*box.T), axis=-1).reshape(-1, 3)
    shown_part = 1e3 * view.on_screen(corners if tools is not None else positions.reshape(-1, 3))
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
            draw_facets(
                axis, points[faces], view, colours.to_rgba(on_elements), rim=points[rim], zorder=2.0
            )
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
    from PIL import Image

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
