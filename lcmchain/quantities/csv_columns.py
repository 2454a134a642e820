"""CSV files whose header names quantity and unit of every column, as ``force [N]``."""

from __future__ import annotations

import difflib
import io
import re
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lcmchain.errors import InputError
from lcmchain.quantities.units import (
    FRACTION,
    Dimension,
    QuantityError,
    parse_fraction,
    parse_quantity,
)
from lcmchain.text_files import decode_text

_HEADER = re.compile(r"\s*(?P<name>[^\[\]()]+?)\s*(?:[\[(]\s*(?P<unit>[^\[\]()]+?)\s*[\])])?\s*")
# What rounding leaves of the largest value where a quantity passes through zero.
_ROUNDING = 1e-12
# Far above any test: a larger file is another one, or was written at too high a rate.
MOST_BYTES = 20_000_000
MOST_COLUMNS = 200
MOST_ROWS = 20_000


@dataclass(frozen=True)
class Column:
    """A quantity that a coupon file must hold.

    Parameters
    ----------
    name : as in the header, for example ``"force"``.
    dimension : kind of quantity, which fixes the units allowed.
    loading : sign of its change while the specimen is loaded: 1 rises, -1 falls, 0 no check.
    through_zero : whether it passes through zero, so that what rounding leaves of it counts as 0.
    """

    name: str
    dimension: Dimension
    loading: int = 0
    through_zero: bool = False


@dataclass(frozen=True)
class Table:
    """Cells of a file as text.

    Attributes
    ----------
    headers : of the columns. cells : [row_count, column_count] objects.
    lines : line of each row in the file, [row_count].
    unused : headers of further columns that were left out.
    """

    headers: tuple[str, ...]
    cells: np.ndarray
    lines: np.ndarray
    unused: tuple[str, ...] = ()


@dataclass(frozen=True)
class Columns:
    """Columns of a file, and what else stands in it.

    Attributes
    ----------
    columns : values by column name in SI units, each of shape [row_count].
    texts : cells by column name, of columns without a unit that were asked for.
    lines : line of each row in the file, shape [row_count].
    unused : headers of columns that nothing reads.
    """

    columns: dict[str, np.ndarray]
    texts: dict[str, list[str]]
    lines: np.ndarray
    unused: tuple[str, ...]


def read_columns(
    path: Path,
    layouts: tuple[tuple[Column, ...], ...],
    *,
    minimum_rows: int = 1,
    texts: Sequence[str] = (),
    plain: Sequence[str] = (),
    table: Table | None = None,
) -> tuple[Columns, tuple[Column, ...]]:
    """Read a CSV file; return its columns, and the layout that it has.

    Comma, semicolon and tab separate columns; lines before the header may begin with ``#``.

    Parameters
    ----------
    path : the file.
    layouts : sets of columns, of which the file must hold one; the first that fits is taken.
    minimum_rows : fewest rows that are of use.
    texts : columns that are kept as text, where the file has them.
    plain : columns of numbers whose unit does not matter.
    table : what stands in the file, where it has been read already.

    Raises
    ------
    InputError : no such file, a missing column, no or a wrong unit, a value that is no number, or
        too few rows; names file, line and column.
    """
    table = table or read_table(path)
    headers: dict[str, tuple[int, str | None]] = {}
    for position, text in enumerate(table.headers):
        name, unit = _split_header(text)
        if name in headers:
            raise InputError(f'has two columns "{name}"; keep one', file=path)
        headers[name] = (position, unit)
    layout = _fitting_layout(layouts, headers, path)
    filled = np.array([any(cell.strip() for cell in row) for row in table.cells], dtype=bool)
    lines, cells = table.lines[filled], table.cells[filled]
    if len(lines) < minimum_rows:
        raise InputError(
            f"holds {len(lines)} rows of data; at least {minimum_rows} are needed", file=path
        )
    columns, kept, unused = {}, {}, [*table.unused]
    wanted = {column.name: column for column in layout}
    for name, (position, unit) in headers.items():
        if name in texts and name not in wanted:
            kept[name] = [str(cell).strip() for cell in cells[:, position]]
            continue
        if name not in wanted and name not in plain:
            unused.append(table.headers[position])
            continue
        factor, zero = 1.0, 0.0
        if name in wanted:
            factor, zero = _unit_scale(name, unit, wanted[name].dimension, path)
        values = _numbers(cells[:, position], name, lines, path)
        if name in wanted:
            if wanted[name].through_zero:
                values[np.abs(values) < _ROUNDING * np.max(np.abs(values), initial=0.0)] = 0.0
            _require_usual_size(values, factor, zero, wanted[name].dimension, name, lines, path)
        columns[name] = zero + factor * values
    return Columns(columns, kept, lines, tuple(unused)), layout


