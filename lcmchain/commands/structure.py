"""``lcmchain structure``: deck of CalculiX from a forming result, its run and results."""

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
    Overrides,
    Register,
    Results,
    SavedFrame,
    ThicknessLimit,
)
from lcmchain.commands.terminal import length_of, require_choice, say, warn
from lcmchain.errors import InputError


def structure(
    source: Annotated[
        Path, typer.Argument(metavar="SOURCE.nc", help="forming.nc of a run, or a mapped file.")
    ],
    target: Annotated[
        Path, typer.Argument(metavar="TARGET", help="Mesh of the part: shells or solids.")
    ],
    case: Annotated[
        Path,
        typer.Option("--case", metavar="FILE.toml", help="Composite, supports, loads."),
    ],
    out: Results = None,
    name: Annotated[
        str, typer.Option(metavar="NAME", help="Name of the part and its files.")
    ] = "structure",
    overrides: Overrides = None,
    method: Method = "overlap",
    maximum_distance: MaximumDistance = None,
    length_unit: LengthUnit = "m",
    frame: SavedFrame = -1,
    register: Register = False,
    thickness_limit: ThicknessLimit = 0.1,
    allow_ambiguous: AllowAmbiguous = False,
    allow_incomplete: AllowIncomplete = False,
    solve: Annotated[
        bool, typer.Option("--solve/--no-solve", help="Run CalculiX, or write the deck alone.")
    ] = True,
    ccx: Annotated[
        str, typer.Option("--ccx", metavar="COMMAND", help="Name or path of CalculiX.")
    ] = "ccx",
    threads: Annotated[
        int | None,
        typer.Option("--threads", min=1, metavar="N", help="Number of threads of CalculiX."),
    ] = None,
) -> None:
    """Write the CalculiX deck of a formed part, and solve it where CalculiX is installed."""
    from lcmchain.scene import MappingTarget, read_structure

    require_choice("--method", method, MappingTarget)
    for file, what in ((source, "the forming.nc"), (target, "the mesh")):
        if file.is_dir():
            raise InputError(f"is a folder; name {what} in it", file=file)
        if not file.is_file():
            raise InputError("there is no such file", file=file)
    if not name or Path(name).name != name:
        raise InputError(f'"{name}" is no name for files', key="--name")
    the_case = read_structure(case, overrides or ())
    distance = (
        None if maximum_distance is None else length_of("--maximum-distance", maximum_distance)
    )
    length_of("--length-unit", f"1 {length_unit}")
    with output_folder(out or Path("results") / name, inputs=[source, target, case]) as folder:
        from lcmchain.mapping import MappingOptions
        from lcmchain.mapping.structure import SolverOptions, map_and_analyse

        mapping, report = map_and_analyse(
            source,
            target,
            the_case,
            name=name,
            out_dir=folder,
            mapping=MappingOptions(
                method=method,
                maximum_distance=distance,
                length_unit=length_unit,
                frame=frame,
                register=register,
                thickness_limit=thickness_limit,
                allow_ambiguous=allow_ambiguous,
                allow_incomplete=allow_incomplete,
            ),
            options=SolverOptions(run=solve, command=ccx, threads=threads),
        )
    if mapping is not None:
        say(mapping.summary())
    say(report.summary())
    say(f"Deck: {folder / report.files['deck']}")
    for warning in [*(mapping.warnings if mapping is not None else ()), *report.warnings]:
        warn(warning)
