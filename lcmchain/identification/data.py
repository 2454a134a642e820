"""Coupon test data: the program's own CSV files, and exports as testing machines write them.

The header of an own file names quantity and unit of every column. An export has lines about the
test, a row of names in the language of the machine, units in the names or in a row of their own,
and numbers with a decimal point or comma. Several specimens stand side by side or below each other.
Text in UTF-8, UTF-16 or Windows-1252 and workbooks (.xlsx) are read. The meaning of a name is
recognised by words of six languages. It counts once the user has confirmed it: a wrong column would
give a fit that looks right.
"""

from __future__ import annotations

import codecs
import csv
import io
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lcmchain.errors import InputError
from lcmchain.quantities.csv_columns import (
    MOST_BYTES,
    Column,
    Table,
    has_layout,
    means_layout,
    read_columns,
    read_table,
)
from lcmchain.quantities.units import FRACTION, QuantityError, parse_quantity

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
    machine, whose columns must be confirmed.

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


# --- exports of testing machines ------------------------------------------------------------------

#: The option that confirms what the columns of an export are.
OPTION = "--columns"

# Words in names of columns: English, German, French, Spanish, Italian, Dutch.
WORDS = {
    "displacement": "displacement extension crosshead stroke position travel weg verschiebung "
    "traverse verlängerung déplacement course allongement desplazamiento carrera spostamento corsa "
    "verplaatsing",
    "force": "force load kraft last charge effort fuerza carga forza carico kracht",
    "time": "time zeit temps tiempo tempo tijd",
    "speed": "speed velocity geschwindigkeit vitesse velocidad velocità snelheid",
    "temperature": "temperature temperatur température temperatura temperatuur",
    "thickness": "thickness gap dicke spalt épaisseur entrefer espesor spessore dikte",
    "pressure": "pressure stress druck spannung pression contrainte presión pressione druk",
    "fibre volume fraction": "fraction volumenanteil faservolumengehalt fvg fvf vf",
    "shear angle": "shear scher schub cisaillement cizalladura cizallamiento taglio afschuif",
    "shear stress": "shear schub scher cisaillement cizalladura cizallamiento taglio afschuif",
    "angle": "angle winkel ángulo angolo hoek",
    "curvature": "curvature krümmung courbure curvatura kromming",
    "moment": "moment biegemoment momento",
    "orientation": "orientation orientierung faserrichtung orientación orientamento oriëntatie",
    "overhang": "overhang überhang überhanglänge surplomb voladizo sbalzo overstek",
    "length": "length länge longueur longitud lunghezza lengte",
}
_UNITS = frozenset(
    "mm cm m µm um in in. inch n kn mn cn gf kgf lbf s sec sek sek. ms min pa kpa mpa bar psi "
    "n/mm² n/mm2 n/mm^2 kn/m² ° deg rad °c degc k mm/min mm/s m/s % 1/m 1/cm 1/mm n*m/m gf*cm/cm "
    "-".split()
)
# Units that the reader of units spells in another way.
_SPELLINGS = {
    "in.": "inch", "sec": "s", "sek": "s", "sek.": "s", "n/mm²": "N/mm^2", "kn/m²": "kN/m^2",
    "°": "deg", "°c": "degC",
}  # fmt: skip
_NUMBER = re.compile(r"[-+]?(\d[\d.,']*|[.,]\d+)(e[-+]?\d+)?", re.IGNORECASE)
_UNIT_BEHIND = re.compile(
    r"(?P<name>.*?\S)\s*(?:[\[(<](?P<boxed>[^\[\]()<>]*)[\])>]|(?:[,/]|\bin\b|\ben\b|\s)\s*(?P<bare>\S+))\s*"
)
_WORKBOOK, _OLD_WORKBOOK = b"PK\x03\x04", b"\xd0\xcf\x11\xe0"
# Lines between names and numbers, at most, with units or without anything.
_LINES_BETWEEN = 3
# A table has at least so many rows of numbers.
_LEAST_ROWS = 3


