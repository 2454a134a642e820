"""Mesh files that were compressed, as NETGEN saves them (.vol.gz): unpacked to be read."""

from __future__ import annotations

import bz2
import gzip
import lzma
import shutil
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from io import BufferedIOBase
from pathlib import Path
from tempfile import TemporaryDirectory

from lcmchain.errors import InputError

_OPENERS: dict[bytes, Callable[[Path], BufferedIOBase]] = {
    b"\x1f\x8b": gzip.open,
    b"BZh": bz2.open,
    b"\xfd7zXZ\x00": lzma.open,
}
_ENDINGS = (".gz", ".bz2", ".xz")


def is_compressed(path: Path) -> bool:
    """Tell from its first bytes whether a file is compressed by gzip, bzip2 or xz."""
    return _opener(path) is not None


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
        opener = _opener(path)
        assert opener is not None
        try:
            with opener(path) as source, inner.open("wb") as target:
                shutil.copyfileobj(source, target)
        except (EOFError, OSError, zlib.error, lzma.LZMAError) as error:
            raise InputError(
                f"cannot be unpacked ({error}); compress the mesh again", file=path
            ) from error
        try:
            yield inner
        except InputError as error:
            raise InputError(error.message.replace(str(inner), str(path)), file=path) from error


def _opener(path: Path) -> Callable[[Path], BufferedIOBase] | None:
    with path.open("rb") as file:
        head = file.read(max(map(len, _OPENERS)))
    found = (opener for magic, opener in _OPENERS.items() if head.startswith(magic))
    return next(found, None)
