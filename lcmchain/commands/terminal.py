"""What the commands say on the terminal, and how they read quantities from it."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from lcmchain.errors import InputError

if TYPE_CHECKING:
    from pydantic import BaseModel
    from rich.console import Console

    from lcmchain.quantities.units import Dimension


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
    terminal = console(stderr=True)
    with Progress(
        *columns, console=terminal, transient=True, disable=not terminal.is_terminal
    ) as bar:
        task = bar.add_task("preparing", total=None)

        def update(completed: float, total: float, text: str = "forming") -> None:
            bar.update(task, completed=completed, total=total, description=text)

        yield update


def length_of(option: str, text: str) -> float:
    """Return a positive length [m]."""
    from lcmchain.quantities.units import LENGTH

    return quantity(option, text, LENGTH)


def quantity(option: str, text: str, dimension: Dimension | None = None) -> float:
    """Return a positive quantity in SI; by default a length, pressure or angle as the option."""
    from lcmchain.quantities.units import ANGLE, LENGTH, PRESSURE, QuantityError, parse_quantity

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


def require_choice(option: str, value: str, model: type[BaseModel]) -> None:
    """Refuse a value that the field of a scene table named like the option does not know."""
    from typing import get_args

    choices = get_args(model.model_fields[option.lstrip("-")].annotation)
    if value not in choices:
        raise InputError(f'"{value}" must be one of {", ".join(choices)}', key=option)


def console(*, stderr: bool = False) -> Console:
    """Return the terminal."""
    from rich.console import Console

    return Console(stderr=stderr)


def say(message: str) -> None:
    """Print a line as it is."""
    console().print(message, markup=False, highlight=False, soft_wrap=True)


def warn(message: str) -> None:
    """Print a warning."""
    text = f"Warning: {message}"
    console().print(text, style="yellow", markup=False, highlight=False, soft_wrap=True)


def print_error(message: str) -> None:
    """Print an error to the error stream."""
    print(f"Error: {message}", file=sys.stderr)