class Specimen(NamedTuple):
    """What an export has of a specimen; all of an export have the same columns.

    names, units : of the columns; the unit "" where none stands.
    rows : of cells, [row_count][column_count]. lines : of each row in the file.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    lines: tuple[int, ...]


def read_export(
    path: Path,
    layouts: Sequence[Sequence[Column]],
    confirmed: str | None,
    *,
    also: Sequence[str] = (),
    only_clear: bool = False,
) -> Table | None:
    """Return the table of a machine's export as the program's own; None for another file.

    Parameters
    ----------
    layouts : sets of columns, of which one is wanted. also : further columns that are taken if
        they are there.
    confirmed : what each column is, as ``"force=Standardkraft,displacement=Standardweg"``.
    only_clear : return None as well where nothing is confirmed and not all columns are recognised.

    Raises
    ------
    InputError : columns that nobody has confirmed, with what they seem to be; names that are not
        there; numbers that can be read in two ways; an old workbook.
    """
    specimens = find_specimens(grid_of(path), path)
    if not specimens:
        return None
    proposals = [_recognised(specimens[0], layout, also) for layout in layouts]
    if confirmed is None:
        clear = _clear(layouts, proposals)
        if clear is None and (only_clear or not any(map(_any_name, proposals))):
            return None
        if clear is not None and all(places == [name] for name, places in clear.items() if places):
            return None  # names of the program's own: something else is wrong with the file
        raise InputError(_question(specimens, layouts, proposals, clear), file=path)
    chosen = _confirmed(specimens, confirmed, path)
    return _own_table(specimens, chosen, path)


# --- cells of an export ---------------------------------------------------------------------------


def grid_of(path: Path) -> list[list[str]]:
    """Return the cells of a text or workbook, row by row from line 1 on."""
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror})", file=path) from None
    if len(content) > MOST_BYTES:
        raise InputError(f"holds more than {MOST_BYTES // 1_000_000} MB", file=path)
    if content.startswith(_OLD_WORKBOOK):
        raise InputError("is an old workbook (.xls); save it as .xlsx or as text", file=path)
    if content.startswith(_WORKBOOK):
        return _workbook(path)
    lines = _text(content).splitlines()
    grids = [list(csv.reader(lines, delimiter=separator)) for separator in "\t;,|"]
    grids.append([re.split(r"\s{2,}|\t", line.strip()) for line in lines])
    grids.append([line.split() for line in lines])
    # cut at decimal commas, a row would have fewer numbers: what stands between is none
    best = max(grids, key=lambda grid: sum(_counts(row)[0] for row in grid if _is_data(row)))
    return [[cell.strip() for cell in row] for row in best]


def _text(content: bytes) -> str:
    """Return the text of an export, by its mark, else in UTF-8, else in Windows-1252."""
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return content.decode("utf-16", errors="replace")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("cp1252", errors="replace")


def _workbook(path: Path) -> list[list[str]]:
    """Return the cells of the first sheet of a workbook that has a table."""
    try:
        import openpyxl  # type: ignore[import-untyped]
    except ImportError:
        raise InputError(
            'is a workbook, which needs openpyxl: pip install "lcmchain[excel]"; or save it as CSV',
            file=path,
        ) from None
    sheets = []
    book = openpyxl.load_workbook(io.BytesIO(path.read_bytes()), read_only=True, data_only=True)
    for sheet in book.worksheets:
        rows = [["" if cell is None else str(cell).strip() for cell in row]
                for row in sheet.iter_rows(values_only=True)]  # fmt: skip
        sheets.append(rows)
    return max(sheets, key=lambda rows: sum(_is_data(row) for row in rows), default=[])


def _is_data(row: Sequence[str]) -> bool:
    """Tell whether a row holds numbers: two at least, and half of what is there."""
    numbers, texts = _counts(row)
    return numbers >= 2 and numbers >= texts


def _counts(row: Sequence[str]) -> tuple[int, int]:
    """Return how many cells of a row are numbers, and how many are something else."""
    filled = [cell.strip() for cell in row if cell.strip()]
    numbers = sum(_NUMBER.fullmatch(cell) is not None for cell in filled)
    return numbers, len(filled) - numbers


# --- specimens of an export -----------------------------------------------------------------------


def find_specimens(grid: list[list[str]], path: Path) -> list[Specimen]:
    """Return the specimens in the cells of an export; none where rows of numbers have no names."""
    blocks, start = [], None
    for i, row in enumerate([*grid, []]):
        if _is_data(row):
            start = i if start is None else start
        elif start is not None:
            if i - start >= _LEAST_ROWS:
                blocks.append((start, i))
            start = None
    found: list[Specimen] = []
    for begin, end in blocks:
        header = _header_above(grid, begin)
        if header is not None:
            found += _side_by_side(header, grid, begin, end)
    for one in found:
        if one.names != found[0].names:
            raise InputError(
                f"has tables of unlike columns ({', '.join(found[0].names)}; line "
                f"{one.lines[0] - 1}: {', '.join(one.names)}); keep one kind",
                file=path,
            )
    return found


def _header_above(grid, begin) -> tuple[list[str], list[str]] | None:
    """Return names and units of the columns whose numbers begin in a row."""
    units: list[str] = []
    for i in range(begin - 1, max(begin - 2 - _LINES_BETWEEN, -1), -1):
        row = grid[i]
        filled = [cell for cell in row if cell]
        if not filled or _is_data(row):
            continue
        if not units and all(_unboxed(cell).lower() in _UNITS for cell in filled):
            units = [_unboxed(cell) for cell in row]
            continue
        if len(filled) < 2:
            continue
        width = len(grid[begin])
        row = (row + [""] * width)[:width]
        if units:
            return row, (units + [""] * width)[:width]
        both = [_split(cell) for cell in row]
        return [name for name, _ in both], [unit for _, unit in both]
    return None


def _unboxed(cell: str) -> str:
    return cell.strip().strip("[]()<>").strip()


def _split(cell: str) -> tuple[str, str]:
    """Return name and unit of a header as ``Kraft [N]``, ``Load (N)``, ``Kraft in N``."""
    match = _UNIT_BEHIND.fullmatch(cell.replace("\n", " "))
    if match is not None:
        unit = (match["boxed"] if match["boxed"] is not None else match["bare"]).strip()
        if match["boxed"] is not None or unit.lower() in _UNITS:
            return match["name"].strip().rstrip(",/").strip(), unit
    return cell.strip(), ""


def _side_by_side(header, grid, begin, end) -> list[Specimen]:
    """Return the specimens of a block of rows: columns whose names repeat are one each."""
    names, units = header
    used = [k for k, name in enumerate(names) if name]
    texts = [names[k].lower() for k in used]
    period = next(
        p for p in range(1, len(texts) + 1)
        if len(texts) % p == 0 and all(text == texts[k % p] for k, text in enumerate(texts))
    )  # fmt: skip
    found = []
    for first in range(0, len(used), period):
        columns = used[first : first + period]
        rows = [tuple((row + [""] * len(names))[k] for k in columns) for row in grid[begin:end]]
        kept = [i for i, row in enumerate(rows) if any(row)]
        found.append(
            Specimen(
                tuple(names[k] for k in columns), tuple(units[k] for k in columns),
                tuple(rows[i] for i in kept), tuple(begin + 1 + i for i in kept),
            )
        )  # fmt: skip
    return found


# --- meaning of the columns of an export ----------------------------------------------------------


def _recognised(
    specimen: Specimen, layout: Sequence[Column], also: Sequence[str]
) -> dict[str, list[str]]:
    """Return the names that may be each column of a layout, by their words and units."""
    found: dict[str, list[str]] = {}
    for column in layout:
        words = WORDS.get(column.name, column.name).split()
        found[column.name] = [
            name for name, unit in zip(specimen.names, specimen.units)
            if any(word in name.lower() for word in words) and _has_dimension(unit, column)
        ]  # fmt: skip
    for name in also:
        words = WORDS.get(name, name).split()
        found[name] = [
            heading for heading in specimen.names if any(w in heading.lower() for w in words)
        ][:1]
    return found


def _has_dimension(unit: str, column: Column) -> bool:
    if column.dimension is FRACTION:
        return unit in ("", "-", "1", "%")
    try:
        parse_quantity(f"1 {_spelled(unit)}", column.dimension)
    except QuantityError:
        return False
    return True


def _spelled(unit: str) -> str:
    return _SPELLINGS.get(unit.lower(), unit)


def _any_name(found: Mapping[str, list[str]]) -> bool:
    """Tell whether a column is recognised."""
    return any(found.values())


def _clear(layouts, proposals) -> dict[str, list[str]] | None:
    """Return what is recognised of the first layout whose columns are one name each."""
    for layout, found in zip(layouts, proposals, strict=True):
        if all(len(found[column.name]) == 1 for column in layout):
            return found
    return None


def _question(specimens, layouts, proposals, clear) -> str:
    """Say what the columns of an export seem to be, and how to confirm it."""
    there = ", ".join(
        f'"{name}"' + (f" [{unit}]" if unit else "")
        for name, unit in zip(specimens[0].names, specimens[0].units) if name
    )  # fmt: skip
    said = f"is an export of a testing machine with {len(specimens)} specimen(s): {there}. "
    if clear is not None:
        option = ",".join(f"{name}={places[0]}" for name, places in clear.items() if places)
        return said + f'If these are what is wanted, confirm by {OPTION} "{option}"'
    layout, found = min(
        zip(layouts, proposals),
        key=lambda both: sum(len(both[1][column.name]) != 1 for column in both[0]),
    )
    open_ones = []
    for column in layout:
        headings = found[column.name]
        if len(headings) != 1:
            seems = f"may be {' or '.join(headings)}" if headings else "is not recognised"
            open_ones.append(f"{column.name} [{column.dimension.common_units[0]}] {seems}")
    example = ",".join(f"{column.name}=NAME" for column in layout)
    return said + f'{"; ".join(open_ones)}: say which they are by {OPTION} "{example}"'


def _confirmed(specimens: Sequence[Specimen], text: str, path: Path) -> dict[str, int]:
    """Return the place of every column that a user names."""
    chosen = {}
    for part in filter(None, (part.strip() for part in text.split(","))):
        quantity, equals, name = (piece.strip() for piece in part.partition("="))
        places = [k for k, one in enumerate(specimens[0].names) if one.lower() == name.lower()]
        if not equals or not quantity or len(places) != 1:
            there = ", ".join(name for name in specimens[0].names if name)
            raise InputError(
                f'{OPTION} has "{part}"; write COLUMN=NAME with one of the names {there}', file=path
            )
        chosen[quantity.lower()] = places[0]
    return chosen


def _own_table(specimens: Sequence[Specimen], chosen: Mapping[str, int], path: Path) -> Table:
    """Return the chosen columns as a table of the program's own."""
    first, headers, columns = specimens[0], [], []
    for name, place in chosen.items():
        unit = _spelled(first.units[place])
        headers.append(f"{name} [{unit}]" if unit else name)
        cells = [row[place] for one in specimens for row in one.rows]
        columns.append(_with_points(cells, first.names[place], path))
    headers.append("specimen")
    columns.append([f"{n:06d}" for n, one in enumerate(specimens, 1) for _ in one.rows])
    lines = np.array([line for one in specimens for line in one.lines])
    left = tuple(name for place, name in enumerate(first.names) if place not in chosen.values())
    return Table(tuple(headers), np.array(columns, dtype=object).T, lines, left)


