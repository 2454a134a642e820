"""Coupon tests: ``lcmchain coupon NAME`` simulates one, ``identify LAW DATA.csv`` reads one."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from lcmchain.commands.options import Overrides, name_of_input, output_folder, results_option
from lcmchain.commands.terminal import console, progress_bar, quantity, say, warn

if TYPE_CHECKING:
    from lcmchain.identification.entering_rows import RowChoice

# --- coupon: a simulated test beside its analytic solution ----------------------------------------


# Material of coupons that name no scene; blank and process only make it a whole scene.
COUPON_SCENE = """
process = { time = "1 s" }
blank = { size = ["20 mm", "20 mm"], edge_length = "5 mm" }
material = { preset = "MD600" }
"""

coupon_app = typer.Typer(
    no_args_is_help=True, help="Simulate a coupon test beside its analytic solution."
)

MaterialScene = Annotated[
    Path | None,
    typer.Option(
        "--scene", metavar="SCENE", help="Take material and element of this scene; default MD600."
    ),
]
OutFolder = Annotated[
    Path | None,
    results_option("coupon/<test>"),
]
EdgeLength = Annotated[str, typer.Option(metavar="LENGTH", help="Edge length of the elements.")]


@coupon_app.command("bias-extension")
def coupon_bias_extension(
    scene: MaterialScene = None,
    out: OutFolder = None,
    length: Annotated[str, typer.Option(help="Free length l0, at least 2 w0.")] = "320 mm",
    width: Annotated[str, typer.Option(help="Width w0.")] = "160 mm",
    displacement: Annotated[str, typer.Option(help="Displacement at the end.")] = "60 mm",
    edge_length: EdgeLength = "5 mm",
    overrides: Overrides = None,
) -> None:
    """Pull a strip with fibres at 45 degrees: force and shear angle over displacement."""
    sizes = {"--length": length, "--width": width, "--displacement": displacement}
    _run_coupon("bias_extension", scene, overrides, out, sizes | {"--edge-length": edge_length})


@coupon_app.command("picture-frame")
def coupon_picture_frame(
    scene: MaterialScene = None,
    out: OutFolder = None,
    side: Annotated[str, typer.Option(help="Side length of frame and fabric.")] = "200 mm",
    shear_angle: Annotated[str, typer.Option(help="Shear angle at the end.")] = "64 deg",
    edge_length: EdgeLength = "10 mm",
    speed: Annotated[
        str | None,
        typer.Option(help="Speed of the machine along the diagonal; half a second without."),
    ] = None,
    hold: Annotated[
        str | None, typer.Option(help="Time that the frame then stands still, for relaxation.")
    ] = None,
    cycles: Annotated[
        int, typer.Option(min=0, help="Times that the frame goes there and back; 0: only there.")
    ] = 0,
    overrides: Overrides = None,
) -> None:
    """Shear a square in a hinged frame: force along the diagonal and along the sides."""
    sizes = {"--side": side, "--shear-angle": shear_angle, "--edge-length": edge_length}
    more = {"--speed": speed, "--hold": hold}
    sizes |= {option: text for option, text in more.items() if text is not None}
    _run_coupon("picture_frame", scene, overrides, out, sizes, cycles=cycles)


@coupon_app.command("off-axis")
def coupon_off_axis(
    scene: MaterialScene = None,
    out: OutFolder = None,
    angle: Annotated[str, typer.Option(help="Angle of the first fibres from the pull.")] = "45 deg",
    length: Annotated[str, typer.Option(help="Length between the clamps.")] = "160 mm",
    width: Annotated[str, typer.Option(help="Width of the strip.")] = "40 mm",
    displacement: Annotated[str, typer.Option(help="Displacement at the end.")] = "10 mm",
    edge_length: EdgeLength = "5 mm",
    overrides: Overrides = None,
) -> None:
    """Pull a strip with fibres at an angle between oblique clamps: force and shear angle."""
    sizes = {"--angle": angle, "--length": length, "--width": width}
    sizes |= {"--displacement": displacement, "--edge-length": edge_length}
    _run_coupon("off_axis", scene, overrides, out, sizes)


@coupon_app.command("compaction")
def coupon_compaction(
    scene: MaterialScene = None,
    out: OutFolder = None,
    pressure: Annotated[str, typer.Option(help="Pressure at the end.")] = "1.5 MPa",
    size: Annotated[str, typer.Option(help="Side length of the specimen.")] = "20 mm",
    shear_angle: Annotated[
        str | None,
        typer.Option(help="Shear angle to which the piece is brought first; unsheared without."),
    ] = None,
    hold: Annotated[
        str | None, typer.Option(help="Time that the plates stand still in the end; none without.")
    ] = None,
    edge_length: EdgeLength = "5 mm",
    overrides: Overrides = None,
) -> None:
    """Press a piece between plates, sheared or not, and held: pressure over thickness."""
    sizes = {"--pressure": pressure, "--size": size, "--edge-length": edge_length}
    if shear_angle is not None:
        sizes["--shear-angle"] = shear_angle
    if hold is not None:
        sizes["--hold"] = hold
    _run_coupon("compaction", scene, overrides, out, sizes)


@coupon_app.command("cantilever")
def coupon_cantilever(
    scene: MaterialScene = None,
    out: OutFolder = None,
    width: Annotated[str, typer.Option(help="Width of the strips.")] = "25 mm",
    angle: Annotated[str, typer.Option(help="Fall of the line from clamp to tip.")] = "41.5 deg",
    edge_length: EdgeLength = "5 mm",
    overrides: Overrides = None,
) -> None:
    """Find the overhang of strips at 0, 45 and 90 degrees that bend under their weight."""
    sizes = {"--width": width, "--angle": angle, "--edge-length": edge_length}
    _run_coupon("cantilever", scene, overrides, out, sizes)


@coupon_app.command("pure-bending")
def coupon_pure_bending(
    scene: MaterialScene = None,
    out: OutFolder = None,
    curvature: Annotated[str, typer.Option(help="Largest curvature, to both sides.")] = "20 1/m",
    cycles: Annotated[int, typer.Option(min=1, help="Loops to both sides.")] = 2,
    fibre: Annotated[int, typer.Option(min=1, max=2, help="Fibre direction that is bent.")] = 1,
    length: Annotated[str, typer.Option(help="Length between the ends.")] = "20 mm",
    width: Annotated[str, typer.Option(help="Width of the strip.")] = "20 mm",
    edge_length: EdgeLength = "5 mm",
    overrides: Overrides = None,
) -> None:
    """Bend a strip to both sides (Kawabata): moment over curvature, with its loop."""
    sizes = {"--curvature": curvature, "--length": length, "--width": width}
    sizes |= {"--edge-length": edge_length}
    _run_coupon("pure_bending", scene, overrides, out, sizes, cycles=cycles, fibre=fibre)


def _run_coupon(
    name: str,
    scene: Path | None,
    overrides: list[str] | None,
    out: Path | None,
    sizes: dict[str, str],
    **counts: int,
) -> None:
    """Simulate a coupon with the options ``sizes``, write its files and print its table.

    counts : options that are numbers without a unit, by their names.
    """
    from lcmchain.scene import read_scene, scene_from_text

    values = {
        option[2:].replace("-", "_"): quantity(option, text) for option, text in sizes.items()
    }
    if scene is None:
        the_scene = scene_from_text(COUPON_SCENE, overrides=overrides or ())
    else:
        the_scene = read_scene(scene, overrides or ())
    title = name.replace("_", "-")
    with output_folder(out or Path("results") / "coupon" / title, inputs=[scene]) as folder:
        from lcmchain.coupons.result import write_coupon
        from lcmchain.scene.presets import preset_remarks

        simulate = getattr(import_module(f"lcmchain.coupons.{name}"), name)
        with progress_bar() as progress:
            ply = the_scene.only_ply("lcmchain coupon")
            result = simulate(ply.material, ply.element, progress=progress, **values, **counts)
        remarks = preset_remarks(ply.material)
        write_coupon(folder, result, remarks)
    console().print(result.table())
    for remark in remarks:
        warn(remark)
    say(f"Results in {folder}")


# --- identify: parameters of a fabric law from test data ------------------------------------------


identify_app = typer.Typer(
    no_args_is_help=True, help="Identify parameters of a fabric law from coupon test data."
)

CouponFile = Annotated[
    Path, typer.Argument(metavar="DATA.csv", help="Test data, units in the header.")
]
CouponFolder = Annotated[
    Path | None,
    results_option("<data>"),
]
NoiseFloor = Annotated[
    float, typer.Option(help="Smallest noise, relative to the largest measured value.")
]

ExportColumns = Annotated[
    str | None,
    typer.Option(
        "--columns",
        metavar="NAMES",
        help="What the columns of a machine's export are, as force=Standardkraft,...",
    ),
]
Accept = Annotated[
    bool,
    typer.Option(
        "--accept", help="Take the fit as it is where the law does not describe the data."
    ),
]
Zero = Annotated[
    str | None,
    typer.Option(
        "--zero",
        metavar="ZERO",
        help="Zero of load and travel: contact, preload, or the readings, as force=0.4 N,...",
    ),
]
Without = Annotated[
    str | None,
    typer.Option("--without", metavar="WHAT", help="Leave out what is found of: slip, tear."),
]
Range = Annotated[
    list[str] | None,
    typer.Option(
        "--range",
        metavar="RANGE",
        help='Rows to fit, as "2 mm to 40 mm", "up to 40 mm", "A: from 2 mm" (specimen A).',
    ),
]


def _rows(zero: str | None, without: str | None, ranges: list[str] | None) -> RowChoice:
    from lcmchain.identification.entering_rows import RowChoice

    return RowChoice(zero, without, tuple(ranges or ()))


def _size(option: str, default: str) -> Any:
    return typer.Option(option, metavar="SIZE", help=f"With unit; default {default}.")


FabricThickness = Annotated[str | None, _size("--thickness", "1.004 mm (MD600)")]
ArealMass = Annotated[str | None, _size("--areal-mass", "600 g/m^2 (MD600)")]


@identify_app.command("shear")
def identify_shear(
    data: CouponFile,
    out: CouponFolder = None,
    length: Annotated[str | None, _size("--length", "320 mm")] = None,
    width: Annotated[str | None, _size("--width", "160 mm")] = None,
    thickness: FabricThickness = None,
    test: Annotated[
        str, typer.Option(help="bias-extension, or picture-frame (--side).")
    ] = "bias-extension",
    side: Annotated[str | None, _size("--side", "200 mm")] = None,
    measured_angle: Annotated[
        bool, typer.Option("--measured-angle", help="Take the shear angle, not the displacement.")
    ] = False,
    method: Annotated[
        str, typer.Option(help="force: fit the force; recursion: Eq. (22); printed: as printed.")
    ] = "force",
    convention: Annotated[
        str, typer.Option(help="Shear strain of the law: engineering or tensor.")
    ] = "engineering",
    noise_floor: NoiseFloor = 0.01,
    zero: Zero = None,
    without: Without = None,
    ranges: Range = None,
    columns: ExportColumns = None,
    accept: Accept = False,
) -> None:
    """Shear polynomial from bias extension or picture frame: displacement or angle, force."""
    from lcmchain.identification.from_file import identify_shear_file

    sizes = {"length": length, "width": width, "side": side, "thickness": thickness}
    _report_identification(
        data, out, lambda: identify_shear_file(
            data, sizes, columns=columns, method=method, convention=convention, test=test,
            measured_angle=measured_angle, noise_floor=noise_floor, accept=accept,
            rows=_rows(zero, without, ranges),
        ),
    )  # fmt: skip


@identify_app.command("viscous")
def identify_viscous(
    data: CouponFile,
    out: CouponFolder = None,
    side: Annotated[str | None, _size("--side", "200 mm")] = None,
    thickness: FabricThickness = None,
    noise_floor: NoiseFloor = 0.01,
    zero: Zero = None,
    ranges: Range = None,
    columns: ExportColumns = None,
    accept: Accept = False,
) -> None:
    """Shear and what resists its rate from picture frames: displacement, force, speed or time."""
    from lcmchain.identification.from_file import identify_viscous_file

    sizes = {"side": side, "thickness": thickness}
    _report_identification(
        data, out,
        lambda: identify_viscous_file(
            data, sizes, columns=columns, noise_floor=noise_floor, accept=accept,
            rows=_rows(zero, None, ranges),
        ),
    )  # fmt: skip


@identify_app.command("off-axis")
def identify_off_axis(
    data: CouponFile,
    out: CouponFolder = None,
    length: Annotated[str | None, _size("--strip-length", "160 mm")] = None,
    width: Annotated[str | None, _size("--strip-width", "40 mm")] = None,
    thickness: FabricThickness = None,
    noise_floor: NoiseFloor = 0.01,
    zero: Zero = None,
    without: Without = None,
    ranges: Range = None,
    columns: ExportColumns = None,
    accept: Accept = False,
) -> None:
    """Unidirectional fabric from off-axis tension: angle, displacement, force."""
    from lcmchain.identification.from_file import identify_off_axis_file

    sizes = {"strip_length": length, "strip_width": width, "thickness": thickness}
    _report_identification(
        data, out,
        lambda: identify_off_axis_file(
            data, sizes, columns=columns, noise_floor=noise_floor, accept=accept,
            rows=_rows(zero, without, ranges),
        ),
    )  # fmt: skip


@identify_app.command("compaction")
def identify_compaction(
    data: CouponFile,
    out: CouponFolder = None,
    thickness: FabricThickness = None,
    areal_mass: ArealMass = None,
    fibre_density: Annotated[str | None, _size("--fibre-density", "1810 kg/m^3 (MD600)")] = None,
    noise_floor: NoiseFloor = 0.001,
    table: Annotated[
        bool, typer.Option("--table", help="Find pressures at every shear angle, not one exponent.")
    ] = False,
    zero: Zero = None,
    ranges: Range = None,
    columns: ExportColumns = None,
    accept: Accept = False,
) -> None:
    """Compaction law from plate-to-plate tests: thickness or fibre volume fraction, pressure."""
    from lcmchain.identification.from_file import identify_compaction_file

    sizes = {"thickness": thickness, "areal_mass": areal_mass, "fibre_density": fibre_density}
    _report_identification(
        data, out, lambda: identify_compaction_file(
            data, sizes, columns=columns, noise_floor=noise_floor, table=table, accept=accept,
            rows=_rows(zero, None, ranges),
        ),
    )  # fmt: skip


@identify_app.command("bending")
def identify_bending(
    data: CouponFile,
    out: CouponFolder = None,
    thickness: FabricThickness = None,
    areal_mass: ArealMass = None,
    angle: Annotated[str | None, _size("--angle", "41.5 deg")] = None,
    off_axis: Annotated[
        str, typer.Option(help="Strips off the fibres: free-strip (narrow) or cylindrical (wide).")
    ] = "free-strip",
    curve: Annotated[
        bool, typer.Option("--curve", help="Find moments over curvature from deflection curves.")
    ] = False,
    columns: ExportColumns = None,
    accept: Accept = False,
) -> None:
    """Bending stiffness from cantilever tests: orientation, overhang (or length, angle; x, y)."""
    from lcmchain.identification.from_file import identify_bending_file

    sizes = {"thickness": thickness, "areal_mass": areal_mass, "angle": angle}
    _report_identification(
        data,
        out,
        lambda: identify_bending_file(
            data, sizes, columns=columns, off_axis=off_axis, curve=curve, accept=accept
        ),
    )


@identify_app.command("bending-loop")
def identify_bending_loop(
    data: CouponFile,
    out: CouponFolder = None,
    thickness: FabricThickness = None,
    fibre: Annotated[
        int, typer.Option(min=1, max=2, help="Fibre direction that was bent: 1 or 2.")
    ] = 1,
    noise_floor: NoiseFloor = 0.5,
    columns: ExportColumns = None,
    accept: Accept = False,
) -> None:
    """Bending with its friction from loops (Kawabata): curvature, moment per width."""
    from lcmchain.identification.from_file import identify_bending_loop_file

    sizes = {"thickness": thickness}
    _report_identification(
        data, out, lambda: identify_bending_loop_file(
            data, sizes, columns=columns, fibre=fibre, noise_floor=noise_floor, accept=accept
        ),
    )  # fmt: skip


@identify_app.command("shear-loop")
def identify_shear_loop(
    data: CouponFile,
    out: CouponFolder = None,
    side: Annotated[str | None, _size("--side", "200 mm")] = None,
    thickness: FabricThickness = None,
    noise_floor: NoiseFloor = 0.5,
    columns: ExportColumns = None,
    accept: Accept = False,
) -> None:
    """Shear with its friction from cycles of a picture frame: displacement or angle, force."""
    from lcmchain.identification.from_file import identify_shear_loop_file

    sizes = {"side": side, "thickness": thickness}
    _report_identification(
        data, out,
        lambda: identify_shear_loop_file(
            data, sizes, columns=columns, noise_floor=noise_floor, accept=accept
        ),
    )  # fmt: skip


def _report_identification(data: Path, out: Path | None, identify) -> None:
    with output_folder(out or Path("results") / name_of_input(data), inputs=[data]) as folder:
        from lcmchain.identification.files import tables, write_identification

        result = identify()
        snippet, picture, _ = write_identification(result, folder)
    terminal = console()
    for table in tables(result):
        terminal.print(table)
    for warning in result.warnings:
        warn(warning)
    say(f"For the scene file: {snippet}\nPicture of the fit: {picture}")
