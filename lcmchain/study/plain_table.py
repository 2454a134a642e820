"""Tables of studies for the terminal: many narrow columns of numbers."""

from __future__ import annotations

import math

from rich import box
from rich.table import Table
from rich.text import Text

#: Sizes below this part of one unit are shown as zero.
LEAST_SHOWN = 0.005


def plain_table(title: str, *columns: str, names: int = 1, caption: str = "") -> Table:
    """Return a table with columns of numbers behind the first ``names``, which hold words."""
    table = Table(
        title=Text(title), title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False,
        padding=(0, 1, 0, 0), caption=caption, caption_justify="left",
    )  # fmt: skip
    for k, column in enumerate(columns):
        table.add_column(column, justify="left" if k < names else "right", no_wrap=True)
    return table


def short(value: float) -> str:
    """Return a number with two digits."""
    if math.isnan(value):
        return "-"
    if abs(value) >= 100.0:
        return f"{value:.0f}"
    return "0" if abs(value) < LEAST_SHOWN else f"{value:.2g}"
