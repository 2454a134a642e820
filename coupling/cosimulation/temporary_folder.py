"""A temporary folder of one process, which the next one removes where that process was killed."""

from __future__ import annotations

import os
import shutil
import stat
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from filelock import FileLock, Timeout

#: File in the folder that its process holds locked. The system gives a lock back with its process.
LOCK = "lock"
#: Folders younger than this may not be locked yet [s].
YOUNG = 60.0


@contextmanager
def temporary_folder(prefix: str) -> Iterator[Path]:
    """Give an empty folder that is removed behind the block.

    Those of the same prefix that killed processes have left are removed first.

    Parameters
    ----------
    prefix : begin of the folder's name, the same for all processes of one purpose.
    """
    remove_abandoned(prefix)
    with tempfile.TemporaryDirectory(prefix=prefix) as name:
        content = Path(name, "content")
        content.mkdir()
        lock = FileLock(Path(name, LOCK))
        with suppress(NotImplementedError):  # a file system without locks: nobody removes it
            lock.acquire()
        try:
            yield content
        finally:
            lock.release()


def remove_abandoned(prefix: str) -> None:
    """Remove the folders of processes that are no more; of other users none, and no error."""
    for folder in Path(tempfile.gettempdir()).glob(f"{prefix}*"):
        with suppress(OSError, Timeout, NotImplementedError):
            found = folder.lstat()
            if not stat.S_ISDIR(found.st_mode) or not (folder / LOCK).is_file():
                continue
            if hasattr(os, "getuid") and found.st_uid != os.getuid():
                continue
            if time.time() - found.st_mtime < YOUNG:
                continue
            with FileLock(folder / LOCK).acquire(timeout=0):
                shutil.rmtree(folder / "content", ignore_errors=True)
            shutil.rmtree(folder, ignore_errors=True)
