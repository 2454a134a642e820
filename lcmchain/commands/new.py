"""``lcmchain new CASE``: a commented scene to start from."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lcmchain.commands.folders import output_folder
from lcmchain.commands.terminal import console, length_of, quantity, say
from lcmchain.errors import InputError

if TYPE_CHECKING:
    from lcmchain.quantities.units import Dimension
    from lcmchain.scene.cases.sheet import Sheet

new_app = typer.Typer(
    invoke_without_command=True,
    help="Write a commented scene to start from; without a case, list the cases.",
)

Out = Annotated[
    Path | None,
    typer.Option(
        "--out", metavar="FILE", help="Scene file, or a folder for scene.toml; default CASE."
    ),
]
Preset = Annotated[
    str, typer.Option(metavar="NAME", help="Published fabric, see lcmchain docs presets.")
]
BlankSize = Annotated[
    str | None,
    typer.Option(metavar="LENGTHS", help='Side of the blank, or both: "300 200 mm".'),
]
EdgeLength = Annotated[
    str | None, typer.Option(metavar="LENGTH", help="Edge length of the elements.")
]
FibreAngle = Annotated[str, typer.Option(metavar="ANGLE", help="From x to fibre direction 1.")]
Friction = Annotated[
    float | None, typer.Option(min=0.0, max=1.0, help="Coulomb friction coefficient.")
]
Time = Annotated[str | None, typer.Option(metavar="TIME", help="Simulated time.")]


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
    preset: Preset = "MD600",
    blank_size: BlankSize = None,
    edge_length: EdgeLength = None,
    fibre_angle: FibreAngle = "0 deg",
    friction: Friction = None,
    time: Time = None,
    out: Out = None,
) -> None:
    """A spherical punch presses a blank through a round hole."""
    from lcmchain.quantities.units import MASS
    from lcmchain.scene.cases.simple_tools import Punch, punch_scene

    file = _new_file(out, "punch")
    sheet = _sheet(preset, blank_size, edge_length, fibre_angle, friction, time)
    sizes = Punch(
        radius=length_of("--punch-radius", punch_radius),
        stroke=_length("--stroke", stroke),
        gap=_length("--gap", gap),
        fillet_radius=_length("--fillet-radius", fillet_radius),
        holder=holder,
        holder_mass=_optional("--holder-mass", holder_mass, MASS),
    )
    _write(file, punch_scene(sheet, sizes, file.name))


@new_app.command("moulds")
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
    preset: Preset = "MD600",
    blank_size: BlankSize = None,
    edge_length: EdgeLength = None,
    fibre_angle: FibreAngle = "0 deg",
    friction: Friction = None,
    time: Time = None,
    out: Out = None,
) -> None:
    """Two matched moulds from STL files close on a blank."""
    from lcmchain.scene.cases.moulds import Moulds, moulds_scene

    file = _new_file(out, "moulds")
    sheet = _sheet(preset, blank_size, edge_length, fibre_angle, friction, time)
    length_of("--length-unit", f"1 {length_unit}")
    moulds = Moulds(upper, lower, length_unit, _length("--gap", gap))
    text, notes = moulds_scene(sheet, moulds, file)
    _write(file, text)
    for note in notes:
        say(note)


@new_app.command("drape")
def new_drape(
    shape: Annotated[str, typer.Option(help="sphere, pillar or ridge.")] = "sphere",
    radius: Annotated[str, typer.Option(metavar="LENGTH", help="Of the shape.")] = "75 mm",
    form: Annotated[
        Path | None, typer.Option(metavar="FILE", help="STL or mesh of a form in place of a shape.")
    ] = None,
    length_unit: Annotated[str, typer.Option(metavar="UNIT", help="Of the file.")] = "mm",
    preset: Preset = "MD600",
    blank_size: BlankSize = None,
    edge_length: EdgeLength = None,
    fibre_angle: FibreAngle = "0 deg",
    friction: Friction = None,
    time: Time = None,
    out: Out = None,
) -> None:
    """A blank falls over a form: sphere, pillar, ridge or STL file."""
    from lcmchain.scene.cases.simple_tools import Form, drape_scene

    file = _new_file(out, "drape")
    sheet = _sheet(preset, blank_size, edge_length, fibre_angle, friction, time)
    length_of("--length-unit", f"1 {length_unit}")
    the_form = Form(shape, length_of("--radius", radius), form, length_unit)
    _write(file, drape_scene(sheet, the_form, file))


@new_app.command("coupon")
def new_coupon(
    preset: Preset = "MD600",
    blank_size: BlankSize = None,
    edge_length: EdgeLength = None,
    fibre_angle: FibreAngle = "0 deg",
    friction: Friction = None,
    time: Time = None,
    out: Out = None,
) -> None:
    """A fabric with all its values spelled out, for coupon tests."""
    from lcmchain.scene.cases.simple_tools import coupon_scene

    file = _new_file(out, "coupon")
    sheet = _sheet(preset, blank_size, edge_length, fibre_angle, friction, time)
    _write(file, coupon_scene(sheet, file.name))
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


def _sheet(
    preset: str,
    blank_size: str | None,
    edge_length: str | None,
    fibre_angle: str,
    friction: float | None,
    time: str | None,
) -> Sheet:
    from lcmchain.quantities.units import ANGLE, TIME, QuantityError, parse_quantity, split_row
    from lcmchain.scene.cases.sheet import Sheet

    size = None
    if blank_size is not None:
        sides = [length_of("--blank-size", side) for side in split_row(blank_size) or [blank_size]]
        if len(sides) > 2:
            raise InputError(f'"{blank_size}" has more than two sides', key="--blank-size")
        size = (sides[0], sides[-1])
    try:
        parse_quantity(fibre_angle, ANGLE)
    except QuantityError as error:
        raise InputError(str(error), key="--fibre-angle") from None
    sheet = Sheet(
        preset=preset,
        size=size,
        edge_length=_length("--edge-length", edge_length),
        fibre_angle=fibre_angle,
        friction=friction,
        time=_optional("--time", time, TIME),
    )
    sheet.fabric  # a wrong name is told before files are read  # noqa: B018
    return sheet


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
