"""The commands of lcmchain. They parse, call, and report; the work is done elsewhere."""

from __future__ import annotations

import gc
import json
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from lcmchain.atomic import replacing
from lcmchain.commands.cosim import cosim
from lcmchain.commands.coupon import coupon_app
from lcmchain.commands.docs import docs
from lcmchain.commands.fill import fill
from lcmchain.commands.fmu_doctor import doctor
from lcmchain.commands.fmu_infiltration import (
    EntryName,
    Interface,
    Motion,
    NeedsTool,
    Source,
    SourceUnit,
    build_infiltration,
    interface_of,
)
from lcmchain.commands.folders import default_out, output_folder
from lcmchain.commands.identify import identify_app
from lcmchain.commands.import_case import import_app
from lcmchain.commands.map import map_fields
from lcmchain.commands.new import new_app
from lcmchain.commands.options import ModelRung, OutFolder, Overrides, SceneFile, Strict
from lcmchain.commands.pattern import pattern_app
from lcmchain.commands.precice import precice
from lcmchain.commands.run_report import print_result
from lcmchain.commands.structure import structure
from lcmchain.commands.study import study_app
from lcmchain.commands.terminal import (
    console,
    print_error,
    progress_bar,
    require_none,
    say,
    show_python_warnings,
    show_whole,
    warn,
)
from lcmchain.commands.verify import verify_app
from lcmchain.errors import (
    InputError,
    LcmchainError,
    MappingError,
    SimulationInterrupted,
    UnfinishedRun,
)

# Nothing heavy is imported up here: `lcmchain --help` must answer at once.

# So many more objects than there were start a search for garbage. By default a start would spend
# a fifth of its time on searches among what imported packages have made.
OBJECTS_PER_COLLECTION = 100_000

#: What typer ends with, without a word, where the user interrupts a command.
CODE_OF_INTERRUPT = 130

app = typer.Typer(
    name="lcmchain",
    help="Forming simulation of engineering textiles, and the chain of stages that follows it.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
fmu_app = typer.Typer(no_args_is_help=True, help="Package a scene as a functional mock-up unit.")
app.add_typer(fmu_app, name="fmu")
app.add_typer(new_app, name="new")
app.add_typer(coupon_app, name="coupon")
app.add_typer(identify_app, name="identify")
app.add_typer(import_app, name="import")
app.add_typer(verify_app, name="verify")
app.add_typer(study_app, name="study")
app.add_typer(pattern_app, name="pattern")


def _show_version(asked: bool) -> None:
    if asked:
        from lcmchain.provenance import versions

        for line in versions():
            say(line)
        raise typer.Exit


@app.callback()
def _lcmchain(
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_show_version, is_eager=True, help="Show versions and exit."
        ),
    ] = False,
) -> None:
    """Forming simulation of engineering textiles, and the chain of stages that follows it."""


