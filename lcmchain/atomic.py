"""Files that appear complete or not at all."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from lcmchain.errors import InputError, OutputError

#: What the names of unfinished files begin with.
UNFINISHED = ".unfinished-"

_listeners: list[Callable[[Path], None]] = []


@contextmanager
def replacing(path: Path | str) -> Iterator[Path]:
    """Give a temporary path beside ``path`` that takes its place when the block ends well.

    Raises
    ------
    InputError : ``path`` is a folder, or its folder cannot be made or written.
    OutputError : writing failed on the way (a full disk); what was at ``path`` is still there.
    """
    path = Path(path)
    if path.is_dir():
        raise InputError("is a folder; name a file in it", file=path)
    announce(path)  # first, so that a killed process leaves no file that nobody has heard of
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(
            dir=path.parent, prefix=f"{UNFINISHED}{path.stem}-", suffix=path.suffix
        )
    except OSError as error:
        reason = error.strerror or str(error)
        raise InputError(f"cannot be written ({reason}); choose another place", file=path) from None
    os.close(handle)
    # mkstemp makes files private; a result gets the rights that any new file gets.
    umask = os.umask(0)
    os.umask(umask)
    os.chmod(name, 0o666 & ~umask)
    temporary = Path(name)
    try:
        yield temporary
        os.replace(temporary, path)
    except OSError as error:
        if error.filename not in (None, name):
            raise
        raise OutputError(error.strerror or str(error), file=path) from error
    finally:
        temporary.unlink(missing_ok=True)


def announce(path: Path) -> None:
    """Tell whoever listens that a file is about to appear."""
    for listener in tuple(_listeners):
        listener(path)


@contextmanager
def announcing(listener: Callable[[Path], None]) -> Iterator[None]:
    """Call ``listener`` with the path of every file that is about to appear during the block.

    An error that it raises keeps the file from appearing.
    """
    _listeners.append(listener)
    try:
        yield
    finally:
        _listeners.remove(listener)


@contextmanager
def protecting(inputs: Iterable[Path]) -> Iterator[Callable[[Path], None]]:
    """Refuse to write over any of these files during the block; give the check itself.

    Raises
    ------
    InputError : the block would have written over an input.
    """
    protected = {file.resolve() for file in inputs}

    def refuse(path: Path) -> None:
        if path.resolve() in protected:
            raise InputError(
                "the command reads this file and would write over it; name another place with "
                "--out",
                file=path,
            )

    with announcing(refuse):
        yield refuse


def remove_leftovers(folder: Path) -> None:
    """Remove the unfinished files that a killed process has left in a folder."""
    for path in folder.glob(f"{UNFINISHED}*"):
        path.unlink(missing_ok=True)
