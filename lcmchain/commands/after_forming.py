"""What follows forming: its fields on another mesh (``map``), ``structure`` and ``fill``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Protocol

import typer

from lcmchain.commands.options import (
    AllowAmbiguous,
    AllowIncomplete,
    LengthUnit,
    MaximumDistance,
    Method,
    Overrides,
    Quiet,
    Register,
    Results,
    SavedFrame,
    SavedTime,
    Strict,
    ThicknessLimit,
    default_out,
    output_folder,
)
from lcmchain.commands.terminal import (
    console,
    length_of,
    progress_bar,
    require_choice,
    require_none,
    say,
    time_of,
    warn,
)
from lcmchain.errors import InputError

if TYPE_CHECKING:
    from lcmchain.coupling.infiltration.stage import FillOptions
    from lcmchain.mapping import MappingOptions


class MappingReport(Protocol):
    """What a mapping tells; the chain itself is imported when a command runs."""

    @property
    def warnings(self) -> Sequence[str]: ...
    def summary(self) -> str: ...


class FillingReport(MappingReport, Protocol):
    """What a filling tells."""

    @property
    def files(self) -> Mapping[str, str]: ...


# --- map: fields of the formed blank on another mesh ----------------------------------------------


def map_fields(
    source: Annotated[Path, typer.Argument(metavar="SOURCE.nc", help="forming.nc of a run.")],
    target: Annotated[
        Path, typer.Argument(metavar="TARGET", help="Solver deck, or any other mesh file.")
    ],
    out: Annotated[
        Path,
        typer.Option("--out", "-o", metavar="F", help="F.nc or F.vtu; the other is written too."),
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
    time: SavedTime = None,
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
    _require_inputs(source, target)
    if out.is_dir():
        raise InputError("is a folder; name a file in it, such as mapped.nc", file=out)
    distance = _distance(maximum_distance)
    _require_unit(length_unit)
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


def _require_inputs(source: Path, target: Path) -> None:
    """Refuse a forming result and a mesh that are no files."""
    for file, what in ((source, "the forming.nc"), (target, "the mesh")):
        if file.is_dir():
            raise InputError(f"is a folder; name {what} in it", file=file)
        if not file.is_file():
            raise InputError("there is no such file", file=file)


def _distance(text: str | None) -> float | None:
    """Return the farthest distance of a mapping [m], None for its default."""
    return None if text is None else length_of("--maximum-distance", text)


def _require_unit(length_unit: str) -> None:
    length_of("--length-unit", f"1 {length_unit}")


def _require_file_name(name: str) -> None:
    if not name or Path(name).name != name:
        raise InputError(f'"{name}" is no name for files', key="--name")


# --- structure: deck of CalculiX from a forming result, its run and results -----------------------


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
    time: SavedTime = None,
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
    _require_inputs(source, target)
    _require_file_name(name)
    the_case = read_structure(case, overrides or ())
    distance = _distance(maximum_distance)
    _require_unit(length_unit)
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
                time=None if time is None else time_of("--time", time),
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


# --- fill: resin through the formed part, on its own faces or on another mesh ---------------------


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
    time: SavedTime = None,
    register: Register = False,
    allow_incomplete: AllowIncomplete = False,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on from the checkpoint in DIR.")
    ] = False,
    strict: Strict = False,
    quiet: Quiet = False,
) -> None:
    """Fill the formed part with resin: front, pressure, dry spots."""
    from lcmchain.scene.reading.read import is_pipe

    if source.is_dir():
        raise InputError("is a folder; name the forming.nc in it, or a scene", file=source)
    if not source.is_file() and not is_pipe(source):
        raise InputError("there is no such file", file=source)
    options = _options(frame, allow_incomplete, resume)
    at = None if time is None else time_of("--time", time)
    if at is not None and frame != -1:
        raise InputError(
            f"names a saved state, and --frame {frame} another; leave one out", key="--time"
        )
    if source.suffix == SCENE_SUFFIX or is_pipe(source):
        for option, value in (("--case", case), ("--mesh", mesh)):
            if value is not None:
                raise InputError(
                    "the scene names it; leave the option out, or name its forming.nc instead of "
                    "the scene",
                    key=option,
                )
        reports = _fill_scene(source, out, overrides or (), options, quiet, at=at)
    else:
        mapping = _mapping(maximum_distance, length_unit, register)
        reports = _fill_file(
            source, case, mesh, out, name, overrides or (), mapping, options, quiet, at=at
        )
    warnings = [
        warning
        for mapped, filled in reports
        for warning in (*(mapped.warnings if mapped is not None else ()), *filled.warnings)
    ]
    for warning in warnings:
        warn(warning)
    require_none(warnings, strict=strict)


def _options(frame: int, allow_incomplete: bool, resume: bool) -> FillOptions:
    from lcmchain.coupling.infiltration.stage import FillOptions

    return FillOptions(frame=frame, allow_incomplete=allow_incomplete, resume=resume)


def _at_time(options: FillOptions, source: Path, time: float | None) -> FillOptions:
    """Return the options with the saved state of a forming result that is nearest to a time [s]."""
    if time is None:
        return options
    from lcmchain.mapping.sheet import frame_at
    from lcmchain.mapping.structure.stage import is_mapped, open_mapped

    if is_mapped(open_mapped(source)):
        raise InputError(
            f"names a saved state, but {source.name} holds one; choose the time when it is mapped, "
            "or start from the forming result",
            key="--time",
        )
    return replace(options, frame=frame_at(source, time))


def _mapping(maximum_distance: str | None, length_unit: str, register: bool) -> MappingOptions:
    from lcmchain.mapping import MappingOptions

    distance = _distance(maximum_distance)
    _require_unit(length_unit)
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
    mapping: MappingOptions,
    options: FillOptions,
    quiet: bool,
    *,
    at: float | None = None,
) -> Sequence[tuple[MappingReport | None, FillingReport]]:
    """Fill a forming result or a mapped file with the case of a file."""
    from lcmchain.scene import read_infiltration
    from lcmchain.scene.reading.read import directory_of

    if case is None:
        raise InputError(
            "is missing: name the file with resin, gates and vents (lcmchain docs infiltration "
            "shows one)",
            key="--case",
        )
    if mesh is not None and not mesh.is_file():
        raise InputError("there is no such mesh file", file=mesh)
    _require_file_name(name)
    the_case = read_infiltration(case, overrides)
    options = replace(options, directory=directory_of(case))
    if the_case.preform is not None and (at is not None or options.frame != -1):
        raise InputError(
            "chooses a saved state of forming, and a mesh with a preform has none; leave it out",
            key="--frame" if at is None else "--time",
        )
    options = _at_time(options, source, at)
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
    path: Path,
    out: Path | None,
    overrides: Sequence[str],
    options: FillOptions,
    quiet: bool,
    *,
    at: float | None = None,
) -> Sequence[tuple[MappingReport | None, FillingReport]]:
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
    options = _at_time(options, forming, at)
    reports = []
    with output_folder(folder, inputs=[path]):
        from lcmchain.coupling.infiltration.stage import (
            checkpoint_file,
            is_mapped_from,
            map_and_fill,
        )
        from lcmchain.mapping import MappingOptions

        # a filling that was done before the interruption has no checkpoint: it is done again
        stopped = {n for n in scene.infiltrations if checkpoint_file(folder, n).is_file()}
        if options.resume and not stopped:
            raise InputError(
                "there is no checkpoint to go on from; fill without --resume", file=folder
            )
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
                        options=replace(options, resume=options.resume and name in stopped),
                        tell=lambda share, text: progress(share, 1.0, text),
                    )
                )  # fmt: skip
            _say(reports[-1], folder, quiet)
    return reports


def _say(reports: tuple[MappingReport | None, FillingReport], folder: Path, quiet: bool) -> None:
    mapped, filled = reports
    if quiet:
        return
    if mapped is not None:
        say(mapped.summary())
    say(filled.summary())
    say(f"Results: {folder / filled.files['netcdf']}")
