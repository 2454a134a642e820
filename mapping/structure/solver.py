"""Run CalculiX, and tell from what it says whether it has solved."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from lcmchain.errors import InputError, LcmchainError

#: Last words of a run that has come to its end.
FINISHED = "Job finished"

#: Most messages that are told; the log holds all.
MOST_MESSAGES = 5


class SolverError(LcmchainError):
    """CalculiX did not solve the deck (exit code 1): what it says, and where its log is."""


@dataclass(frozen=True)
class SolverRun:
    """A run that came to its end: version of the program, and its warnings with their counts."""

    version: str
    warnings: tuple[str, ...]


def find_solver(command: str) -> str | None:
    """Return the path of CalculiX, None where it is not installed.

    Raises
    ------
    InputError : a path was given that is no program.
    """
    found = shutil.which(command)
    if found is None and os.sep in command:
        raise InputError("is no program that can be run", file=command)
    return found


def run_solver(
    program: str,
    deck: Path,
    *,
    time_limit: float,
    threads: int | None = None,
    told_log: Path | None = None,
) -> SolverRun:
    """Solve a deck; what CalculiX prints goes into ``<deck>.log`` beside it.

    Parameters
    ----------
    time_limit : [s] after which it is stopped. threads : of the solver, by default its own choice.
    told_log : where messages say that the log is, by default where it is written.

    Raises
    ------
    SolverError : it ran out of time, failed, or did not converge.
    """
    log = deck.with_suffix(".log")
    told_log = told_log or log
    environment = dict(os.environ)
    if threads is not None:
        environment["OMP_NUM_THREADS"] = str(threads)
    with open(log, "w", encoding="utf-8") as output:
        process = subprocess.Popen(
            [program, "-i", deck.stem],
            cwd=deck.parent,
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.STDOUT,
            env=environment,
        )
        try:
            code = process.wait(timeout=time_limit)
        except subprocess.TimeoutExpired:
            raise SolverError(
                f"CalculiX did not finish within {time_limit:g} s and was stopped; raise "
                f"time_limit, or coarsen the mesh. Its log is {told_log}"
            ) from None
        finally:
            if process.poll() is None:
                process.kill()
                process.wait()
    return judged(log.read_text(encoding="utf-8", errors="replace"), code, told_log)


def judged(text: str, code: int, log: Path) -> SolverRun:
    """Judge a run by what it printed and its exit code.

    Raises
    ------
    SolverError : an error message, an exit code, or no end of the job.
    """
    errors = messages(text, "ERROR")
    if errors or code != 0 or FINISHED not in text:
        raise SolverError(f"{_reason(errors, code)}. Its log is {log}")
    version = re.search(r"Version\s+([\w.]+)", text)
    return SolverRun(version[1] if version else "unknown", tuple(messages(text, "WARNING")))


def messages(text: str, kind: str) -> list[str]:
    """Messages of a kind (``ERROR``, ``WARNING``), each once with its count, the commonest first.

    A message runs to the next blank line or message; numbers in it do not make it another one.
    """
    found: Counter[str] = Counter()
    example: dict[str, str] = {}
    for words in _texts(text, kind):
        key = re.sub(r"[-+\d.]+(?:[eE][-+]?\d+)?", "#", words)
        found[key] += 1
        example.setdefault(key, words)
    told = [
        example[key] + (f" ({count} times)" if count > 1 else "")
        for key, count in found.most_common(MOST_MESSAGES)
    ]
    rest = len(found) - len(told)
    return [*told, f"and {rest} further kinds"] if rest > 0 else told


def _texts(text: str, kind: str) -> Iterator[str]:
    """Yield the messages of a kind as they follow each other, each on one line."""
    words: list[str] = []
    for line in [*text.splitlines(), ""]:
        stripped = line.strip()
        begins = stripped.startswith(("*ERROR", "*WARNING", "*INFO"))
        if words and (begins or not stripped):
            yield " ".join(words)
            words = []
        if begins and stripped.startswith(f"*{kind}"):
            words = stripped.removeprefix(f"*{kind}").strip(": ").split() or ["no reason given"]
        elif words:
            words += stripped.split()


def _reason(errors: list[str], code: int) -> str:
    if errors:
        return f"CalculiX failed: {'; '.join(errors)}"
    if code < 0:
        name = signal.Signals(-code).name if -code in set(signal.Signals) else str(-code)
        hint = "; it may need more memory" if name in ("SIGKILL", "SIGSEGV") else ""
        return f"CalculiX was ended by {name}{hint}"
    if code:
        return (
            f"CalculiX ended with exit code {code} and no message, as it does where the matrix is "
            "singular; check that the supports hold the part"
        )
    return "CalculiX ended before its job was finished"
