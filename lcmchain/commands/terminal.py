"""What the commands say on the terminal, and how they read quantities from it."""

from __future__ import annotations

import sys
import time
import warnings as warnings_module
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, get_args

from lcmchain.errors import InputError, StrictError
from lcmchain.quantities.readable import duration_text
from lcmchain.quantities.units import (
    ANGLE,
    CURVATURE,
    LENGTH,
    PRESSURE,
    SPEED,
    TIME,
    QuantityError,
    parse_quantity,
)
from lcmchain.results import ProgressLines

if TYPE_CHECKING:
    from pydantic import BaseModel
    from rich.console import Console
    from rich.table import Table

    from lcmchain.quantities.units import Dimension

# No table is as wide as that many characters.
WIDEST = 10_000


@contextmanager
def progress_bar(*, quiet: bool = False) -> Iterator:
    """Show how far the work is; yields ``update(completed, total, text)``.

    A terminal gets a bar with the time left, and in a stage without progress the time so far.
    Anything else (a log file, a pipe) gets a line per stage and one every ten seconds.
    """
    if quiet:
        yield lambda completed, total, text="": None
        return
    if not console(stderr=True).is_terminal:
        yield ProgressLines(lambda line: print(line, file=sys.stderr, flush=True))
        return
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console(stderr=True), transient=True) as bar:
        task = bar.add_task("preparing", total=None)
        stage, began, start = "", 0.0, 0.0

        def update(completed: float, total: float, text: str = "forming") -> None:
            nonlocal stage, began, start
            if text.partition(",")[0] != stage:
                stage, began, start = text.partition(",")[0], completed, time.monotonic()
            passed = time.monotonic() - start
            if completed == began and passed >= 1.0:
                text = f"{text}, since {duration_text(passed)}"
            bar.update(task, completed=completed, total=total, description=text)

        yield update


def length_of(option: str, text: str) -> float:
    """Return a positive length [m]."""
    return quantity(option, text, LENGTH)


def time_of(option: str, text: str) -> float:
    """Return a time [s], zero or later."""
    try:
        value = parse_quantity(text, TIME)
    except QuantityError as error:
        raise InputError(str(error), key=option) from None
    if value < 0.0:
        raise InputError(f"must not be negative, is {text}", key=option)
    return value


def quantity(option: str, text: str, dimension: Dimension | None = None) -> float:
    """Return a positive quantity in SI; by default of the dimension that the option has."""
    if dimension is None:
        kinds = {
            "--pressure": PRESSURE, "--shear-angle": ANGLE, "--angle": ANGLE, "--speed": SPEED,
            "--hold": TIME, "--curvature": CURVATURE,
        }  # fmt: skip
        dimension = kinds.get(option, LENGTH)
    try:
        value = parse_quantity(text, dimension)
    except QuantityError as error:
        raise InputError(str(error), key=option) from None
    if not value > 0.0:
        raise InputError(f"must be positive, is {text}", key=option)
    return value


def require_choice(option: str, value: str, model: type[BaseModel]) -> None:
    """Refuse a value that the field of a scene table named like the option does not know."""
    choices = get_args(model.model_fields[option.lstrip("-")].annotation)
    if value not in choices:
        raise InputError(f'"{value}" must be one of {", ".join(choices)}', key=option)


def console(*, stderr: bool = False) -> Console:
    """Return the terminal."""
    from rich.console import Console

    return Console(stderr=stderr)


def show_whole(table: Table) -> None:
    """Print a table of numbers without cutting any off, where it has more columns than fit too."""
    terminal = console()
    wide = terminal.options.update(max_width=WIDEST)
    terminal.width = max(terminal.width, terminal.measure(table, options=wide).maximum)
    terminal.print(table)


def say(message: str) -> None:
    """Print a line as it is."""
    console().print(message, markup=False, highlight=False, soft_wrap=True)


def warn(message: str) -> None:
    """Print a warning."""
    text = f"Warning: {message}"
    console().print(text, style="yellow", markup=False, highlight=False, soft_wrap=True)


def warn_in_groups(messages: Sequence[str]) -> None:
    """Print warnings, each once with how often it was given."""
    for message, count in Counter(messages).items():
        warn(message if count == 1 else f"{message} ({count} times)")


def require_none(warnings: Sequence[str], *, strict: bool) -> None:
    """Take warnings as an error where that was asked for.

    Raises
    ------
    StrictError : there are some, and ``strict`` is set.
    """
    if strict and warnings:
        count = f"{len(warnings)} warning{'s' if len(warnings) > 1 else ''}"
        raise StrictError(f"{count} (above), and --strict takes them as errors")


@contextmanager
def show_python_warnings() -> Iterator[None]:
    """Show warnings that the library gives in the words of the commands, on the error stream.

    Each text once: Python forgets what it has shown where anything sets its filters meanwhile.
    """
    shown: set[str] = set()
    with warnings_module.catch_warnings():

        def show(message, category, filename, lineno, file=None, line=None) -> None:
            if str(message) not in shown:
                shown.add(str(message))
                print(f"Warning: {message}", file=sys.stderr)

        warnings_module.showwarning = show
        yield


def print_error(message: str) -> None:
    """Print an error to the error stream."""
    print(f"Error: {message}", file=sys.stderr)
