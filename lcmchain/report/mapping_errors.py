"""The table of the errors that a mapping adds to its fields."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.table import Table

#: Units in which errors are read more easily than in SI, and what to multiply them by.
READ_IN = {"m": ("mm", 1e3), "rad": ("°", 57.29577951308232), "Pa": ("kPa", 1e-3)}


def error_table(verification: Mapping[str, Mapping[str, Any]]) -> Table:
    """Return one row a field: largest and root-mean-square error, and change there and back."""
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, title="Error that the mapping adds",
                  title_justify="left")  # fmt: skip
    table.add_column("field", no_wrap=True)
    for heading in ("largest", "cell", "rms", "there and back"):
        table.add_column(heading, justify="right")
    for name, found in verification.items():
        table.add_row(
            name,
            in_words(found["worst"], found["units"]),
            str(found["worst_cell"]),
            in_words(found["root_mean_square"], found["units"]),
            in_words(found["there_and_back"], found["units"]),
        )
    return table


def in_words(value: float | None, units: str) -> str:
    """Write an error with its unit, lengths in mm, angles in degrees, pressures in kPa."""
    if value is None:
        return ""
    unit, factor = READ_IN.get(units, (units if units != "1" else "", 1.0))
    return f"{factor * value:.2g} {unit}".strip()
