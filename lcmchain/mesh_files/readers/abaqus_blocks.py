"""Keyword blocks of Abaqus and CalculiX decks.

Source: Abaqus Modeling Reference, "Input syntax rules"; CalculiX CrunchiX user's manual, "Input
deck format".
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

from lcmchain.errors import InputError
from lcmchain.mesh_files.file_mesh import Place
from lcmchain.mesh_files.readers.deck_text import deck_lines

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
