"""``lcmchain pattern``: lines on a formed sheet, trimming line, flat pattern of a net shape."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lcmchain.commands.options import Overrides, SavedFrame, SceneFile, output_folder
from lcmchain.commands.terminal import length_of, progress_bar, say, warn
from lcmchain.errors import InputError
from lcmchain.quantities.units import length_factor

if TYPE_CHECKING:
    import numpy as np
    import xarray as xr

    from lcmchain.pattern.flat import Round

pattern_app = typer.Typer(
    no_args_is_help=True,
    help="Lines on a formed sheet as tables, its trimming line, and the flat pattern of a net.",
)

Source = Annotated[Path, typer.Argument(metavar="SOURCE.nc", help="forming.nc of a run.")]
Ply = Annotated[
    str | None, typer.Option("--ply", metavar="NAME", help="Ply of a stack; needed where several.")
]
Net = Annotated[
    Path,
    typer.Option(
        "--net",
        metavar="FILE",
        help="Wanted rim in plan, seen along z: CSV with x, y under a heading, or DXF.",
    ),
]
NetUnit = Annotated[
    str | None,
    typer.Option(
        "--length-unit", help="Unit of the net; by default that of its drawing or heading, else m."
    ),
]


@pattern_app.command("section")
def section(
    source: Source,
    out: Annotated[Path, typer.Option("--out", "-o", metavar="F.csv", help="Table to write.")],
    point: Annotated[
        str, typer.Option("--point", metavar="POINT", help="Point of the plane.")
    ] = "0 0 0 mm",
    normal: Annotated[
        str, typer.Option("--normal", metavar="VECTOR", help="Normal of the plane.")
    ] = "0 1 0",
    ply: Ply = None,
    frame: SavedFrame = -1,
) -> None:
    """Write thickness, shear and fibre volume fraction along a section of a formed sheet."""
    from lcmchain.pattern.tables import section_table, write_table

    where, across = _vector("--point", point, "mm"), _vector("--normal", normal, None)
    sheet = _sheet(source, ply, frame)
    with output_folder(out.parent, inputs=[source]):
        table = section_table(sheet, where, across, frame)
        write_table(out, table)
    say(f"{len(table['element'])} elements along the section: {out}")


@pattern_app.command("draw-in")
def draw_in(
    source: Source,
    out: Annotated[Path, typer.Option("--out", "-o", metavar="F.csv", help="Table to write.")],
    ply: Ply = None,
    frame: SavedFrame = -1,
) -> None:
    """Write how far the rim of a formed sheet has been drawn in, node by node."""
    from lcmchain.pattern.tables import rim_table, write_table

    sheet = _sheet(source, ply, frame)
    with output_folder(out.parent, inputs=[source]):
        table = rim_table(sheet, frame)
        write_table(out, table)
    largest = 1e3 * float(table["draw-in [m]"].max())
    say(f"Drawn in by up to {largest:.4g} mm along the rim: {out}")


@pattern_app.command("trim")
def trim(
    source: Source,
    net: Net,
    out: Annotated[
        Path,
        typer.Option("--out", "-o", metavar="FILE", help="Line on the flat blank: .csv or .dxf."),
    ],
    length_unit: NetUnit = None,
    ply: Ply = None,
    frame: SavedFrame = -1,
) -> None:
    """Map a net line on the formed part back to the flat blank: where to trim."""
    from lcmchain.pattern.flat import trimming_line
    from lcmchain.pattern.formed import FormedSheet
    from lcmchain.pattern.tables import read_line, write_line

    if length_unit is not None:
        length_of("--length-unit", f"1 {length_unit}")
    line = read_line(net, length_unit)
    sheet = FormedSheet.of_result(_sheet(source, ply, frame), frame)
    with output_folder(out.parent, inputs=[source, net]):
        flat = trimming_line(sheet, line, key="--net")
        write_line(out, flat)
    say(f"Trimming line of {len(flat)} points on the flat blank: {out}")


@pattern_app.command("flat")
def flat(
    scene: SceneFile,
    net: Net,
    out: Annotated[
        Path, typer.Option("--out", "-o", metavar="DIR", help="Folder of the pattern and runs.")
    ],
    length_unit: NetUnit = None,
    ply: Ply = None,
    tolerance: Annotated[
        str | None,
        typer.Option(metavar="LENGTH", help="Largest miss of the rim; a quarter of an edge."),
    ] = None,
    rounds: Annotated[int, typer.Option(min=1, metavar="N", help="Formings at most.")] = 6,
    overrides: Overrides = None,
) -> None:
    """Find the flat outline whose formed rim is the net: form, correct, and form again."""
    from lcmchain.pattern.flat import SceneForming, flat_pattern
    from lcmchain.pattern.tables import read_line, write_line
    from lcmchain.scene import read_scene

    if length_unit is not None:
        length_of("--length-unit", f"1 {length_unit}")
    limit = None if tolerance is None else length_of("--tolerance", tolerance)
    the_scene = read_scene(scene, overrides or ())
    line = read_line(net, length_unit)
    with output_folder(out, inputs=[scene, net]) as folder, progress_bar() as report:
        forming = SceneForming(the_scene, folder, ply, report)
        found = flat_pattern(line, forming, tolerance=limit, most_rounds=rounds, key="--net")
        write_line(folder / "pattern.csv", found[-1].outline)
        write_line(folder / "pattern.dxf", found[-1].outline)
    _tell(found, forming.edge_length, limit, folder)


def _tell(found: list[Round], edge_length: float, limit: float | None, folder: Path) -> None:
    for number, one in enumerate(found, start=1):
        say(f"Round {number}: the formed rim misses the net by up to {1e3 * one.miss:.3g} mm")
    limit = 0.25 * edge_length if limit is None else limit
    if found[-1].miss > limit:
        warn(
            f"the rim misses the net by more than {1e3 * limit:.3g} mm after {len(found)} rounds; "
            "use shorter elements, or see whether wrinkles or an unsteady process move the rim"
        )
    say(f"Flat pattern: {folder / 'pattern.csv'} and pattern.dxf")


def _sheet(source: Path, ply: str | None, frame: int) -> xr.Dataset:
    """Open the sheet of a result, or one of its plies, and see that it has a saved frame.

    Raises
    ------
    InputError : no such file, ply or frame; names the option.
    """
    sheet = _whole_sheet_or_ply(source, ply)
    count = sheet.sizes.get("time", 0)
    if not -count <= frame < count:
        raise InputError(
            f"is {frame}, but the frames go from 0 to {count - 1}, or backwards from -1",
            key="--frame",
            file=source,
        )
    return sheet


def _whole_sheet_or_ply(source: Path, ply: str | None) -> xr.Dataset:
    from lcmchain.fields.netcdf_file import read_forming, read_group
    from lcmchain.fields.stack import ply_names, ply_sheet

    if source.is_dir():
        raise InputError("is a folder; name the forming.nc in it", file=source)
    if not source.is_file():
        raise InputError("there is no such file", file=source)
    sheet = read_forming(source)
    plies = ply_names(sheet) if "body" in sheet else ()
    if ply is not None and ply not in plies:
        raise InputError(
            f'"{ply}" is no ply of it; it has {", ".join(plies) or "one sheet"}',
            key="--ply",
            file=source,
        )
    if ply is not None:
        return ply_sheet({f"/{ply}": read_group(source, ply)}, ply)
    if plies:
        raise InputError(
            f"holds several plies; name one of them: {', '.join(plies)}", key="--ply", file=source
        )
    return sheet


def _vector(option: str, text: str, unit: str | None) -> np.ndarray:
    """Read three numbers, with a unit of length at their end where ``unit`` names one."""
    import numpy as np

    words = text.replace(",", " ").split()
    factor = 1.0
    if unit is not None and len(words) == 4:
        length_of(option, f"1 {words[-1]}")
        factor = length_factor(words.pop())
    elif unit is not None:
        raise InputError(f'needs three numbers and a unit, such as "0 10 0 {unit}"', key=option)
    try:
        values = factor * np.array([float(word) for word in words])
    except ValueError:
        values = np.empty(0)
    if len(values) != 3 or not np.isfinite(values).all() or (unit is None and not values.any()):
        raise InputError(f'needs three numbers, but is "{text}"', key=option)
    return values
