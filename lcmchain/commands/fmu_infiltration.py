"""``lcmchain fmu build --part infiltration``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from lcmchain.commands.folders import default_out, output_folder
from lcmchain.commands.terminal import length_of
from lcmchain.errors import InputError

Interface = Annotated[
    str,
    typer.Option(
        "--interface",
        metavar="N|F.fmu",
        help="Exchange fields per patch of elements, so many of them, 0: per element; or, for an "
        "infiltration, at the interface of that forming unit.",
    ),
]
Source = Annotated[
    Path | None,
    typer.Option(
        "--source",
        metavar="SOURCE.nc",
        help="Infiltration: forming.nc of a run, a mapped file, or of a case with preform its "
        "unformed mesh; default that of the scene's run, or the blank where it is filled while "
        "it is formed.",
    ),
]
SourceUnit = Annotated[
    str,
    typer.Option("--length-unit", metavar="UNIT", help="Infiltration: unit of an unformed mesh."),
]
Motion = Annotated[
    str,
    typer.Option(
        "--motion",
        metavar="MOTION",
        help="Infiltration: how the master moves the preform: none, thickness, volume.",
    ),
]
EntryName = Annotated[
    str | None,
    typer.Option(
        "--name", metavar="NAME", help="Infiltration: of the scene's entry, and of the result file."
    ),
]
NeedsTool = Annotated[
    bool,
    typer.Option(
        "--execution-tool/--no-execution-tool",
        help="Whether the unit says that it needs a tool that is installed (needsExecutionTool): "
        "lcmchain in a Python. Some masters refuse units that say so, PyFMI for example.",
    ),
]


def interface_of(text: str, part: str) -> int | Path:
    """Return the number of patches, or the unit whose interface is taken."""
    if text.isdecimal():
        return int(text)
    if part == "forming" or not text.endswith(".fmu"):
        raise InputError(f'"{text}" is no number of patches, 0 for the elements', key="--interface")
    return Path(text)


def build_infiltration(
    case: Path,
    out: Path,
    source: Path | None,
    *,
    fmi: int,
    fields: Sequence[str] | None,
    interface: int | Path,
    motion: str,
    name: str | None,
    needs_tool: bool,
    length_unit: str,
    overrides: Sequence[str],
) -> None:
    """Build a unit that fills a formed part as a scene or a case says."""
    length_of("--length-unit", f"1 {length_unit}")
    if source is None and not _flows_while_formed(case, overrides):
        source = default_out(case) / "forming.nc"
    if source is not None and not source.is_file():
        raise InputError(
            f"there is no forming result; form it first with: lcmchain run {case}, or name a "
            "forming.nc, a mapped file or, of a case with preform, its mesh with --source",
            file=source,
        )
    if out.suffix != ".fmu":
        raise InputError("the name of a functional mock-up unit ends in .fmu", file=out)
    with output_folder(out.parent, inputs=[case] if source is None else [case, source]):
        from lcmchain.fmu.infiltration.build import InfiltrationUnit, build_infiltration_fmu

        options = InfiltrationUnit(
            motion=motion,  # type: ignore[arg-type]  # checked there
            interface=interface, fields=fields, name=name, needs_tool=needs_tool,
            length_unit=length_unit,
        )  # fmt: skip
        build_infiltration_fmu(source, case, out, fmi=fmi, overrides=overrides, options=options)


def _flows_while_formed(case: Path, overrides: Sequence[str]) -> bool:
    """Whether a file is a scene whose infiltration goes on while the blank is formed."""
    from lcmchain.scene import read_scene
    from lcmchain.scene.reading.single_tables import is_scene_file

    return is_scene_file(case) and read_scene(case, overrides).wet_forming is not None
