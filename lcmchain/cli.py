"""The commands of lcmchain. They parse, call, and report; the work is done elsewhere."""

from __future__ import annotations

import json
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from lcmchain.errors import InputError, LcmchainError

# Nothing heavy is imported up here: `lcmchain --help` must answer at once.

# Material of coupons that name no scene; blank and process only make it a whole scene.
COUPON_SCENE = """
process = { time = "1 s" }
blank = { size = ["20 mm", "20 mm"], edge_length = "5 mm" }
material = { preset = "MD600" }
"""

app = typer.Typer(
    name="lcmchain",
    help="Forming simulation of engineering textiles, and the chain of stages that follows it.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
fmu_app = typer.Typer(no_args_is_help=True, help="Package a scene as a functional mock-up unit.")
app.add_typer(fmu_app, name="fmu")
coupon_app = typer.Typer(
    no_args_is_help=True, help="Simulate a coupon test beside its analytic solution."
)
app.add_typer(coupon_app, name="coupon")
identify_app = typer.Typer(
    no_args_is_help=True, help="Identify parameters of a fabric law from coupon test data."
)
app.add_typer(identify_app, name="identify")
verify_app = typer.Typer(
    no_args_is_help=True, help="Solve problems with known solutions and compare."
)
app.add_typer(verify_app, name="verify")

SceneFile = Annotated[Path, typer.Argument(metavar="SCENE", help="Scene file (TOML).")]
OutFolder = Annotated[
    Path | None,
    typer.Option("--out", metavar="DIR", help="Folder of the results; default results/<scene>."),
]
Overrides = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Replace a scene entry, as in --set tools.punch.friction=0.2; may be repeated.",
    ),
]
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


def _size(option: str, default: str):
    help_text = f"With unit; default {default}."
    return Annotated[str | None, typer.Option(option, metavar="SIZE", help=help_text)]


FabricThickness = _size("--thickness", "1.004 mm (MD600)")
ArealMass = _size("--areal-mass", "600 g/m^2 (MD600)")

MarkdownFile = Annotated[
    Path | None,
    typer.Option("--out", metavar="FILE.md", help="Write the table as Markdown too."),
]
MaterialScene = Annotated[
    Path | None,
    typer.Option(
        "--scene", metavar="SCENE", help="Take material and element of this scene; default MD600."
    ),
]
EdgeLength = Annotated[str, typer.Option(metavar="LENGTH", help="Edge length of the elements.")]


@app.command()
def run(
    scene: SceneFile,
    out: OutFolder = None,
    threads: Annotated[
        int | None,
        typer.Option("--threads", min=1, metavar="N", help="Number of threads; default all cores."),
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on from the last checkpoint in DIR.")
    ] = False,
    overrides: Overrides = None,
) -> None:
    """Form the blank, and map its fields to the meshes that the scene names."""
    from lcmchain.scene import read_scene

    the_scene = read_scene(scene, overrides or ())
    with output_folder(out or default_out(scene)) as folder:
        from lcmchain.pipeline import run as run_scene

        with progress_bar() as progress:
            run_scene(the_scene, folder, threads=threads, resume=resume, progress=progress)
    _say(f"Results in {folder}")


@app.command()
def check(scene: SceneFile, out: OutFolder = None, overrides: Overrides = None) -> None:
    """Show what will be simulated and why, what was defaulted, and what it costs."""
    from lcmchain.scene import read_scene

    the_scene = read_scene(scene, overrides or ())
    with output_folder(out or default_out(scene)) as folder:
        from lcmchain.check import check_scene

        report = check_scene(the_scene, folder)
    console = _console()
    for table in report.tables():
        console.print(table)
    for warning in report.warnings:
        _warn(warning)
    _say(f"Picture of the start: {report.picture}")


@app.command()
def schema(
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="FILE", help="Write to a file instead of the terminal."),
    ] = None,
) -> None:
    """Print the JSON Schema of scene files, for completion and checks in editors."""
    from lcmchain.scene import scene_json_schema

    text = json.dumps(scene_json_schema(), indent=2) + "\n"
    if out is None:
        sys.stdout.write(text)
        return
    try:
        out.write_text(text, encoding="utf-8")
    except OSError as error:
        raise InputError(f"cannot be written: {error.strerror}", file=out) from None


