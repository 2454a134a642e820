"""Saved frames on disk, each written once: the part of a checkpoint that only grows.

The file is a sequence of arrays in NumPy's format, frame after frame. The checkpoint says how many
bytes of it are valid; what a killed run has left behind them is cut off before the next frame.
"""

from __future__ import annotations

import hashlib
import io
import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from lcmchain.atomic import announce
from lcmchain.errors import InputError, OutputError

FILE_NAME = "checkpoint_frames.npy"


class FrameFile:
    """Appends frames to a file; ``count`` frames in ``length`` bytes are there so far."""

    def __init__(self, folder: Path, count: int = 0, length: int = 0) -> None:
        self.path = Path(folder) / FILE_NAME
        self.count, self.length = count, length
        self._digest = hashlib.sha256()

    @property
    def sha256(self) -> str:
        """Hash of the valid bytes."""
        return self._digest.hexdigest()

    def append(self, frames: Sequence[dict[str, np.ndarray]]) -> None:
        """Write the arrays of further frames behind the valid part, in the order of their names.

        Raises
        ------
        OutputError : writing failed; the valid part is as before.
        """
        if not frames:
            return
        content = io.BytesIO()
        for frame in frames:
            for name in sorted(frame):
                np.save(content, frame[name], allow_pickle=False)
        announce(self.path)
        try:
            with open(self.path, "r+b" if self.length else "wb") as file:
                file.truncate(self.length)
                file.seek(self.length)
                file.write(content.getbuffer())
                file.flush()
                os.fsync(file.fileno())  # the checkpoint that counts these bytes comes after them
        except OSError as error:
            raise OutputError(error.strerror or str(error), file=self.path) from error
        self._digest.update(content.getbuffer())
        self.length += content.getbuffer().nbytes
        self.count += len(frames)

    def read(self, names: Sequence[str], sha256: str) -> list[dict[str, np.ndarray]]:
        """Read all frames, each with arrays of these names.

        Raises
        ------
        InputError : the file is absent, or not as it was written.
        """
        if self.count == 0:
            return []
        try:
            with open(self.path, "rb") as file:
                content = file.read(self.length)
        except OSError as error:
            raise InputError(
                f"the frames of the checkpoint cannot be read ({error.strerror}); run without "
                "--resume",
                file=self.path,
            ) from None
        self._digest = hashlib.sha256(content)
        if self.sha256 != sha256:
            raise InputError(
                "the frames of the checkpoint are damaged (their checksum does not fit); run "
                "without --resume",
                file=self.path,
            )
        arrays = io.BytesIO(content)
        return [
            {name: np.load(arrays, allow_pickle=False) for name in sorted(names)}
            for _ in range(self.count)
        ]
