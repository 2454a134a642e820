"""Scene entries that are one value, or one for each of ``times``."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Any

from lcmchain.quantities.entry_types import AbsentMeans, Row, TimeOrZero, wrong
from lcmchain.quantities.units import split_row

#: Times of the values of another entry, which are linear between them.
Times = Annotated[
    Annotated[tuple[TimeOrZero, ...], Row('"0 10 60 s"', minimum_count=2)] | None, AbsentMeans("")
]


def as_row(value: Any) -> Any:
    """Take one value as a row of one."""
    is_row = isinstance(value, str) and split_row(value) is not None
    return (value,) if isinstance(value, str | int | float) and not is_row else value


def require_times(kind: str, values: tuple[float, ...], times: tuple[float, ...] | None) -> None:
    """Refuse values over time that are not as many as their times, or times that fall.

    Raises
    ------
    PydanticCustomError : names the entry ``kind``, or the times.
    """
    count = 1 if times is None else len(times)
    if len(values) != count:
        wanted = "one value" if times is None else f"{count} values, as times has"
        raise wrong(f"needs {wanted}, but has {len(values)}", field=kind)
    if times is not None and any(b <= a for a, b in pairwise(times)):
        raise wrong("must increase from one to the next", field="times")