@app.command()
def run(
    scene: SceneFile,
    out: OutFolder = None,
    threads: Annotated[
        int | None,
        typer.Option(
            "--threads",
            min=1,
            metavar="N",
            help="Number of threads; default all cores, one for a small mesh.",
        ),
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on from the last checkpoint in DIR.")
    ] = False,
    until_stage: Annotated[
        str | None,
        typer.Option(
            metavar="NAME", help="End with this stage; the same command with --resume goes on."
        ),
    ] = None,
    start_from: Annotated[
        Path | None,
        typer.Option(
            "--from",
            metavar="RESULTS",
            help="Go on from a run that ended with a stage, with other stages behind it.",
        ),
    ] = None,
    model: ModelRung = None,
    within: Annotated[
        str | None,
        typer.Option(
            metavar="ERRORS",
            help='Choose mesh and process time for these errors: "1 deg shear, 1 % thickness".',
        ),
    ] = None,
    budget: Annotated[
        str | None,
        typer.Option(metavar="TIME", help='Choose the mesh for this solver time, such as "20 s".'),
    ] = None,
    overrides: Overrides = None,
    strict: Strict = False,
    quiet: Annotated[
        bool, typer.Option("--quiet", "-q", help="Say nothing but warnings and errors.")
    ] = False,
) -> None:
    """Form the blank, and map its fields to the meshes that the scene names."""
    if within is not None or budget is not None:
        for option, given in (("--until-stage", until_stage), ("--from", start_from)):
            if given is not None:
                raise InputError(
                    "belongs to the run of a scene; leave out --within and --budget", key=option
                )
        from lcmchain.commands.run_chosen import run_chosen

        run_chosen(
            scene, out, within, budget, overrides or (),
            model=model, threads=threads, resume=resume, strict=strict, quiet=quiet,
        )  # fmt: skip
        return
    the_scene = _scene_on_rung(scene, overrides, model)
    with output_folder(out or default_out(scene)) as folder:
        from lcmchain.pipeline import run as run_scene

        try:
            with progress_bar(quiet=quiet) as progress:
                result = run_scene(
                    the_scene, folder, threads=threads, resume=resume, until_stage=until_stage,
                    start_from=start_from, progress=progress,
                )  # fmt: skip
        except KeyboardInterrupt:
            # In the steps it is a request; here it came while fields are written, drawn or mapped.
            from lcmchain.solver.checkpoint import FILE_NAME

            if not (folder / FILE_NAME).exists():
                raise
            raise SimulationInterrupted(
                f"stopped by the user; the same command with --resume goes on from {folder}"
            ) from None
        except (MappingError, UnfinishedRun) as error:
            if error.result is not None:
                print_result(error.result.summary, folder, quiet=quiet)
            raise
    warnings = print_result(result.summary, folder, quiet=quiet)
    require_none(warnings, strict=strict)


@app.command()
def check(
    scene: SceneFile,
    out: OutFolder = None,
    model: ModelRung = None,
    overrides: Overrides = None,
    full: Annotated[
        bool,
        typer.Option(
            "--full", help="Also list all entries and defaults, and every effect with its reason."
        ),
    ] = False,
    strict: Strict = False,
) -> None:
    """Show gaps, cost, memory and warnings, and with --full what is simulated and why."""
    the_scene = _scene_on_rung(scene, overrides, model)
    with output_folder(out or default_out(scene), inputs=[scene]) as folder:
        from lcmchain.check import check_scene
        from lcmchain.check.tables import active_in_words
        from lcmchain.pipeline import require_readable_targets

        require_readable_targets(the_scene)
        report = check_scene(the_scene, folder)
    terminal = console()
    for table in report.first_tables():
        terminal.print(table)
    for warning in report.warnings:
        warn(warning)
    if full:
        for table in report.further_tables():
            terminal.print(table)
    else:
        say(f"Simulated: {active_in_words(report.effects)}")
        say("--full lists every effect with its reason, all entries, and what was defaulted")
    say(f"Picture of the start: {report.picture}")
    require_none(report.warnings, strict=strict)


def _scene_on_rung(path: Path, overrides: list[str] | None, model: str | None) -> Any:
    """Read a scene, on another rung of the model ladder where one is asked for."""
    from lcmchain.scene import on_rung, read_scene

    scene = read_scene(path, overrides or ())
    return scene if model is None else on_rung(scene, model)


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
    with output_folder(out.parent), replacing(out) as path:
        path.write_text(text, encoding="utf-8")


app.command("map")(map_fields)
fmu_app.command()(doctor)
app.command()(fill)
app.command()(structure)
app.command()(precice)
app.command()(cosim)


@fmu_app.callback()
def _fmu() -> None:
    """Package a scene as a functional mock-up unit."""


