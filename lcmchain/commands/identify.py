"""``lcmchain identify LAW DATA.csv``: parameters of a fabric law from coupon test data."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from lcmchain.commands.options import output_folder
from lcmchain.commands.terminal import console, say, warn

identify_app = typer.Typer(
    no_args_is_help=True, help="Identify parameters of a fabric law from coupon test data."
)

CouponFile = Annotated[
    Path, typer.Argument(metavar="DATA.csv", help="Test data, units in the header.")
]
CouponFolder = Annotated[
    Path | None,
    typer.Option("--out", metavar="DIR", help="Folder of the results; default results/<data>."),
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


def _rows(zero: str | None, without: str | None, ranges: list[str] | None) -> Any:
    from lcmchain.identification.entering_rows import Wish

    return Wish(zero, without, tuple(ranges or ()))


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
    with output_folder(out or Path("results") / data.stem, inputs=[data]) as folder:
        from lcmchain.identification.files import tables, write_identification

        result = identify()
        snippet, picture, _ = write_identification(result, folder)
    terminal = console()
    for table in tables(result):
        terminal.print(table)
    for warning in result.warnings:
        warn(warning)
    say(f"For the scene file: {snippet}\nPicture of the fit: {picture}")
