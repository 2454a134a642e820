"""The state of a unit at a communication point, for rollback and for storing it."""

from __future__ import annotations

import json
import math
import zlib
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from lcmchain.errors import LcmchainError
from lcmchain.fmu.status import Phase

# Head of the bytes: what they are, the check sum of what follows it, and the length of the header.
MAGIC = b"lcmchain unit state 2\n"
HEAD = len(MAGIC) + 4 + 8


class Unreadable(LcmchainError):
    """Bytes that are no state of a unit, or not whole."""


@dataclass(frozen=True)
class PartState:
    """What the physics of a unit keep: values that JSON can hold, and arrays by name."""

    values: dict[str, Any] = field(default_factory=dict)
    arrays: dict[str, np.ndarray] = field(default_factory=dict)


@dataclass(frozen=True)
class SavedState:
    """Everything of a unit that a rollback brings back; nothing in it is changed later.

    Parameters
    ----------
    guid : of the unit, so that the state of another one is refused.
    fingerprint : of what decides the numbers, by part, so that a state is not resumed with other
        files or other sources of lcmchain, which the guid does not tell apart.
    phase : of the unit's life.
    start_time : of the experiment [s], None until it is known.
    numbers, texts : values of parameters and inputs by name.
    outcome, message : of the last step.
    part : of the physics, None before initialization.
    """

    guid: str
    fingerprint: dict[str, str]
    phase: Phase
    start_time: float | None
    numbers: dict[str, np.ndarray]
    texts: dict[str, str]
    outcome: int
    message: str
    part: PartState | None

    def to_bytes(self) -> bytes:
        """Return the state as bytes; the same state gives equal bytes."""
        known = self.__dict__.get("_bytes")
        if known is not None:  # masters ask for the size first
            return known
        arrays = {f"input {name}": values for name, values in self.numbers.items()}
        if self.part is not None:
            arrays |= {f"part {name}": values for name, values in self.part.arrays.items()}
        arrays = {name: np.ascontiguousarray(values) for name, values in arrays.items()}
        header = json.dumps(
            {
                "guid": self.guid,
                "fingerprint": self.fingerprint,
                "phase": self.phase.value,
                "start_time": self.start_time,
                "texts": self.texts,
                "outcome": self.outcome,
                "message": self.message,
                "part": None if self.part is None else self.part.values,
                "arrays": [[name, a.dtype.str, list(a.shape)] for name, a in arrays.items()],
            }
        ).encode()
        body = b"".join(
            [len(header).to_bytes(8, "little"), header, *(a.tobytes() for a in arrays.values())]
        )
        content = MAGIC + zlib.crc32(body).to_bytes(4, "little") + body
        object.__setattr__(self, "_bytes", content)
        return content

    @classmethod
    def from_bytes(cls, content: bytes) -> SavedState:
        """Read what :meth:`to_bytes` wrote.

        Raises
        ------
        Unreadable : it did not write this, or not all of it is there.
        """
        if not content.startswith(MAGIC) or len(content) < HEAD:
            raise Unreadable("these bytes are no saved state of a unit of this lcmchain")
        body = content[len(MAGIC) + 4 :]
        if zlib.crc32(body).to_bytes(4, "little") != content[len(MAGIC) : len(MAGIC) + 4]:
            raise Unreadable("the saved state is damaged: its check sum does not fit")
        try:
            return cls._read(body)
        except (KeyError, TypeError, ValueError, AttributeError, IndexError) as error:
            raise Unreadable(f"the saved state cannot be read ({error})") from None

    @classmethod
    def _read(cls, body: bytes) -> SavedState:
        length = int.from_bytes(body[:8], "little")
        header = json.loads(body[8 : 8 + length])
        place, arrays = 8 + length, {}
        for name, kind, shape in header["arrays"]:
            dtype = np.dtype(kind)
            if dtype.hasobject:
                raise ValueError(f"{name} holds objects")
            count = math.prod(shape)
            values = np.frombuffer(body, dtype, count, place) if count else np.zeros(0, dtype)
            arrays[name] = values.reshape(shape)
            place += dtype.itemsize * count
        if place != len(body):
            raise ValueError("it is longer than it says")
        values = header["part"]
        return cls(
            guid=header["guid"],
            fingerprint=dict(header["fingerprint"]),
            phase=Phase(header["phase"]),
            start_time=header["start_time"],
            numbers=_named(arrays, "input "),
            texts=dict(header["texts"]),
            outcome=int(header["outcome"]),
            message=str(header["message"]),
            part=None if values is None else PartState(dict(values), _named(arrays, "part ")),
        )


def _named(arrays: dict[str, np.ndarray], prefix: str) -> dict[str, np.ndarray]:
    return {name[len(prefix) :]: a for name, a in arrays.items() if name.startswith(prefix)}
