"""``lcmchain map``: the formed blank's fields on another mesh."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from lcmchain.commands.folders import output_folder
from lcmchain.commands.options import (
    AllowAmbiguous,
    AllowIncomplete,
    LengthUnit,
    MaximumDistance,
    Method,
    Register,
    SavedFrame,
    ThicknessLimit,
)
from lcmchain.commands.terminal import console, length_of, require_choice, say, time_of, warn
from lcmchain.errors import InputError


def map_fields(
    source: Annotated[Path, typer.Argument(metavar="SOURCE.nc", help="forming.nc of a run.")],
    target: Annotated[
        Path, typer.Argument(metavar="TARGET", help="Solver deck, or any other mesh file.")
    ],
    out: Annotated[
        Path, typer.Option("--out", metavar="F", help="F.nc or F.vtu; the other is written too.")
    ],
    kind: Annotated[
        str, typer.Option(help="What the mesh is for: infiltration or structure.")
    ] = "structure",
    method: Method = "overlap",
    order: Annotated[
        int, typer.Option(min=1, max=2, help="Fields within a face: 1 constant, 2 linear.")
    ] = 2,
    maximum_distance: MaximumDistance = None,
    length_unit: LengthUnit = "m",
    frame: SavedFrame = -1,
    time: Annotated[
        str | None,
        typer.Option(metavar="TIME", help='Saved state to map by its time, such as "120 ms".'),
    ] = None,
    all_frames: Annotated[
        bool,
        typer.Option("--all-frames", help="Also map every other state, on the moving mesh."),
    ] = False,
    register: Register = False,
    nodes: Annotated[
        bool, typer.Option("--nodes", help="Write values at the nodes of the mesh too.")
    ] = False,
    verify: Annotated[
        bool,
        typer.Option("--verify", help="Estimate the error that the mapping adds to every field."),
    ] = False,
    thickness_limit: ThicknessLimit = 0.1,
    exports: Annotated[
        list[str] | None,
        typer.Option(
            "--export",
            metavar="FORMAT",
            help="Write for another program too: vmap, drape, rtmsim, lcmsim or openradioss; "
            "repeatable.",
        ),
    ] = None,
    allow_unmapped: Annotated[
        bool, typer.Option("--allow-unmapped", help="Accept cells with no sheet nearby.")
    ] = False,
    allow_ambiguous: AllowAmbiguous = False,
    allow_incomplete: AllowIncomplete = False,
) -> None:
    """Map the formed blank's fields onto another mesh."""
    from lcmchain.scene import MappingTarget

    require_choice("--kind", kind, MappingTarget)
    require_choice("--method", method, MappingTarget)
    _require_files(source, target, out)
    distance = (
        None if maximum_distance is None else length_of("--maximum-distance", maximum_distance)
    )
    length_of("--length-unit", f"1 {length_unit}")
    with output_folder(out.parent, inputs=[source, target]):
        from lcmchain.mapping import MappingOptions, map_file

        options = MappingOptions(
            kind=kind,
            method=method,
            order=order,
            maximum_distance=distance,
            length_unit=length_unit,
            frame=frame,
            time=None if time is None else time_of("--time", time),
            all_frames=all_frames,
            register=register,
            nodes=nodes,
            verify=verify,
            thickness_limit=thickness_limit,
            allow_unmapped=allow_unmapped,
            allow_ambiguous=allow_ambiguous,
            allow_incomplete=allow_incomplete,
            exports=tuple(dict.fromkeys(exports or ())),
        )
        report = map_file(source, target, out, options)
    say(report.summary())
    if report.verification is not None:
        from lcmchain.report.chapters import error_table

        console().print(error_table(report.verification))
    for warning in report.warnings:
        warn(warning)


def _require_files(source: Path, target: Path, out: Path) -> None:
    """Refuse inputs that are no files and an output that is a folder."""
    for file, what in ((source, "the forming.nc"), (target, "the mesh")):
        if file.is_dir():
            raise InputError(f"is a folder; name {what} in it", file=file)
        if not file.is_file():
            raise InputError("there is no such file", file=file)
    if out.is_dir():
        raise InputError("is a folder; name a file in it, such as mapped.nc", file=out)
