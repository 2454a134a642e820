"""Keyword blocks of Abaqus and CalculiX decks, and the numbers in their data lines.

Source: Abaqus Modeling Reference, "Input syntax rules"; CalculiX CrunchiX user's manual, "Input
deck format".
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np

from lcmchain.errors import InputError
from lcmchain.mesh_files.file_mesh import Place
from lcmchain.mesh_files.readers.decks.common import deck_lines

DEEPEST_INCLUDE = 5  # of decks that include decks, as in Abaqus
#: Keywords of a mesh; INPUT= names a file with their data lines.
OF_MESH = ("NODE", "ELEMENT", "NSET", "ELSET", "SURFACE")


@dataclass
class Block:
    """A keyword with its parameters and data lines.

    Parameters
    ----------
    keyword : upper case, without blanks.
    parameters : values by upper-case names; empty for those without a value.
    data : data lines, without comments and empty ones. files, lines : where each of them stands.
    """

    keyword: str
    parameters: dict[str, str]
    place: Place
    data: list[str] = field(default_factory=list)
    files: list[Path] = field(default_factory=list)
    lines: list[int] = field(default_factory=list)

    def place_of(self, row: int) -> Place:
        """Return the place of a data line."""
        return Place(self.files[row], self.lines[row])

    def name(self, parameter: str) -> str:
        """Return a label that the block has to give.

        Raises
        ------
        InputError : it does not.
        """
        label = self.parameters.get(parameter)
        if not label:
            raise self.place.error(f"*{self.keyword} has no {parameter}=")
        return label

    def error(self, message: str) -> InputError:
        return self.place.error(f"*{self.keyword} {message}")


def keyword_blocks(path: Path) -> Iterator[Block]:
    """Yield the blocks of a deck and of what it includes, in order.

    Raises
    ------
    InputError : a file cannot be read, or data stand before the first keyword.
    """
    block: Block | None = None
    lines = _lines(path, path.parent, ())
    for file, line, text in lines:
        if not text.startswith("*"):
            if block is None:
                raise Place(file, line).error("this is no keyword, so the file is no Abaqus deck")
            block.data.append(text)
            block.files.append(file)
            block.lines.append(line)
            continue
        while text.endswith(","):
            more = next(lines, None)
            if more is None:
                break
            text += more[2]
        if block is not None:
            yield block
        block = _block(Place(file, line), text)
        if block.keyword in OF_MESH and "INPUT" in block.parameters:
            _take_input(block, path.parent)
    if block is not None:
        yield block


def _take_input(block: Block, folder: Path) -> None:
    """Give a block the data lines of the file that it names with INPUT=."""
    file = _included(block, folder, block.place.file)
    for number, raw in enumerate(deck_lines(file), start=1):
        text = raw.strip()
        if not text or text.startswith("**"):
            continue
        if text.startswith("*"):
            raise Place(file, number).error(
                f'"{text[:40]}" is a keyword, but the file is the INPUT of a *{block.keyword} and '
                "may hold data lines only; name a file of keywords with *INCLUDE, INPUT="
            )
        block.data.append(text)
        block.files.append(file)
        block.lines.append(number)


def _lines(path: Path, folder: Path, within: tuple[Path, ...]) -> Iterator[tuple[Path, int, str]]:
    """Lines that hold something, those of included files in their place."""
    for number, raw in enumerate(deck_lines(path), start=1):
        text = raw.strip()
        if not text or text.startswith("**"):
            continue
        if text[0] == "*" and text[1:].lstrip()[:7].upper() == "INCLUDE":
            place = Place(path, number)
            file = _included(_block(place, text), folder, path)
            if file in (*within, path) or len(within) >= DEEPEST_INCLUDE:
                raise place.error(f"*INCLUDE leads back to {file.name}, or too deep")
            yield from _lines(file, folder, (*within, path))
        else:
            yield path, number, text


def _included(block: Block, folder: Path, including: Path) -> Path:
    """File that an INPUT= names, beside the deck or beside the file that names it."""
    if "PASSWORD" in block.parameters:
        raise block.error("is encrypted; export the mesh as plain text")
    name = Path(block.name("INPUT").replace("\\", "/"))
    for place in (folder / name, including.parent / name):
        if place.is_file():
            return place
    raise block.error(f"names {name}, which does not exist beside the deck")


def _block(place: Place, text: str) -> Block:
    words = _split(text[1:])
    parameters = {}
    for word in words[1:]:
        name, equals, value = word.partition("=")
        if name.strip():
            parameters[_squeezed(name)] = _label(value) if equals else ""
    return Block(_squeezed(words[0]), parameters, place)


def _split(text: str) -> list[str]:
    """Split at commas outside quotation marks."""
    cuts = [-1]
    quoted = False
    for at, letter in enumerate(text):
        quoted ^= letter == '"'
        if letter == "," and not quoted:
            cuts.append(at)
    return [text[first + 1 : end] for first, end in pairwise([*cuts, len(text)])]


def _squeezed(text: str) -> str:
    return "".join(text.split()).upper()


def _label(text: str) -> str:
    return text.strip().strip('"').strip()


def words(text: str) -> list[str]:
    """Return the entries of a data line, without the empty one after a last comma."""
    entries = [_label(word) for word in (_split(text) if '"' in text else text.split(","))]
    return entries[:-1] if entries and not entries[-1] else entries


# --- numbers --------------------------------------------------------------------------------------


_FORTRAN = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+))(?:[DdQq]|(?=[+-]))([+-]?\d+)")

# Numbers of nodes and elements go into 64 bits.
LARGEST = 2**62


def node_table(block: Block) -> tuple[np.ndarray, np.ndarray]:
    """Return the numbers (N,) and coordinates (N, 3) of a *NODE block; left-out ones are 0."""
    ids, points = [], []
    for row, text in enumerate(block.data):
        entries = text.split(",")
        try:
            numbers = [real(word) if word.strip() else 0.0 for word in entries[1:4]]
            ids.append(whole(entries[0]))
        except ValueError:
            raise block.place_of(row).error(f'"{text[:60]}" is no node: number, x, y, z') from None
        points.append((numbers + [0.0, 0.0, 0.0])[:3])
    return np.array(ids, dtype=np.int64), np.array(points).reshape(-1, 3)


def element_table(block: Block, node_count: int) -> tuple[np.ndarray, list[int]]:
    """Return numbers of elements and of their nodes, and the data line on which each begins.

    An element goes on in the next lines until it has all its nodes.

    Returns
    -------
    table : shape (C, 1 + node_count).
    """
    table: list[int] = []
    begins: list[int] = []
    width = 1 + node_count
    found = width  # numbers of the present element so far
    for row, text in enumerate(block.data):
        if found == width:
            begins.append(row)
            found = 0
        try:
            numbers = [whole(word) for word in (text[:-1] if text[-1] == "," else text).split(",")]
        except ValueError:
            raise block.place_of(row).error(
                f'"{text[:60]}" is no element: number and {node_count} nodes'
            ) from None
        found += len(numbers)
        table += numbers
        if found > width:
            number = table[width * (len(begins) - 1)]
            raise block.place_of(begins[-1]).error(
                f"element {number} has more than {node_count} nodes"
            )
    if found != width:
        raise block.place_of(begins[-1]).error(
            f"the last element of the block has {found - 1} of {node_count} nodes; the file may be "
            "cut off"
        )
    return np.array(table, dtype=np.int64).reshape(-1, width), begins


def element_count(block: Block) -> int:
    """Number of elements of a type that is not read: lines that do not go on from a comma."""
    ends = [text.endswith(",") for text in block.data]
    return len(ends) - sum(ends[:-1])


def elements_left_out(block: Block) -> list[tuple[int, list[int]]]:
    """Number and nodes of the elements of a type that is not read, as far as they can be told.

    The number of nodes of the type is not known: an element goes on behind a comma. Nodes of
    instances (``Part-1.5``) are left out.
    """
    found = []
    words: list[str] = []
    for row, text in enumerate(block.data, start=1):
        words += text.split(",")
        if text.endswith(",") and row < len(block.data):
            continue
        numbers = [word.strip() for word in words]
        words = []
        if not numbers[0].isdigit() or len(numbers[0]) > 17:
            continue
        nodes = [int(word) for word in numbers[1:] if word.isdigit() and len(word) < 18]
        found.append((int(numbers[0]), nodes))
    return found


def real(text: str) -> float:
    """Return a coordinate; its exponent may be Fortran's: ``1.0D+1``, ``1.0+1``.

    Raises
    ------
    ValueError : it is no number.
    """
    try:
        return float(text)
    except ValueError:
        found = _FORTRAN.fullmatch(text.strip())
        if found is None:
            raise
        return float(f"{found[1]}e{found[2]}")


def whole(text: str) -> int:
    """Return a number of a node or element.

    Raises
    ------
    ValueError : it is none.
    """
    number = int(text)
    if abs(number) > LARGEST:
        raise ValueError(text)
    return number


def number_range(entries: list[str], place: Place) -> range:
    """Return the numbers of a GENERATE line: first, last, increment.

    It may go far past the numbers that exist, so that it is not written out.

    Raises
    ------
    InputError : it is no range.
    """
    try:
        first, last = whole(entries[0]), whole(entries[1])
        step = whole(entries[2]) if len(entries) > 2 and entries[2] else 1
    except (ValueError, IndexError):
        raise place.error("GENERATE takes first, last and increment") from None
    if step < 1 or last < first:
        raise place.error(f"no range of numbers: {first} to {last} by {step}")
    return range(first, last + 1, step)


def motion(block: Block) -> tuple[np.ndarray, np.ndarray]:
    """Return rotation (3, 3) and translation (3,) of an *INSTANCE: x becomes R (x + t') as x R + t.

    The translation comes first, then the rotation about the axis through two points by an angle in
    degrees. Source: Abaqus Keywords Guide, *INSTANCE.
    """
    rows = []
    for row in range(len(block.data)):
        try:
            rows.append([real(word) if word else 0.0 for word in words(block.data[row])])
        except ValueError:
            raise block.place_of(row).error("the place of an instance takes numbers") from None
        if not all(math.isfinite(number) for number in rows[-1]):
            raise block.place_of(row).error("the place of an instance is not finite")
    shift = np.zeros(3)
    if rows:
        shift[: len(rows[0][:3])] = rows[0][:3]
    if len(rows) < 2:
        return np.eye(3), shift
    if len(rows[1]) != 7 or rows[1][:3] == rows[1][3:6]:
        raise block.place_of(1).error("a rotation takes two different points and an angle")
    a, b = np.array(rows[1][:3]), np.array(rows[1][3:6])
    turn = rotation((b - a) / np.linalg.norm(b - a), math.radians(rows[1][6]))
    return turn, turn @ (shift - a) + a


def rotation(axis: np.ndarray, angle: float) -> np.ndarray:
    """Return the rotation about a unit axis by an angle [rad] (Rodrigues)."""
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.eye(3) + math.sin(angle) * cross + (1.0 - math.cos(angle)) * cross @ cross
