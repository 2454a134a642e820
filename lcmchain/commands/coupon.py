"""``lcmchain coupon NAME``: a simulated coupon test beside its analytic solution."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from lcmchain.commands.options import OutFolder, Overrides, output_folder
from lcmchain.commands.terminal import console, progress_bar, quantity, say, warn

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
    from importlib import import_module

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