def read_table(path: Path) -> Table:
    """Return the cells of a CSV file.

    Raises
    ------
    InputError : no such file, another encoding than UTF-8, no CSV, or far too much of it.
    """
    import pandas

    try:
        with open(path, "rb") as opened:
            beginning = opened.read(MOST_BYTES + 1)
        if len(beginning) > MOST_BYTES:
            raise InputError(f"holds more than {MOST_BYTES // 1_000_000} MB", file=path)
        content = decode_text(beginning, path)
    except FileNotFoundError:
        raise InputError("there is no such file", file=path) from None
    except OSError as error:
        raise InputError(
            f"cannot be read ({error.strerror}); save it as CSV text", file=path
        ) from None
    text = content.splitlines()
    start = next(
        (i for i, line in enumerate(text) if line.strip() and not line.lstrip().startswith("#")),
        None,
    )
    if start is None:
        raise InputError("is empty; the first line names columns and units", file=path)
    separator = max(",;\t", key=text[start].count)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", pandas.errors.ParserWarning)  # cells that would be lost
            table = pandas.read_csv(
                io.StringIO(content), sep=separator, skiprows=start, dtype=str,
                keep_default_na=False, skip_blank_lines=False, index_col=False,
            )  # fmt: skip
    except pandas.errors.ParserWarning:
        raise InputError(
            f"has rows of more cells than its header in line {start + 1}; write decimal points, "
            "and a name above every column",
            file=path,
        ) from None
    except (pandas.errors.ParserError, pandas.errors.EmptyDataError) as error:
        raise InputError(f"cannot be read as CSV: {str(error).strip()}", file=path) from None
    if len(table.columns) > MOST_COLUMNS or len(table) > MOST_ROWS:
        raise InputError(
            f"has {len(table.columns):,} columns and {len(table):,} rows; at most "
            f"{MOST_COLUMNS} and {MOST_ROWS:,} are read, so that the fit ends in a moment",
            file=path,
        )
    # Short rows come back with not-a-number in the missing cells.
    cells = table.fillna("").to_numpy()
    return Table(
        tuple(str(text) for text in table.columns), cells, start + 2 + np.arange(len(table))
    )


def has_layout(table: Table, layouts: Sequence[Sequence[Column]]) -> bool:
    """Tell whether a table has all columns of a layout, by the names in its header."""
    names = {_split_header(text)[0] for text in table.headers}
    return any(all(column.name in names for column in layout) for layout in layouts)


def means_layout(table: Table, layouts: Sequence[Sequence[Column]]) -> bool:
    """Tell whether a header has a column of a layout, or a name much like one."""
    wanted = {column.name for layout in layouts for column in layout}
    names = [_split_header(text)[0] for text in table.headers]
    return any(difflib.get_close_matches(name, wanted, n=1, cutoff=0.8) for name in names)


def _split_header(text: str) -> tuple[str, str | None]:
    match = _HEADER.fullmatch(text)
    if match is None:
        return text.strip().lower(), None
    return match["name"].lower().replace("_", " "), match["unit"]


def _fitting_layout(
    layouts: Sequence[tuple[Column, ...]], headers: Mapping[str, tuple[int, str | None]], path: Path
) -> tuple[Column, ...]:
    """Return the first layout that a header has.

    Raises
    ------
    InputError : it has none of them.
    """
    for layout in layouts:
        if all(column.name in headers for column in layout):
            return layout
    # The layout that misses the fewest columns is the one that was meant.
    layout = min(layouts, key=lambda columns: sum(c.name not in headers for c in columns))
    missing = next(column for column in layout if column.name not in headers)
    close = difflib.get_close_matches(missing.name, headers, n=1, cutoff=0.5)
    hint = f'; did you mean "{close[0]}"?' if close else ""
    examples = " or ".join(
        '"' + ",".join(f"{c.name} [{c.dimension.common_units[0]}]" for c in columns) + '"'
        for columns in layouts
    )
    raise InputError(
        f'has no column "{missing.name}"{hint} (the header must read {examples})', file=path
    )


def _unit_scale(
    name: str, unit: str | None, dimension: Dimension, path: Path
) -> tuple[float, float]:
    """Return factor and offset of a unit: a value in SI units is offset + factor times it."""
    if dimension is FRACTION:
        try:
            return parse_fraction(f"1 {unit or ''}"), 0.0
        except QuantityError:
            raise InputError(
                f'column "{name}": "{unit}" is no unit of a fraction; write "{name} [%]", or '
                f'"{name} [1]"',
                file=path,
            ) from None
    if unit is None:
        raise InputError(
            f'column "{name}" has no unit; write for example "{name} [{dimension.common_units[0]}]"'
            " in the header",
            file=path,
        )
    try:
        zero = parse_quantity(f"0 {unit}", dimension)
        if zero == 0.0:
            return parse_quantity(f"1 {unit}", dimension), 0.0
        return parse_quantity(f"1 {unit}", dimension) - zero, zero
    except QuantityError as error:
        raise InputError(f'column "{name}": {error}', file=path) from None


def _numbers(cells: np.ndarray, name: str, lines: np.ndarray, path: Path) -> np.ndarray:
    values = np.empty(len(cells))
    for row, cell in enumerate(cells):
        try:
            values[row] = float(cell)
        except ValueError:
            values[row] = np.nan
        if not np.isfinite(values[row]):
            shown = f'"{cell.strip()}" is not a finite number' if cell.strip() else "has no value"
            hint = "; write a decimal point" if re.search(r"\d,\d", cell) else ""
            raise InputError(
                f'line {lines[row]}, column "{name}": {shown}{hint or "; remove or complete it"}',
                file=path,
            )
    return values


def _require_usual_size(
    values: np.ndarray,
    factor: float,
    zero: float,
    dimension: Dimension,
    name: str,
    lines: np.ndarray,
    path: Path,
) -> None:
    """Refuse a value that no test has; in SI units it is ``zero`` + ``factor`` times it."""
    with np.errstate(over="ignore"):
        size = np.abs(zero + factor * values)
    wrong = np.flatnonzero(
        (size > dimension.largest) | ((0.0 < size) & (size < dimension.smallest))
    )
    if len(wrong):
        row = wrong[0]
        raise InputError(
            f'line {lines[row]}, column "{name}": {values[row]:g} is '
            f"{dimension.complaint(float(size[row]))}; remove or correct it",
            file=path,
        )
