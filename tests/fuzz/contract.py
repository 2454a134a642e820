"""What every call of the command line must keep, whatever it is given.

A call is made in this process, by the same function as from a terminal, and judged:

- it ends with exit code 0 (done), 1 or 2 (one message), never with a traceback;
- it ends within ten seconds of computing time;
- a message says "Error:" once, names a scene key, an option or a file, and can be read at a glance;
- a refused call leaves nothing behind;
- exit code 0 where the case had to be refused, or with a result that is wrong to the case's own
  check, is a silent error: the worst of all.
"""

from __future__ import annotations

import contextlib
import io
import re
import signal
import sys
import time
import traceback
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from enum import Enum
from functools import cache
from pathlib import Path
from unittest import mock

import typer

from lcmchain import cli
from lcmchain.errors import LcmchainError

TIME_LIMIT = 10.0  # of one call [s], of computing time
WALL_LIMIT = 120.0  # [s], on a machine that has other work too
LONGEST_MESSAGE = 3000

_PLACE = re.compile(
    r"\b(title|process|blank|material|element|contact|tools|output|mapping|permeability)\b|--[a-z]"
    r"|\b(gates|vents|regions|race_tracks|wetted|film|resin|closure|time|gravity|node|cell|region)\b"
)


class Verdict(Enum):
    """What came of a call."""

    VALID = "valid"
    REFUSED = "refused"
    TRACEBACK = "traceback"
    HANG = "hang"
    MESSAGE = "bad message"
    LEFT_BEHIND = "left behind"
    SILENT = "silent error"


@dataclass(frozen=True)
class Case:
    """One call with wrong or odd input.

    Parameters
    ----------
    arguments : of the command line.
    what : the change that was made, in words.
    files : inputs by their path, kept beside the report where the case fails.
    out : what a refused call must not leave behind, nor change.
    must_refuse : whether the change is one that no reader may accept.
    check : returns what is wrong with the result of an accepted call, or None.
    call : instead of the command line, a function that raises LcmchainError to refuse.
    """

    arguments: Sequence[str]
    what: str
    files: Sequence[Path] = ()
    out: Path | None = None
    must_refuse: bool = False
    check: Callable[[], str | None] | None = None
    call: Callable[[], object] | None = None


@dataclass(frozen=True)
class Outcome:
    """Verdict on a case, and what it rests on."""

    verdict: Verdict
    detail: str = ""
    seconds: float = 0.0

    @property
    def failed(self) -> bool:
        return self.verdict not in (Verdict.VALID, Verdict.REFUSED)


class _TooLong(BaseException):
    """Raised by the timer; no handler of the program may swallow it."""


@dataclass
class _Said:
    out: io.StringIO = field(default_factory=io.StringIO)
    err: io.StringIO = field(default_factory=io.StringIO)


def judge(case: Case, *, limit: float | None = None) -> Outcome:
    """Make the call of a case and say what came of it; ``limit`` [s] of computing time."""
    limit = TIME_LIMIT if limit is None else limit
    before = _contents(case.out)
    said = _Said()
    start = time.process_time()
    try:
        with _time_limit(limit), _captured(said):
            code = _called(case)
            complaint = case.check() if code == 0 and case.check is not None else None
    except _TooLong:
        return Outcome(Verdict.HANG, _last_line(), limit)
    except BaseException:
        return Outcome(Verdict.TRACEBACK, traceback.format_exc(limit=-6), _spent(start))
    seconds = _spent(start)
    if code == 0:
        if case.must_refuse:
            return Outcome(Verdict.SILENT, f"accepted: {case.what}", seconds)
        verdict = Verdict.SILENT if complaint else Verdict.VALID
        return Outcome(verdict, complaint or "", seconds)
    message = said.err.getvalue()
    if complaint := _message_complaint(message, code, case):
        return Outcome(Verdict.MESSAGE, f"{complaint}\n{message[:2000]}", seconds)
    left = _contents(case.out)
    # What a message names is left on purpose: a picture of what is wrong.
    if not _only_named(left, message) and left != before:
        return Outcome(Verdict.LEFT_BEHIND, str(left), seconds)
    return Outcome(Verdict.REFUSED, message.strip(), seconds)


def _called(case: Case) -> int:
    """Return the exit code of the call."""
    if case.call is not None:
        try:
            case.call()
        except LcmchainError as error:
            print(f"Error: {error}", file=sys.stderr)
            return error.exit_code
        return 0
    try:
        with mock.patch.object(cli, "app", _commands()):
            cli.main(list(case.arguments))
    except SystemExit as stop:
        return int(stop.code or 0)
    return 0


@cache
def _commands():
    """The commands, put together once: that takes as long as a call."""
    return typer.main.get_command(cli.app)


def _message_complaint(message: str, code: int, case: Case) -> str | None:
    if code not in (1, 2):
        return f"exit code {code}"
    if not message.startswith("Error: ") or message.count("Error: ") != 1:
        return "not one message"
    if len(message) > LONGEST_MESSAGE:
        return f"a message of {len(message)} characters"
    if "Traceback" in message:
        return "a traceback in the message"
    if not _PLACE.search(message) and not any(file.name in message for file in case.files):
        return "names neither key nor file"
    return None


@contextlib.contextmanager
def _time_limit(limit: float):
    def stop(number, frame):
        raise _TooLong

    # Computing time: on a busy machine a call may take longer without being slow.
    before = {number: signal.signal(number, stop) for number in (signal.SIGPROF, signal.SIGALRM)}
    signal.setitimer(signal.ITIMER_PROF, limit)
    signal.setitimer(signal.ITIMER_REAL, max(limit, WALL_LIMIT))
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        for number, handler in before.items():
            signal.signal(number, handler)


@contextlib.contextmanager
def _captured(said: _Said):
    with contextlib.redirect_stdout(said.out), contextlib.redirect_stderr(said.err):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield


def _contents(folder: Path | None) -> dict[str, int] | None:
    """Names and times of change of what lies in a folder; None where there is none."""
    if folder is None or not folder.exists():
        return None
    return {str(path): path.lstat().st_mtime_ns for path in sorted(folder.rglob("*"))}


def _only_named(left: dict[str, int] | None, message: str) -> bool:
    """Whether a folder holds what a message names, and nothing else."""
    return bool(left) and all(path in message for path in left)


def _spent(start: float) -> float:
    return time.process_time() - start


def _last_line() -> str:
    frame = sys.exc_info()[2]
    lines = traceback.format_tb(frame)
    return "".join(lines[-4:])