@app.command("map")
def map_fields(
    source: Annotated[Path, typer.Argument(metavar="SOURCE.nc", help="forming.nc of a run.")],
    target: Annotated[Path, typer.Argument(metavar="TARGET", help="Any mesh that meshio reads.")],
    out: Annotated[
        Path, typer.Option("--out", metavar="F", help="F.nc or F.vtu; the other is written too.")
    ],
    kind: Annotated[
        str, typer.Option(help="What the mesh is for: infiltration or structure.")
    ] = "structure",
    method: Annotated[str, typer.Option(help="Weights: overlap or closest.")] = "overlap",
    maximum_distance: Annotated[
        str | None,
        typer.Option(metavar="LENGTH", help='Farthest distance to map over, such as "2 mm".'),
    ] = None,
    length_unit: Annotated[str, typer.Option(help="Unit of the target mesh.")] = "m",
    allow_unmapped: Annotated[
        bool, typer.Option("--allow-unmapped", help="Accept cells with no sheet nearby.")
    ] = False,
) -> None:
    """Map the formed blank's fields onto another mesh."""
    from lcmchain.scene.schema import MappingTarget

    _require_choice("--kind", kind, MappingTarget)
    _require_choice("--method", method, MappingTarget)
    for file in (source, target):
        if not file.is_file():
            raise InputError("there is no such file", file=file)
    distance = None if maximum_distance is None else _length("--maximum-distance", maximum_distance)
    _length("--length-unit", f"1 {length_unit}")
    with output_folder(out.parent):
        from lcmchain.mapping import map_file

        report = map_file(
            source,
            target,
            out,
            kind=kind,
            method=method,
            maximum_distance=distance,
            length_unit=length_unit,
            allow_unmapped=allow_unmapped,
        )
    _say(report.summary())
    for warning in report.warnings:
        _warn(warning)


@fmu_app.callback()
def _fmu() -> None:
    """Package a scene as a functional mock-up unit."""


@fmu_app.command("build")
def fmu_build(
    scene: SceneFile,
    out: Annotated[Path, typer.Option("-o", "--out", metavar="F.fmu", help="The unit to write.")],
) -> None:
    """Build an FMI 2.0 co-simulation unit that forms the scene."""
    from lcmchain.scene import read_scene

    read_scene(scene)  # wrong input is told before anything is built
    if out.suffix != ".fmu":
        raise InputError("the name of a functional mock-up unit ends in .fmu", file=out)
    with output_folder(out.parent):
        from lcmchain.fmu.build import build_fmu

        build_fmu(scene, out)
    _say(f"Wrote {out}")


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
    overrides: Overrides = None,
) -> None:
    """Shear a square in a hinged frame: force along the diagonal and along the sides."""
    sizes = {"--side": side, "--shear-angle": shear_angle, "--edge-length": edge_length}
    _run_coupon("picture_frame", scene, overrides, out, sizes)


@coupon_app.command("compaction")
def coupon_compaction(
    scene: MaterialScene = None,
    out: OutFolder = None,
    pressure: Annotated[str, typer.Option(help="Pressure at the end.")] = "1.5 MPa",
    size: Annotated[str, typer.Option(help="Side length of the specimen.")] = "20 mm",
    edge_length: EdgeLength = "5 mm",
    overrides: Overrides = None,
) -> None:
    """Press a piece between plates: pressure over thickness."""
    sizes = {"--pressure": pressure, "--size": size, "--edge-length": edge_length}
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


