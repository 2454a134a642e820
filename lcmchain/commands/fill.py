"""``lcmchain fill``: resin through the formed part, on its own faces or on another mesh."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from lcmchain.commands.folders import default_out, output_folder
from lcmchain.commands.options import (
    AllowIncomplete,
    LengthUnit,
    MaximumDistance,
    Overrides,
    Quiet,
    Register,
    Results,
    SavedFrame,
    Strict,
)
from lcmchain.commands.terminal import length_of, progress_bar, require_none, say, warn
from lcmchain.errors import InputError

SCENE_SUFFIX = ".toml"


def fill(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="SOURCE",
            help="forming.nc, a mapped file, a scene whose forming is done, or an unformed mesh.",
        ),
    ],
    case: Annotated[
        Path | None,
        typer.Option("--case", metavar="FILE.toml", help="Resin, gates, vents; of a scene: none."),
    ] = None,
    mesh: Annotated[
        Path | None,
        typer.Option("--mesh", metavar="TARGET", help="Mesh to map onto first; default none."),
    ] = None,
    out: Results = None,
    name: Annotated[
        str, typer.Option(metavar="NAME", help="Name of the part and its files.")
    ] = "infiltration",
    overrides: Overrides = None,
    maximum_distance: MaximumDistance = None,
    length_unit: LengthUnit = "m",
    frame: SavedFrame = -1,
    register: Register = False,
    allow_incomplete: AllowIncomplete = False,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on from the checkpoint in DIR.")
    ] = False,
    strict: Strict = False,
    quiet: Quiet = False,
) -> None:
    """Fill the formed part with resin: front, pressure, dry spots."""
    if source.is_dir():
        raise InputError("is a folder; name the forming.nc in it, or a scene", file=source)
    if not source.is_file():
        raise InputError("there is no such file", file=source)
    options = _options(frame, allow_incomplete, resume)
    if source.suffix == SCENE_SUFFIX:
        for option, value in (("--case", case), ("--mesh", mesh)):
            if value is not None:
                raise InputError(
                    "the scene names it; leave the option out, or name its forming.nc instead of "
                    "the scene",
                    key=option,
                )
        reports = _fill_scene(source, out, overrides or (), options, quiet)
    else:
        mapping = _mapping(maximum_distance, length_unit, register)
        reports = _fill_file(
            source, case, mesh, out, name, overrides or (), mapping, options, quiet
        )
    warnings = [
        warning
        for mapped, filled in reports
        for warning in (*(mapped.warnings if mapped is not None else ()), *filled.warnings)
    ]
    for warning in warnings:
        warn(warning)
    require_none(warnings, strict=strict)


#: Reports of the mapping, None without one, and of the filling, for each part.
_Reports = Sequence[tuple[Any, Any]]


def _options(frame: int, allow_incomplete: bool, resume: bool) -> Any:
    from lcmchain.coupling.infiltration.stage import FillOptions

    return FillOptions(frame=frame, allow_incomplete=allow_incomplete, resume=resume)


def _mapping(maximum_distance: str | None, length_unit: str, register: bool) -> Any:
    from lcmchain.mapping import MappingOptions

    distance = (
        None if maximum_distance is None else length_of("--maximum-distance", maximum_distance)
    )
    length_of("--length-unit", f"1 {length_unit}")
    return MappingOptions(
        kind="infiltration", maximum_distance=distance, length_unit=length_unit, register=register
    )


def _fill_file(
    source: Path,
    case: Path | None,
    mesh: Path | None,
    out: Path | None,
    name: str,
    overrides: Sequence[str],
    mapping: Any,
    options: Any,
    quiet: bool,
) -> _Reports:
    """Fill a forming result or a mapped file with the case of a file."""
    from lcmchain.scene import read_infiltration

    if case is None:
        raise InputError(
            "is missing: name the file with resin, gates and vents (lcmchain docs infiltration "
            "shows one)",
            key="--case",
        )
    if mesh is not None and not mesh.is_file():
        raise InputError("there is no such mesh file", file=mesh)
    if not name or Path(name).name != name:
        raise InputError(f'"{name}" is no name for files', key="--name")
    the_case = read_infiltration(case, overrides)
    options = replace(options, directory=case.resolve().parent)
    with output_folder(out or Path("results") / name, inputs=[source, case, mesh]) as folder:
        from lcmchain.coupling.infiltration.stage import map_and_fill

        with progress_bar(quiet=quiet) as progress:
            reports = map_and_fill(
                source, mesh, the_case, name=name, out_dir=folder, mapping=mapping,
                options=options, tell=lambda share, text: progress(share, 1.0, text),
            )  # fmt: skip
    _say(reports, folder, quiet)
    return [reports]


def _fill_scene(
    path: Path, out: Path | None, overrides: Sequence[str], options: Any, quiet: bool
) -> _Reports:
    """Fill as a scene says, from its forming results in the folder."""
    from lcmchain.scene import read_scene

    scene = read_scene(path, overrides)
    if not scene.infiltrations:
        raise InputError(
            "the scene has no infiltration; give [infiltration], or [mapping.infiltration] below "
            "a [[mapping]] entry",
            file=path,
        )
    options = replace(options, directory=scene.source.directory)
    folder = out or default_out(path)
    forming = folder / "forming.nc"
    if not forming.is_file():
        raise InputError(
            f"there is no forming result yet; form it first with: lcmchain run {path}"
            + (f" --out {out}" if out else ""),
            file=forming,
        )
    reports = []
    with output_folder(folder, inputs=[path]):
        from lcmchain.coupling.infiltration.stage import is_mapped_from, map_and_fill
        from lcmchain.mapping import MappingOptions

        for name, (case, target) in scene.infiltrations.items():
            source, mesh, mapping = forming, None, None
            if target is not None:
                mesh = scene.source.directory / target.mesh
                mapping = MappingOptions(**target.options())
                mapped = folder / f"{name}.nc"
                is_there = options.frame == -1 and is_mapped_from(mapped, forming, mesh)
                source = mapped if is_there else forming
            with progress_bar(quiet=quiet) as progress:
                reports.append(
                    map_and_fill(
                        source, mesh, case, name=name, out_dir=folder, mapping=mapping,
                        options=options, tell=lambda share, text: progress(share, 1.0, text),
                    )
                )  # fmt: skip
            _say(reports[-1], folder, quiet)
    return reports


def _say(reports: tuple[Any, Any], folder: Path, quiet: bool) -> None:
    mapped, filled = reports
    if quiet:
        return
    if mapped is not None:
        say(mapped.summary())
    say(filled.summary())
    say(f"Results: {folder / filled.files['netcdf']}")
