"""Sections of Gmsh's MSH files, and the numbers in them, as text or binary.

Source: Gmsh reference manual, "MSH file format".
"""

from __future__ import annotations

import re
from collections.abc import Generator
from pathlib import Path

import numpy as np

from lcmchain.errors import InputError

_HEADER = re.compile(rb"\s*\$(\w+)[^\S\n]*\r?\n")


class Numbers:
    """Numbers of a section, taken one after the other.

    Parameters
    ----------
    count : what a binary section of version 2 says in front as text.
    content : bytes of the file. start, end : of the section; a binary one ends where its numbers
        do. sizes : type of counts and tags in a binary file. order : of its bytes, ``<`` or ``>``.
    """

    def __init__(
        self, path: Path, name: str, content: bytes, start: int, end: int, *,
        binary: bool, sizes: str = "u8", order: str = "<",
    ) -> None:  # fmt: skip
        self._path, self._name, self._binary = path, name, binary
        self._content, self._at = content, start
        self._types = {"int": f"{order}i4", "size": f"{order}{sizes}", "real": f"{order}f8"}
        self._words = [] if binary else content[start:end].split()
        self._next = 0
        self.count = 0

    def take(self, kind: str, count: int = 1) -> np.ndarray:
        """Return the next numbers: ``"int"``, ``"size"`` (counts and tags) or ``"real"``.

        Raises
        ------
        InputError : there are not as many, or something else than numbers.
        """
        if count < 0 or count > len(self._content):
            raise self.error(f"holds a count that cannot be right ({count})")
        if self._binary:
            kept = np.dtype(self._types[kind])
            end = self._at + count * kept.itemsize
            if end > len(self._content):
                raise self.error("ends before its last number; the file is cut off")
            found = np.frombuffer(self._content, kept, count, self._at)
            self._at = end
        else:
            words = self._words[self._next : self._next + count]
            self._next += count
            if len(words) < count:
                raise self.error("ends before its last number; the file is cut off")
            if not count:
                return np.empty(0)
            try:
                found = np.array(words, dtype="S").astype(float if kind == "real" else np.int64)
            except (ValueError, OverflowError):
                raise self.error("holds something that is no number") from None
        return found.astype(float if kind == "real" else np.int64)

    def one(self, kind: str) -> int:
        """Return the next whole number."""
        return int(self.take(kind)[0])

    @property
    def end(self) -> int:
        """Place behind what was taken from a binary section."""
        return self._at

    def error(self, message: str) -> InputError:
        return InputError(f"the section ${self._name} {message}", file=self._path)


def sections(path: Path, content: bytes) -> Generator[tuple[str, int, int], int | None, None]:
    """Yield name, start and end of each section; send the end of a binary one back.

    Raises
    ------
    InputError : a section has no end.
    """
    at = 0
    while (found := _HEADER.match(content, at)) is not None:
        name = found[1].decode("latin-1")
        closing = b"$End" + found[1]
        end = content.find(closing, found.end())
        if end < 0:
            raise InputError(f"the section ${name} has no end; the file is cut off", file=path)
        taken = yield name, found.end(), end
        if taken:
            end = content.find(closing, taken)
            if end < 0:
                raise InputError(f"the section ${name} has no end; the file is cut off", file=path)
        at = end + len(closing)
    if content[at:].strip():
        raise InputError("something that is no section of an MSH file follows", file=path)
