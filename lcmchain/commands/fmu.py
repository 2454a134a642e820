"""``lcmchain fmu``: units of a scene, and what a unit needs on a machine."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from lcmchain.commands.options import Overrides, SceneFile, default_out, output_folder
from lcmchain.commands.terminal import console, length_of, say
from lcmchain.errors import InputError

fmu_app = typer.Typer(no_args_is_help=True, help="Package a scene as a functional mock-up unit.")


@fmu_app.callback()
def _fmu() -> None:
    """Package a scene as a functional mock-up unit."""


@fmu_app.command()
def doctor(
    unit: Annotated[
        Path, typer.Argument(metavar="F.fmu", help="A unit, by lcmchain or another tool.")
    ],
    python: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Python that is to run it; default: this one."),
    ] = None,
    host: Annotated[
        str | None, typer.Option(metavar="PROGRAM", help="Program that is to import it.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Tell what a unit needs on this machine and what is missing (exit code 1); it is not run."""
    from lcmchain.fmu.doctor import Level, examine

    diagnosis = examine(unit, python=python, host=host)
    if as_json:
        sys.stdout.write(json.dumps(diagnosis.as_dict(), indent=2) + "\n")
    else:
        terminal = console()
        styles = {Level.OK: "green", Level.NOTE: "", Level.WARNING: "yellow", Level.MISSING: "red"}
        for finding in diagnosis.findings:
            line = f"{finding.level:<8}{finding.subject}: {finding.text}"
            if finding.remedy:
                line += f"\n{'':8}-> {finding.remedy}"
            terminal.print(
                line, style=styles[finding.level], markup=False, highlight=False, soft_wrap=True
            )
        missing = sum(finding.level is Level.MISSING for finding in diagnosis.findings)
        say(f"{unit}: {'can run here' if not missing else f'cannot run here, {missing} missing'}")
    if not diagnosis.runs:
        raise typer.Exit(1)


# --- build ----------------------------------------------------------------------------------------


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


@fmu_app.command("build")
def fmu_build(
    scene: SceneFile,
    out: Annotated[Path, typer.Option("--out", "-o", metavar="F.fmu", help="The unit to write.")],
    fmi: Annotated[
        int, typer.Option("--fmi", metavar="2|3", help="Version of the standard: 2.0 or 3.0.")
    ] = 2,
    part: Annotated[
        str,
        typer.Option("--part", metavar="PART", help="What it computes: forming or infiltration."),
    ] = "forming",
    fields: Annotated[
        str | None,
        typer.Option(
            "--fields",
            metavar="NAMES",
            help="Fields of forming, with commas between, or all; default all in FMI 3.0, "
            "thickness and fibre_volume_fraction in 2.0, where each entry is a variable.",
        ),
    ] = None,
    pore_pressure: Annotated[
        bool,
        typer.Option(
            "--pore-pressure",
            help="Take the pressure of a fluid in the pores, and give what it exchanges.",
        ),
    ] = False,
    interface: Interface = "0",
    source: Source = None,
    length_unit: SourceUnit = "m",
    motion: Motion = "thickness",
    name: EntryName = None,
    needs_tool: NeedsTool = True,
    overrides: Overrides = None,
) -> None:
    """Build a co-simulation unit that forms the scene, or fills the part that it has formed."""
    names = fields and fields.split(",")
    if part == "infiltration":
        _build_infiltration(
            scene, out, source, fmi=fmi, fields=names,
            interface=_interface_of(interface, part), motion=motion,
            name=name, needs_tool=needs_tool, length_unit=length_unit, overrides=overrides or (),
        )  # fmt: skip
        say(f"Wrote {out}")
        return
    from lcmchain.scene import read_scene

    read_scene(scene, overrides or ())  # wrong input is told before anything is built
    if out.suffix != ".fmu":
        raise InputError("the name of a functional mock-up unit ends in .fmu", file=out)
    with output_folder(out.parent, inputs=[scene]):
        from lcmchain.fmu.build import build_fmu

        options: dict[str, Any] = {}
        if part == "forming":
            patches = _interface_of(interface, part)
            options = {"fields": names, "pore_pressure": pore_pressure, "interface": patches}
        build_fmu(
            scene, out, fmi=fmi, part=part, overrides=overrides or (), needs_tool=needs_tool,
            **options,
        )  # fmt: skip
    say(f"Wrote {out}")


def _interface_of(text: str, part: str) -> int | Path:
    """Return the number of patches, or the unit whose interface is taken."""
    if text.isdecimal():
        return int(text)
    if part == "forming" or not text.endswith(".fmu"):
        raise InputError(f'"{text}" is no number of patches, 0 for the elements', key="--interface")
    return Path(text)


def _build_infiltration(
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