def _run_coupon(
    name: str,
    scene: Path | None,
    overrides: list[str] | None,
    out: Path | None,
    sizes: dict[str, str],
) -> None:
    """Simulate a coupon with the options ``sizes``, write its files and print its table."""
    from importlib import import_module

    from lcmchain.scene import read_scene, scene_from_text

    values = {
        option[2:].replace("-", "_"): _quantity(option, text) for option, text in sizes.items()
    }
    if scene is None:
        the_scene = scene_from_text(COUPON_SCENE, overrides=overrides or ())
    else:
        the_scene = read_scene(scene, overrides or ())
    title = name.replace("_", "-")
    with output_folder(out or Path("results") / "coupon" / title) as folder:
        from lcmchain.coupons.result import write_coupon

        simulate = getattr(import_module(f"lcmchain.coupons.{name}"), name)
        with progress_bar() as progress:
            result = simulate(the_scene.material, the_scene.element, progress=progress, **values)
        write_coupon(folder, result)
    _console().print(result.table())
    _say(f"Results in {folder}")


@identify_app.command("shear")
def identify_shear(
    data: CouponFile,
    out: CouponFolder = None,
    length: _size("--length", "320 mm") = None,
    width: _size("--width", "160 mm") = None,
    thickness: FabricThickness = None,
    method: Annotated[
        str, typer.Option(help="force: fit the force; recursion: Eq. (22); printed: as printed.")
    ] = "force",
    convention: Annotated[
        str, typer.Option(help="Shear strain of the law: engineering or tensor.")
    ] = "engineering",
    noise_floor: NoiseFloor = 0.01,
) -> None:
    """Shear polynomial from bias-extension tests: displacement, force."""
    from lcmchain.coupons.identify_file import identify_shear_file

    sizes = {"length": length, "width": width, "thickness": thickness}
    _report_identification(
        data, out, lambda: identify_shear_file(
            data, sizes, method=method, convention=convention, noise_floor=noise_floor
        ),
    )  # fmt: skip


@identify_app.command("compaction")
def identify_compaction(
    data: CouponFile,
    out: CouponFolder = None,
    thickness: FabricThickness = None,
    areal_mass: ArealMass = None,
    fibre_density: _size("--fibre-density", "1810 kg/m^3 (MD600)") = None,
    noise_floor: NoiseFloor = 0.001,
) -> None:
    """Compaction law from plate-to-plate tests: thickness, pressure."""
    from lcmchain.coupons.identify_file import identify_compaction_file

    sizes = {"thickness": thickness, "areal_mass": areal_mass, "fibre_density": fibre_density}
    _report_identification(
        data, out, lambda: identify_compaction_file(data, sizes, noise_floor=noise_floor)
    )


@identify_app.command("bending")
def identify_bending(
    data: CouponFile,
    out: CouponFolder = None,
    thickness: FabricThickness = None,
    areal_mass: ArealMass = None,
    angle: _size("--angle", "41.5 deg") = None,
    off_axis: Annotated[
        str, typer.Option(help="Strips off the fibres: free-strip (narrow) or cylindrical (wide).")
    ] = "free-strip",
) -> None:
    """Bending stiffness from cantilever tests: orientation, overhang (or length, angle; x, y)."""
    from lcmchain.coupons.identify_file import identify_bending_file

    sizes = {"thickness": thickness, "areal_mass": areal_mass, "angle": angle}
    _report_identification(data, out, lambda: identify_bending_file(data, sizes, off_axis=off_axis))


def _report_identification(data: Path, out: Path | None, identify) -> None:
    with output_folder(out or Path("results") / data.stem) as folder:
        from lcmchain.coupons.identification_files import tables, write_identification

        result = identify()
        snippet, picture, _ = write_identification(result, folder)
    console = _console()
    for table in tables(result):
        console.print(table)
    for warning in result.warnings:
        _warn(warning)
    _say(f"For the scene file: {snippet}\nPicture of the fit: {picture}")


@verify_app.callback()
def _verify() -> None:
    """Solve problems with known solutions and compare."""


@verify_app.command("benchmarks")
def verify_benchmarks(
    full: Annotated[
        bool, typer.Option("--full", help="Finer meshes and large deformation of shells too.")
    ] = False,
    out: MarkdownFile = None,
) -> None:
    """Solve the shell benchmarks and print them beside their references."""
    from lcmchain.verification.benchmarks.table import run_benchmarks

    with progress_bar() as progress:
        report = run_benchmarks(full, progress=progress)
    for table in report.tables():
        _console().print(table)
    _write_markdown(out, report.markdown())


