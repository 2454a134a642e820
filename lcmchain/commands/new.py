"""Scenes and cases to start from: ``lcmchain new CASE``, and ``import`` from other programs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lcmchain.atomic import replacing
from lcmchain.commands.options import output_folder, takes_options
from lcmchain.commands.terminal import console, length_of, quantity, say, warn
from lcmchain.errors import InputError
from lcmchain.quantities.units import ANGLE, MASS, TIME, QuantityError, parse_quantity, split_row

if TYPE_CHECKING:
    from lcmchain.coupling.infiltration.foreign_case import ForeignCase
    from lcmchain.quantities.units import Dimension
    from lcmchain.scene.cases.sheet import Sheet


new_app = typer.Typer(
    invoke_without_command=True,
    help="Write a commented scene to start from; without a case, list the cases.",
)

Out = Annotated[
    Path | None,
    typer.Option(
        "--out", "-o", metavar="FILE", help="Scene file, or a folder for scene.toml; default CASE."
    ),
]


@dataclass(frozen=True)
class SheetOptions:
    """Options of all cases: the fabric, the blank and its mesh, friction, and the time."""

    preset: Annotated[
        str, typer.Option(metavar="NAME", help="Published fabric, see lcmchain docs presets.")
    ] = "MD600"
    blank_size: Annotated[
        str | None,
        typer.Option(metavar="LENGTHS", help='Side of the blank, or both: "300 200 mm".'),
    ] = None
    edge_length: Annotated[
        str | None, typer.Option(metavar="LENGTH", help="Edge length of the elements.")
    ] = None
    fibre_angle: Annotated[
        str, typer.Option(metavar="ANGLE", help="From x to fibre direction 1.")
    ] = "0 deg"
    friction: Annotated[
        float | None, typer.Option(min=0.0, max=1.0, help="Coulomb friction coefficient.")
    ] = None
    time: Annotated[str | None, typer.Option(metavar="TIME", help="Simulated time.")] = None

    def read(self) -> Sheet:
        """Return the sheet of the new scene.

        Raises
        ------
        InputError : an option that cannot be read, or an unknown preset; names the option.
        """
        from lcmchain.scene.cases.sheet import Sheet

        size = None
        if self.blank_size is not None:
            texts = split_row(self.blank_size) or [self.blank_size]
            sides = [length_of("--blank-size", text) for text in texts]
            if len(sides) > 2:
                raise InputError(f'"{self.blank_size}" has more than two sides', key="--blank-size")
            size = (sides[0], sides[-1])
        try:
            parse_quantity(self.fibre_angle, ANGLE)
        except QuantityError as error:
            raise InputError(str(error), key="--fibre-angle") from None
        sheet = Sheet(
            preset=self.preset,
            size=size,
            edge_length=_length("--edge-length", self.edge_length),
            fibre_angle=self.fibre_angle,
            friction=self.friction,
            time=_optional("--time", self.time, TIME),
        )
        sheet.fabric  # a wrong name is told before files are read  # noqa: B018
        return sheet


@new_app.callback()
def new(context: typer.Context) -> None:
    """Write a commented scene to start from; without a case, list the cases."""
    if context.invoked_subcommand is not None:
        return
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for heading in ("case", "what it forms"):
        table.add_column(heading)
    for command in new_app.registered_commands:
        text = (getattr(command.callback, "__doc__", "") or "").splitlines()[0]
        table.add_row(command.name, text)
    console().print(table)
    say("lcmchain new CASE --help lists the dimensions that can be given.")


@new_app.command("punch")
@takes_options
def new_punch(
    punch_radius: Annotated[str, typer.Option(metavar="LENGTH", help="Of the punch.")] = "75 mm",
    stroke: Annotated[
        str | None, typer.Option(metavar="LENGTH", help="Travel of the punch; default its radius.")
    ] = None,
    gap: Annotated[
        str | None,
        typer.Option(metavar="LENGTH", help="Between punch and hole; default two thicknesses."),
    ] = None,
    fillet_radius: Annotated[
        str | None, typer.Option(metavar="LENGTH", help="Of the edges of the hole.")
    ] = None,
    holder: Annotated[bool, typer.Option(help="With a blank holder.")] = True,
    holder_mass: Annotated[
        str | None, typer.Option(metavar="MASS", help="Default 1.7 kg on 300 mm x 300 mm.")
    ] = None,
    *,
    sheet: SheetOptions,
    out: Out = None,
) -> None:
    """A spherical punch presses a blank through a round hole."""
    from lcmchain.scene.cases.simple_tools import Punch, punch_scene

    file = _new_file(out, "punch")
    blank = sheet.read()
    sizes = Punch(
        radius=length_of("--punch-radius", punch_radius),
        stroke=_length("--stroke", stroke),
        gap=_length("--gap", gap),
        fillet_radius=_length("--fillet-radius", fillet_radius),
        holder=holder,
        holder_mass=_optional("--holder-mass", holder_mass, MASS),
    )
    _write(file, punch_scene(blank, sizes, file.name))


@new_app.command("moulds")
@takes_options
def new_moulds(
    upper: Annotated[
        Path, typer.Option(metavar="FILE", help="Upper mould: STL, a deck, or any other mesh file.")
    ],
    lower: Annotated[Path, typer.Option(metavar="FILE", help="Lower mould.")],
    length_unit: Annotated[str, typer.Option(metavar="UNIT", help="Of the files.")] = "mm",
    gap: Annotated[
        str | None,
        typer.Option(
            metavar="LENGTH", help="Smallest gap of the closed moulds; default the thickness."
        ),
    ] = None,
    *,
    sheet: SheetOptions,
    out: Out = None,
) -> None:
    """Two matched moulds from STL files close on a blank."""
    from lcmchain.scene.cases.moulds import Moulds, moulds_scene

    file = _new_file(out, "moulds")
    blank = sheet.read()
    length_of("--length-unit", f"1 {length_unit}")
    moulds = Moulds(upper, lower, length_unit, _length("--gap", gap))
    text, notes = moulds_scene(blank, moulds, file)
    _write(file, text)
    for note in notes:
        say(note)


@new_app.command("drape")
@takes_options
def new_drape(
    shape: Annotated[str, typer.Option(help="sphere, pillar or ridge.")] = "sphere",
    radius: Annotated[str, typer.Option(metavar="LENGTH", help="Of the shape.")] = "75 mm",
    form: Annotated[
        Path | None, typer.Option(metavar="FILE", help="STL or mesh of a form in place of a shape.")
    ] = None,
    length_unit: Annotated[str, typer.Option(metavar="UNIT", help="Of the file.")] = "mm",
    *,
    sheet: SheetOptions,
    out: Out = None,
) -> None:
    """A blank falls over a form: sphere, pillar, ridge or STL file."""
    from lcmchain.scene.cases.simple_tools import Form, drape_scene

    file = _new_file(out, "drape")
    blank = sheet.read()
    length_of("--length-unit", f"1 {length_unit}")
    the_form = Form(shape, length_of("--radius", radius), form, length_unit)
    _write(file, drape_scene(blank, the_form, file))


@new_app.command("coupon")
@takes_options
def new_coupon(
    *,
    sheet: SheetOptions,
    out: Out = None,
) -> None:
    """A fabric with all its values spelled out, for coupon tests."""
    from lcmchain.scene.cases.simple_tools import coupon_scene

    file = _new_file(out, "coupon")
    blank = sheet.read()
    _write(file, coupon_scene(blank, file.name))
    for name in ("bias-extension", "picture-frame", "compaction", "cantilever", "pure-bending"):
        say(f"Coupon test:  lcmchain coupon {name} --scene {file}")


def _new_file(out: Path | None, case: str) -> Path:
    """Return the scene file to write, which must not exist."""
    file = out or Path(case)
    if file.suffix != ".toml" or file.is_dir():
        file = file / "scene.toml"
    if file.exists():
        raise InputError("exists already; name another file with --out", file=file)
    return file


def _length(option: str, text: str | None) -> float | None:
    return None if text is None else length_of(option, text)


def _optional(option: str, text: str | None, dimension: Dimension) -> float | None:
    return None if text is None else quantity(option, text, dimension)


def _write(file: Path, text: str) -> None:
    """Write a scene that does not exist yet, if it is one, and say what comes next."""
    from lcmchain.scene import scene_from_text

    with output_folder(file.parent):
        scene_from_text(text, file)  # what the options have made of it, told with the key
        try:
            with file.open("x", encoding="utf-8", newline="\n") as target:
                target.write(text)
        except FileExistsError:
            raise InputError("exists already; name another file with --out", file=file) from None
    say(f"Wrote {file}")
    say(f"Next:  lcmchain check {file}")
    say(f"Then:  lcmchain run {file}")


# --- cases of other programs, written as a case of this one ---------------------------------------


import_app = typer.Typer(no_args_is_help=True, help="Take over a filling case of RTMsim or LCMsim.")

PortsFile = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE.csv",
        help="Ports that were picked with the mouse: a radius, then x,y,z in each line, in metres; "
        "of LCMsim default _pset.csv beside the mesh.",
    ),
]
CaseFile = Annotated[
    Path, typer.Option("--out", "-o", metavar="FILE.toml", help="Case that is written.")
]


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
    _write_case(read_rtmsim(source, mesh, ports), out, [source, mesh, ports])


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

    for file in (parts, parameters):
        _require_file(file)
    seconds = Decimal(repr(quantity("--time", time, TIME)))
    case = read_lcmsim(parts, parameters, mesh, seconds, ports)
    _write_case(case, out, [parts, parameters, mesh, ports])


def _require_file(path: Path) -> None:
    if not path.is_file():
        raise InputError("there is no such file", file=path)


def _write_case(case: ForeignCase, out: Path, inputs: list[Path | None]) -> None:
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
