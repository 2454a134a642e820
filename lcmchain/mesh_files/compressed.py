"""Mesh files that were compressed, as NETGEN saves them (.vol.gz): unpacked to be read."""

from __future__ import annotations

import bz2
import gzip
import lzma
import shutil
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import IO, cast

from lcmchain.errors import InputError

_MAGIC = {b"\x1f\x8b": "gzip", b"BZh": "bzip2", b"\xfd7zXZ\x00": "xz"}
_ENDINGS = (".gz", ".bz2", ".xz")


def is_compressed(path: Path) -> bool:
    """Tell from its first bytes whether a file is compressed by gzip, bzip2 or xz."""
    return _compression(path) is not None


@contextmanager
def unpacked(path: Path) -> Iterator[Path]:
    """Give the path of the unpacked file, whose name lacks the ending of the compression.

    Raises
    ------
    InputError : the file is damaged; one that is raised within names the compressed file.
    """
    with TemporaryDirectory() as folder:
        name = path.stem if path.suffix.lower() in _ENDINGS else path.name
        inner = Path(folder) / name
        try:
            with _opened(path) as source, inner.open("wb") as target:
                shutil.copyfileobj(source, target)
        except (EOFError, OSError, zlib.error, lzma.LZMAError) as error:
            raise InputError(
                f"cannot be unpacked ({error}); compress the mesh again", file=path
            ) from error
        try:
            yield inner
        except InputError as error:
            raise InputError(error.message.replace(str(inner), str(path)), file=path) from error


def _opened(path: Path) -> IO[bytes]:
    """Open a compressed file to read what it holds."""
    kind = _compression(path)
    if kind == "bzip2":
        return bz2.open(path, mode="rb")
    if kind == "xz":
        return lzma.open(path, mode="rb")
    return cast(IO[bytes], gzip.open(path, mode="rb"))


def _compression(path: Path) -> str | None:
    with path.open("rb") as file:
        head = file.read(max(map(len, _MAGIC)))
    return next((kind for magic, kind in _MAGIC.items() if head.startswith(magic)), None)
