"""Keyword blocks of LS-DYNA decks, and the numbers in their fields.

Source: LS-DYNA Keyword User's Manual, volume I, "Getting started": general card format, long and
i10 formats, *INCLUDE, *INCLUDE_PATH.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from lcmchain.errors import InputError
from lcmchain.mesh_files.file_mesh import Place
from lcmchain.mesh_files.readers.decks.common import deck_lines, real_number

DEEPEST_INCLUDE = 20
#: Behind a keyword: the format of this block alone.
_SUFFIXES = {"+": "long", "-": "standard", "%": "i10"}
#: Included files that move, renumber or hide a mesh.
_NOT_FOLLOWED = ("INCLUDE_TRANSFORM", "INCLUDE_AUTO_OFFSET", "INCLUDE_BINARY", "INCLUDE_NASTRAN",
                 "INCLUDE_UNITCELL", "INCLUDE_MULTISCALE", "NODE_TRANSFORM", "NODE_SCALAR",
                 "ELEMENT_GENERATE", "NODE_MERGE")  # fmt: skip


class Line(NamedTuple):
    """A line of data, and where it stands."""

    text: str
    place: Place

    def fields(self, widths: list[int]) -> list[str]:
        """Return the entries, in columns of given widths or between commas.

        Of lines with commas all are returned, as many as there are.
        """
        if "," in self.text:
            return [word.strip() for word in self.text.rstrip().rstrip(",").split(",")]
        entries, at = [], 0
        for width in widths:
            entries.append(self.text[at : at + width].strip())
            at += width
        return entries

    def wholes(self, widths: list[int]) -> list[int]:
        """Return the entries as whole numbers, 0 for blank ones.

        Raises
        ------
        InputError : one is no number.
        """
        return [self._whole(entry) for entry in self.fields(widths)]

    def _whole(self, entry: str) -> int:
        if not entry:
            return 0
        try:
            number = int(entry)
        except ValueError:
            real = self.real(entry)  # 12.0 is a number of an element too
            number = int(real) if real == int(real) else -1
        if not 0 <= number < 10**17:
            raise self.place.error(f'"{entry}" is no number of a node, element, part or set')
        return number

    def real(self, entry: str) -> float:
        """Return an entry as a real number; ``1.5-3`` is 1.5e-3, a blank one 0.

        Raises
        ------
        InputError : it is none.
        """
        if not entry:
            return 0.0
        try:
            return real_number(entry)
        except ValueError:
            raise self.place.error(
                f'"{entry[:40]}" is no number'
                + ("; write the value of the parameter" if "&" in entry else
                   "; entries stand in columns or between commas")
            ) from None  # fmt: skip


@dataclass
class Block:
    """A keyword with its data.

    Parameters
    ----------
    keyword : upper case, with its options.
    format : ``"standard"``, ``"i10"`` or ``"long"``.
    lines : data, empty lines too, since a title may be empty.
    comments : comment lines before the first line of data.
    """

    keyword: str
    format: str
    place: Place
    lines: list[Line] = field(default_factory=list)
    comments: list[str] = field(default_factory=list)

    def error(self, message: str) -> InputError:
        return self.place.error(f"*{self.keyword} {message}")

    def widths(self, usual: int, count: int, i10: int | None = None) -> list[int]:
        """Return the widths of columns, twenty each in the long format.

        Parameters
        ----------
        usual : width in the standard format. i10 : in that of long numbers, where it differs.
        """
        width = {"long": 20, "i10": i10 or usual}.get(self.format, usual)
        return [width] * count

    def options(self, base: str, known: Iterable[str], plain: str) -> set[str]:
        """Return the options behind a keyword.

        Parameters
        ----------
        base : the keyword without options. known : options that are read.
        plain : elements to export where there is another one.

        Raises
        ------
        InputError : one is not read.
        """
        found = {word for word in self.keyword[len(base) :].split("_") if word}
        if unknown := found.difference(known):
            raise self.error(
                f"has the option {min(unknown)}, which is not read; export plain {plain}"
            )
        return found


class _Deck:
    """Files of a deck, and the folders in which included ones are looked for."""

    def __init__(self, path: Path) -> None:
        self.folders = [path.parent]

    def blocks(self, path: Path, format: str, within: tuple[Path, ...]) -> Iterator[Block]:
        """Blocks of a file, those of included files in their place."""
        block: Block | None = None
        for number, raw in enumerate(deck_lines(path), start=1):
            text = raw.rstrip()
            if text.startswith("$"):
                if block is not None and not block.lines:
                    block.comments.append(text)
                continue
            place = Place(path, number)
            if text.startswith("*"):
                if block is not None:
                    yield from self._finished(block, path, within)
                block = _opened(text, format, place)
                if block.keyword == "END":
                    return
                if block.keyword.startswith("KEYWORD"):
                    format = _format(text, format)
            elif text.startswith("-----BEGIN PGP"):
                raise place.error("is encrypted; ask for the mesh as plain text")
            elif block is not None:
                block.lines.append(Line(text, place))
            elif text.strip():
                raise place.error("stands before the first keyword; is this an LS-DYNA deck?")
        if block is not None:
            yield from self._finished(block, path, within)

    def _finished(self, block: Block, path: Path, within: tuple[Path, ...]) -> Iterator[Block]:
        """The block, or those of the files that it includes."""
        if block.keyword.startswith(_NOT_FOLLOWED):
            raise block.error("is not followed here; write the deck as one file with its mesh")
        if block.keyword in ("INCLUDE_PATH", "INCLUDE_PATH_RELATIVE"):
            for name, _ in _file_names(block):
                self.folders.append(self.folders[0] / name)
        elif block.keyword == "INCLUDE":
            for name, place in _file_names(block):
                file = self._found(name, path, place)
                if file in (*within, path) or len(within) >= DEEPEST_INCLUDE:
                    raise place.error(f"*INCLUDE leads back to {file.name}, or too deep")
                yield from self.blocks(file, block.format, (*within, path))
        else:
            yield block

    def _found(self, name: Path, including: Path, place: Place) -> Path:
        for folder in (*self.folders, including.parent):
            if (folder / name).is_file():
                return folder / name
        raise place.error(f"*INCLUDE names {name}, which does not exist beside the deck")


def keyword_blocks(path: Path) -> Iterator[Block]:
    """Yield the blocks of a deck and of what it includes, in order.

    Raises
    ------
    InputError : a file cannot be read, is missing or not followed; names file and line.
    """
    yield from _Deck(path).blocks(path, "standard", ())


def _opened(text: str, format: str, place: Place) -> Block:
    word = text[1:].strip().upper()
    name = word.split()[0] if word else ""
    suffix = word[len(name) :].strip()[:1] or name[-1:]
    if suffix in _SUFFIXES and not name.startswith("KEYWORD"):
        return Block(name.rstrip("+-%"), _SUFFIXES[suffix], place)
    return Block(name, format, place)


def _format(text: str, format: str) -> str:
    """Format that *KEYWORD asks for; ``LONG=S`` is about what the solver writes."""
    text = text.upper().replace(" ", "")
    if "LONG=Y" in text or "LONG=K" in text:
        return "long"
    return "i10" if "I10=Y" in text else format


def _file_names(block: Block) -> Iterator[tuple[Path, Place]]:
    """Names of files, one on each line; those that end with `` +`` go on in the next."""
    begun = ""
    for line in block.lines:
        text = begun + line.text.strip()
        if text.endswith(" +"):
            begun = text[:-2].rstrip()
            continue
        begun = ""
        if text:
            yield Path(text.replace("\\", "/")), line.place
