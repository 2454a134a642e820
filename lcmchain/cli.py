"""The commands of lcmchain. They parse, call, and report; the work is done elsewhere."""

from __future__ import annotations

import gc
import sys
from typing import Annotated

import typer

from lcmchain.commands.after_forming import fill, map_fields, structure
from lcmchain.commands.cosim import cosim, precice
from lcmchain.commands.coupon import coupon_app, identify_app
from lcmchain.commands.docs import docs, schema
from lcmchain.commands.fmu import fmu_app
from lcmchain.commands.new import import_app, new_app
from lcmchain.commands.pattern import pattern_app
from lcmchain.commands.run import check, run
from lcmchain.commands.study import study_app
from lcmchain.commands.terminal import print_error, say, show_python_warnings
from lcmchain.commands.verify import bench, verify_app
from lcmchain.errors import LcmchainError, UnfinishedRun

# Nothing heavy is imported up here: `lcmchain --help` must answer at once.

# The collector of garbage starts after so many new objects. With Python's default, a start of the
# program would spend a fifth of its time on collections among what imported packages have made.
OBJECTS_PER_COLLECTION = 100_000

#: What typer ends with, without a word, where the user interrupts a command.
CODE_OF_INTERRUPT = 130

app = typer.Typer(
    name="lcmchain",
    help="Forming simulation of engineering textiles, and the chain of stages that follows it.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["--help", "-h"]},
)
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


app.command()(run)
app.command()(check)
app.command()(schema)
app.command("map")(map_fields)
app.command()(fill)
app.command()(structure)
app.command()(precice)
app.command()(cosim)
app.command()(bench)
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
