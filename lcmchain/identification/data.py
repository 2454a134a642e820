"""Coupon test data: CSV files whose header names quantity and unit of every column."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from lcmchain.errors import InputError
from lcmchain.identification.machine_export import OPTION, read_export
from lcmchain.quantities.csv_columns import (
    Column,
    Table,
    has_layout,
    means_layout,
    read_columns,
    read_table,
)

__all__ = ["Column", "CouponData", "read_coupon"]

_SPECIMEN = "specimen"
_TIME = "time"
# A loading branch may step back by this share of its range (resolution of the sensors).
_JITTER = 0.01


@dataclass(frozen=True)
class CouponData:
    """Columns of a coupon file in SI units.

    Attributes
    ----------
    file : name of the file, for messages.
    columns : values by column name, each of shape [row_count].
    lines : line of each row in the file, shape [row_count].
    specimen : number of the specimen of each row, from 0, shape [row_count].
    unused : headers of columns that nothing reads.
    names : of the specimens by their numbers; empty where a file tells none apart.
    """

    file: str
    columns: dict[str, np.ndarray]
    lines: np.ndarray
    specimen: np.ndarray
    unused: tuple[str, ...] = ()
    names: tuple[str, ...] = ()

    def __getitem__(self, name: str) -> np.ndarray:
        return self.columns[name]

    def __contains__(self, name: str) -> bool:
        return name in self.columns

    def keep(self, rows: np.ndarray) -> CouponData:
        """Return the data with only some rows, given as a mask of shape [row_count]."""
        columns = {name: values[rows] for name, values in self.columns.items()}
        return replace(self, columns=columns, lines=self.lines[rows], specimen=self.specimen[rows])

    def shifted(self, name: str, zero: np.ndarray) -> CouponData:
        """Return the data with a column that counts from another zero, shape [row_count]."""
        return replace(self, columns={**self.columns, name: self.columns[name] - zero})

    def name_of(self, row: int) -> str:
        """Return the name of the specimen of a row; its number, from 1, where it has none."""
        number = int(self.specimen[row])
        return self.names[number] if self.names else str(number + 1)

    def wrong(self, column: str, row: int, message: str) -> InputError:
        """Return an error that names file, line and column of a row."""
        return InputError(f'line {self.lines[row]}, column "{column}": {message}', file=self.file)


def read_coupon(
    path: Path | str,
    layouts: tuple[tuple[Column, ...], ...],
    *,
    minimum_rows: int = 1,
    columns: str | None = None,
) -> CouponData:
    """Read a coupon CSV file, with units in the header as in ``displacement [mm],force [N]``.

    Comma, semicolon and tab separate columns; lines before the header may begin with ``#``. A
    column ``specimen`` (a name or number, no unit) tells repeated tests in one file apart; a
    column ``time`` must rise within each specimen. Another file may be the export of a testing
    machine (:mod:`lcmchain.identification.machine_export`), whose columns must be confirmed.

    Parameters
    ----------
    path : the file. columns : what the columns of an export are, as ``"force=Standardkraft"``.
    layouts : sets of columns, of which the file must hold one; the first that fits is taken.
    minimum_rows : fewest rows that can be evaluated.

    Raises
    ------
    InputError : no such file, a missing column, no or a wrong unit, a value that is no number, too
        few rows, or a quantity that goes back; names file, line and column.
    """
    path = Path(path)
    read, layout = read_columns(
        path, layouts, minimum_rows=minimum_rows, texts=(_SPECIMEN,), plain=(_TIME,),
        table=_table(path, layouts, columns),
    )  # fmt: skip
    specimen = np.zeros(len(read.lines), dtype=int)
    names: tuple[str, ...] = ()
    if _SPECIMEN in read.texts:
        unique, specimen = np.unique(read.texts[_SPECIMEN], return_inverse=True)
        names = tuple(str(name) for name in unique)
    data = CouponData(str(path), read.columns, read.lines, specimen, read.unused, names)
    _check_order(data, layout)
    return data


def require_unlike(
    data: CouponData, values: np.ndarray, count: int, *, loads: str, places: str, test: str
) -> None:
    """Refuse data whose loads were measured at too few places for the coefficients of a law.

    Parameters
    ----------
    values : of the rows, where the loads were measured. count : of coefficients.
    loads, places, test : what they are called.

    Raises
    ------
    InputError : there are fewer unlike values than coefficients.
    """
    unlike = np.unique(values).size
    if unlike < count:
        raise InputError(
            f"holds {loads} at {unlike} unlike {places}, which do not tell the {count} "
            f"coefficients of the law; give the rows of a whole {test}",
            file=data.file,
        )


def _table(path: Path, layouts, columns: str | None) -> Table:
    """Return the cells of a file of the program's own kind, or of a machine's export."""
    try:
        table = read_table(path)
    except InputError:
        export = read_export(path, layouts, columns, also=(_TIME,)) if path.is_file() else None
        if export is None:
            raise
        return export
    if has_layout(table, layouts):
        if columns is not None:
            raise InputError(
                f"has the columns by their names already; leave out {OPTION}", file=path
            )
        return table
    meant = means_layout(table, layouts)
    return read_export(path, layouts, columns, also=(_TIME,), only_clear=meant) or table


def _check_order(data: CouponData, layout) -> None:
    for number in np.unique(data.specimen):
        rows = np.flatnonzero(data.specimen == number)
        if _TIME in data:
            back = np.flatnonzero(np.diff(data[_TIME][rows]) <= 0.0)
            if len(back):
                raise data.wrong(_TIME, rows[back[0] + 1], "does not rise; sort the rows by time")
        for column in layout:
            if column.loading == 0:
                continue
            values = column.loading * data[column.name][rows]
            behind = np.maximum.accumulate(values) - values
            back = np.flatnonzero(behind > _JITTER * np.ptp(values))
            if len(back):
                verb = "falls" if column.loading > 0 else "rises"
                raise data.wrong(
                    column.name, rows[back[0]],
                    f"{verb} again; keep only the loading branch, or tell repeated tests apart by "
                    f'a column "{_SPECIMEN}"',
                )  # fmt: skip