def _with_points(cells: Sequence[str], name: str, path: Path) -> list[str]:
    """Return numbers of a column with decimal points and nothing between thousands."""
    numbers = [cell.replace("'", "") for cell in cells]
    decimal = _decimal_sign(numbers, name, path)
    other = "," if decimal == "." else "."
    return [number.replace(other, "").replace(decimal, ".") for number in numbers]


def _decimal_sign(numbers: Sequence[str], name: str, path: Path) -> str:
    """Return the decimal sign of numbers; they have a point, a comma, or both."""
    both = [number for number in numbers if "," in number and "." in number]
    if both:
        return max(",.", key=both[0].rfind)
    commas = [number for number in numbers if "," in number]
    if not commas:
        return "."
    grouped = all(re.fullmatch(r"[-+]?[1-9]\d{0,2}(,\d{3})+", number) for number in commas)
    pointed = any("." in number for number in numbers)
    if grouped and (pointed or any(number.count(",") > 1 for number in commas)):
        return "."
    if pointed or any(number.count(",") > 1 for number in commas):
        raise InputError(
            f'column "{name}" has numbers with commas and others with points', file=path
        )
    if grouped:
        raise InputError(
            f'column "{name}": "{commas[0]}" may be a thousand or a decimal comma; write points',
            file=path,
        )
    return ","
