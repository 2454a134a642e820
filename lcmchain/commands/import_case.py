"""``lcmchain import``: cases of other programs as data, written as a case of this one."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from lcmchain.commands.folders import output_folder
from lcmchain.commands.terminal import quantity, say, warn
from lcmchain.errors import InputError

import_app = typer.Typer(no_args_is_help=True, help="Take over a filling case of RTMsim or LCMsim.")

PortsFile = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE.csv",
        help="Ports that were picked with the mouse: a radius, then x,y,z in each line, in metres; "
        "of LCMsim default _pset.csv beside the mesh.",
    ),
]
CaseFile = Annotated[Path, typer.Option("--out", metavar="FILE.toml", help="Case that is written.")]


@import_app.command("rtmsim")
def import_rtmsim(
    source: Annotated[
        Path, typer.Argument(metavar="INPUT.txt", help="Input file of RTMsim, or of LCMsim 1.")
    ],
    mesh: Annotated[
        Path | None, typer.Option(metavar="MESH", help="Mesh; default the one that it names.")
    ] = None,
    ports: PortsFile = None,
    out: CaseFile = Path("case.toml"),
) -> None:
    """Input file of RTMsim: mesh, preform and sets, inlets, pressures, viscosity."""
    from lcmchain.coupling.infiltration.foreign_case import read_rtmsim

    _require_file(source)
    _write(read_rtmsim(source, mesh, ports), out, [source, mesh, ports])


@import_app.command("lcmsim")
def import_lcmsim(
    parts: Annotated[
        Path, typer.Argument(metavar="PARTS.csv", help="Part description of LCMsim 2 or 3.")
    ],
    parameters: Annotated[Path, typer.Option(metavar="FILE.csv", help="Simulation parameters.")],
    mesh: Annotated[Path, typer.Option(metavar="MESH", help="Mesh with these parts.")],
    time: Annotated[str, typer.Option(metavar="TIME", help="At which the filling ends.")],
    ports: PortsFile = None,
    out: CaseFile = Path("case.toml"),
) -> None:
    """Tables of LCMsim: parts with their properties, inlets, outlets, and parameters."""
    from decimal import Decimal

    from lcmchain.coupling.infiltration.foreign_case import read_lcmsim
    from lcmchain.quantities.units import TIME

    for file in (parts, parameters):
        _require_file(file)
    seconds = Decimal(repr(quantity("--time", time, TIME)))
    case = read_lcmsim(parts, parameters, mesh, seconds, ports)
    _write(case, out, [parts, parameters, mesh, ports])


def _require_file(path: Path) -> None:
    if not path.is_file():
        raise InputError("there is no such file", file=path)


def _write(case: Any, out: Path, inputs: list[Path | None]) -> None:
    from lcmchain.atomic import replacing
    from lcmchain.coupling.infiltration.foreign_case import case_text
    from lcmchain.scene.reading.single_tables import infiltration_from_text

    text = case_text(case)
    infiltration_from_text(text, out)  # what the case may not hold is told by its keys
    with output_folder(out.parent, inputs=[*inputs, case.mesh]), replacing(out) as temporary:
        temporary.write_text(text, encoding="utf-8")
    for zone in case.zones:
        say(f'{zone.kind} "{zone.name}": {zone.in_words} of {case.mesh.name}')
    for told in case.told:
        warn(f"not taken over: {told}")
    say(f"Wrote {out}. Fill with: lcmchain fill {case.mesh} --case {out}")
