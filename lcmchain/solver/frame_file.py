"""Saved frames on disk, each written once: the part of a checkpoint that only grows.

The file is a sequence of arrays in NumPy's format, frame after frame. The checkpoint says how many
bytes of it are valid; what a killed run has left behind them is cut off before the next frame.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

FILE_NAME = "checkpoint_frames.npy"


class FrameFile:
    """Appends frames to a file; ``count`` frames in ``length`` bytes are there so far."""

    def __init__(self, folder: Path, count: int = 0, length: int = 0) -> None:
        self.path = Path(folder) / FILE_NAME
        self.count, self.length = count, length

    def append(self, frames: Sequence[dict[str, np.ndarray]]) -> None:
        """Write the arrays of further frames behind the valid part, in the order of their names."""
        if not frames:
            return
        with open(self.path, "r+b" if self.length else "wb") as file:
            file.truncate(self.length)
            file.seek(self.length)
            for frame in frames:
                for name in sorted(frame):
                    np.save(file, frame[name], allow_pickle=False)
            file.flush()
            os.fsync(file.fileno())  # the checkpoint that counts these bytes must not precede them
            self.length = file.tell()
        self.count += len(frames)

    def read(self, names: Sequence[str]) -> list[dict[str, np.ndarray]]:
        """Read all frames, each with arrays of these names.

        Raises
        ------
        OSError, EOFError, ValueError : the file is not that of the checkpoint.
        """
        if self.count == 0:
            return []
        with open(self.path, "rb") as file:
            frames = [
                {name: np.load(file, allow_pickle=False) for name in sorted(names)}
                for _ in range(self.count)
            ]
            if file.tell() != self.length:
                raise ValueError(f"{FILE_NAME} has other frames")
        return frames