def _write_markdown(out: Path | None, text: str) -> None:
    if out is None:
        return
    from lcmchain.atomic import replacing

    with replacing(out) as path:
        path.write_text(text, encoding="utf-8")
    _say(f"Table in {out}")


@app.command()
def bench() -> None:
    """Measure the speed of the solver on this machine."""
    from lcmchain.bench import run_bench

    table = run_bench()
    if table is not None:
        _console().print(table)


def main(arguments: list[str] | None = None) -> None:
    """Run the command line: exit code 0 done, 2 wrong input, 1 failed run."""
    try:
        app(args=arguments)
    except LcmchainError as error:
        _print_error(str(error))
        sys.exit(error.exit_code)
    except KeyboardInterrupt:
        _print_error("stopped by the user")
        sys.exit(1)
    except OSError as error:
        # A full disk or a vanished folder is no defect of the program; a traceback would hide it.
        _print_error(f"{error.filename or 'file'}: {error.strerror or error}")
        sys.exit(1)


# --- output folder --------------------------------------------------------------------------------


def default_out(scene: Path) -> Path:
    """Name the folder of the results: ``results/`` and the name of the scene (or of its folder)."""
    name = scene.resolve().parent.name if scene.stem == "scene" else scene.stem
    return Path("results") / (name or "scene")


@contextmanager
def output_folder(folder: Path) -> Iterator[Path]:
    """Make the folder of the results and prove that it can be written to, before any work.

    When the work then finds wrong input, folders made here that are still empty are removed.

    Raises
    ------
    InputError : the folder cannot be made or written to.
    """
    made = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        _remove_empty(made)
        reason = "it is a file" if folder.is_file() else error.strerror or str(error)
        raise InputError(
            f"results cannot be written here ({reason}); name another folder with --out",
            file=folder,
        ) from None
    try:
        yield folder
    except BaseException:
        _remove_empty(made)
        raise


def _remove_empty(folders: list[Path]) -> None:
    for folder in folders:  # innermost first
        try:
            folder.rmdir()
        except OSError:
            return


# --- small helpers of the commands ----------------------------------------------------------------


@contextmanager
def progress_bar() -> Iterator:
    """Show a bar with the time left on a terminal; yields ``update(completed, total, text)``."""
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeRemainingColumn(),
    )
    console = _console(stderr=True)
    with Progress(
        *columns, console=console, transient=True, disable=not console.is_terminal
    ) as bar:
        task = bar.add_task("preparing", total=None)

        def update(completed: float, total: float, text: str = "forming") -> None:
            bar.update(task, completed=completed, total=total, description=text)

        yield update


def _length(option: str, text: str) -> float:
    from lcmchain.scene.units import LENGTH

    return _quantity(option, text, LENGTH)


def _quantity(option: str, text: str, dimension: str | None = None) -> float:
    """Return a positive quantity in SI; by default a length, pressure or angle as the option."""
    from lcmchain.scene.units import ANGLE, LENGTH, PRESSURE, QuantityError, parse_quantity

    if dimension is None:
        kinds = {"--pressure": PRESSURE, "--shear-angle": ANGLE, "--angle": ANGLE}
        dimension = kinds.get(option, LENGTH)
    try:
        value = parse_quantity(text, dimension)
    except QuantityError as error:
        raise InputError(str(error), key=option) from None
    if not value > 0.0:
        raise InputError(f"must be positive, is {text}", key=option)
    return value


def _require_choice(option: str, value: str, model) -> None:
    from typing import get_args

    choices = get_args(model.model_fields[option.lstrip("-")].annotation)
    if value not in choices:
        raise InputError(f'"{value}" must be one of {", ".join(choices)}', key=option)


def _console(*, stderr: bool = False):
    from rich.console import Console

    return Console(stderr=stderr)


def _say(message: str) -> None:
    _console().print(message, markup=False, highlight=False, soft_wrap=True)


def _warn(message: str) -> None:
    text = f"Warning: {message}"
    _console().print(text, style="yellow", markup=False, highlight=False, soft_wrap=True)


def _print_error(message: str) -> None:
    print(f"Error: {message}", file=sys.stderr)


if __name__ == "__main__":
    main()
