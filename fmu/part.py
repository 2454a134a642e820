"""Definition of a unit, the physics behind it, and their state at a communication point."""

from __future__ import annotations

import json
import math
import os
import tempfile
import weakref
import zlib
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from lcmchain.compilation.threads import use_threads
from lcmchain.errors import InputError, LcmchainError
from lcmchain.fmu.conduct import Messages, Phase, Status
from lcmchain.fmu.variables import Outputs, Values, Variable

#: Name of the file of the interface at which fields are exchanged, in the resources of a unit.
INTERFACE_FILE = "interface.nc"


@dataclass(frozen=True)
class UnitDefinition:
    """What a unit is, before there is an instance of it.

    Parameters
    ----------
    guid : changes with what the unit computes and with its interface.
    fingerprint : hashes of what decides the numbers, by part.
    title, model_name : in words, and as an identifier of the C language.
    variables : the interface.
    stop_time, step_size : of the experiment that a master is proposed [s].
    """

    guid: str
    fingerprint: dict[str, str]
    title: str
    model_name: str
    variables: tuple[Variable, ...]
    stop_time: float
    step_size: float


class Part(ABC):
    """The physics of a unit; all raise :class:`lcmchain.errors.LcmchainError` where they cannot.

    ``values`` holds the parameters and inputs; ``say(text, status)`` hands a message to the master.
    ``target`` is the time since the start at which a step ends [s], as the master has it: sizes of
    steps that are added up drift from it by rounding.
    """

    values: Values
    say: Messages
    target: float = 0.0

    def attach(self, values: Values, say: Messages) -> None:
        """Take the values of the instance, and where messages go."""
        self.values, self.say = values, say

    @property
    def element_count(self) -> int | None:
        """Elements of the mesh, where a small one decides that further threads do not pay."""
        return None

    def use_threads(self) -> int:
        """Set the threads of the compiled loops to what the master asks for; return how many."""
        return use_threads(int(self.values.number("threads")), self.element_count)

    @property
    def out_dir(self) -> Path | None:
        """Folder that the results are written to, None for nowhere."""
        text = self.values.texts["out_dir"]
        return Path(text) if text else None

    def prepare_result(self, name: str) -> None:
        """Check the folder of the results, and warn where another instance is to write the file.

        name : of the file.

        Raises
        ------
        InputError : the folder cannot be made or written to.
        """
        if self.out_dir is None:
            return
        require_writable(self.out_dir)
        path = self.out_dir.resolve() / name
        other = _writers.get(path)
        if other is not None and other is not self:
            self.say(
                f"the instance {other.say.name} of this process writes {path} too: the later one "
                "replaces the earlier one; give each an out_dir of its own",
                Status.WARNING,
            )
        _writers[path] = self

    def result_written(self, path: Path) -> None:
        """Tell where the result is; from now on another instance may replace it."""
        _writers.pop(path.resolve(), None)
        self.values.texts["result_file"] = str(path)
        self.say(f"wrote {path}")

    @abstractmethod
    def build(self) -> None:
        """Build and compile the simulation of the present parameters, at its start."""

    @abstractmethod
    def begin(self) -> None:
        """Do what is done once, after initialization: check where results go, save the start."""

    @property
    @abstractmethod
    def present(self) -> float:
        """Time since the start of the simulation [s]."""

    @abstractmethod
    def advance(self, size: float) -> None:
        """Go on by ``size`` > 0 [s], to ``target``, under the present inputs, all of them finite.

        After an exception :meth:`reinstate` undoes what was done.
        """

    @abstractmethod
    def outputs(self, group: str) -> Outputs:
        """Return the values of the outputs of a group by name, at the present time."""

    @abstractmethod
    def capture(self) -> PartState:
        """Return a copy of the state of the simulation, which no later step changes."""

    @abstractmethod
    def reinstate(self, saved: PartState) -> None:
        """Go back to a captured state, any number of times; going on from it is bit-identical."""

    @abstractmethod
    def finish(self, failure: str) -> None:
        """Write the results, if ``out_dir`` is set; failure: why the last step was undone."""


# Instances that have not ended yet, by the files that they are to write. One that is freed is gone.
_writers: weakref.WeakValueDictionary[Path, Part] = weakref.WeakValueDictionary()


def require_writable(folder: Path) -> None:
    """Make the folder of the results, or say why it cannot be used.

    Raises
    ------
    InputError : the folder cannot be made or written to.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        reason = error.strerror or os.strerror(error.errno or 0)
        raise InputError(
            f'"{folder}" cannot be written to ({reason}); name another folder, or leave it empty '
            "to write nothing",
            key="out_dir",
        ) from None


# --- saved states, for rollback and for storing them ----------------------------------------------

# Head of the bytes: what they are, the check sum of what follows it, and the length of the header.
MAGIC = b"lcmchain unit state 2\n"
HEAD = len(MAGIC) + 4 + 8


class Unreadable(LcmchainError):
    """Bytes that are no state of a unit, or not whole."""


@dataclass(frozen=True)
class PartState:
    """State of the physics of a unit: values that JSON can hold, and arrays by name."""

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
            numbers=named_arrays(arrays, "input "),
            texts=dict(header["texts"]),
            outcome=int(header["outcome"]),
            message=str(header["message"]),
            part=None if values is None else PartState(dict(values), named_arrays(arrays, "part ")),
        )


def named_arrays(arrays: dict[str, np.ndarray], prefix: str) -> dict[str, np.ndarray]:
    return {name[len(prefix) :]: a for name, a in arrays.items() if name.startswith(prefix)}