@fmu_app.command("build")
def fmu_build(
    scene: SceneFile,
    out: Annotated[Path, typer.Option("-o", "--out", metavar="F.fmu", help="The unit to write.")],
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
        build_infiltration(
            scene, out, source, fmi=fmi, fields=names,
            interface=interface_of(interface, part), motion=motion,
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
            patches = interface_of(interface, part)
            options = {"fields": names, "pore_pressure": pore_pressure, "interface": patches}
        build_fmu(
            scene, out, fmi=fmi, part=part, overrides=overrides or (), needs_tool=needs_tool,
            **options,
        )  # fmt: skip
    say(f"Wrote {out}")


@app.command()
def bench(
    mapping: Annotated[
        bool, typer.Option("--mapping", help="Of the mapping, beside medcoupling if it is there.")
    ] = False,
    filling: Annotated[
        bool, typer.Option("--filling", help="Of the infiltration, over the size of the mesh.")
    ] = False,
    unit: Annotated[
        bool, typer.Option("--unit", help="Of co-simulation units, beside the solver alone.")
    ] = False,
    sizes: Annotated[
        bool, typer.Option("--sizes", help="Of free plates, over the number of elements.")
    ] = False,
    parts: Annotated[bool, typer.Option("--parts", help="Of each part of a step alone.")] = False,
    effects: Annotated[
        bool, typer.Option("--effects", help="Of a step with each effect and without it.")
    ] = False,
    stacks: Annotated[
        bool, typer.Option("--stacks", help="Of stacks of plies, and of what an interface costs.")
    ] = False,
    laws: Annotated[
        bool, typer.Option("--laws", help="Of the element kernel, by what a fabric's law knows.")
    ] = False,
    peers: Annotated[
        bool, typer.Option("--peers", help="Beside CalculiX and Kratos, where they are installed.")
    ] = False,
    json_file: Annotated[
        Path | None,
        typer.Option("--json", metavar="FILE", help="Also write the solver's figures here."),
    ] = None,
) -> None:
    """Measure the speed of the solver, the mapping, the infiltration or units on this machine."""
    if unit:
        from lcmchain.fmu.benchmark import run_unit_bench

        show_whole(run_unit_bench())
        return
    if filling:
        from lcmchain.coupling.infiltration.benchmark import run_filling_bench

        show_whole(run_filling_bench())
        return
    if mapping:
        from lcmchain.mapping.benchmark import run_mapping_bench

        show_whole(run_mapping_bench())
        return
    if parts:
        from lcmchain.bench import run_part_bench

        show_whole(run_part_bench(json_file))
        return
    if effects:
        from lcmchain.bench import run_effect_bench

        show_whole(run_effect_bench(json_file))
        return
    if stacks:
        from lcmchain.bench import run_stack_bench

        show_whole(run_stack_bench(json_file))
        return
    if laws:
        from lcmchain.bench import run_law_bench

        show_whole(run_law_bench(json_file))
        return
    if peers:
        from lcmchain.bench.peers import run_peer_bench

        show_whole(run_peer_bench(json_file))
        return
    from lcmchain.bench import run_bench, run_size_bench

    show_whole(run_size_bench(json_file) if sizes else run_bench(json_file))


app.command()(docs)


def _end_interrupted() -> None:
    print_error("stopped by the user")
    sys.exit(1)


def main(arguments: list[str] | None = None) -> None:
    """Run the command line: exit code 0 done, 2 wrong input, 1 failed run."""
    gc.set_threshold(OBJECTS_PER_COLLECTION)
    try:
        with show_python_warnings():
            app(args=arguments)
    except LcmchainError as error:
        where = error.where if isinstance(error, UnfinishedRun) else ""
        print_error(f"{error}. {where}" if where else str(error))
        sys.exit(error.exit_code)
    except KeyboardInterrupt:
        _end_interrupted()
    except SystemExit as ended:
        if ended.code != CODE_OF_INTERRUPT:
            raise
        _end_interrupted()
    except OSError as error:
        # A full disk or a vanished folder is no defect of the program; a traceback would hide it.
        print_error(f"{error.filename or 'file'}: {error.strerror or error}")
        sys.exit(1)


if __name__ == "__main__":
    main()
