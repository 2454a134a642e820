"""CalculiX: run it, tell from its words whether it has solved, and read the files it leaves."""

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

import numpy as np

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
    path = shutil.which(command)
    if path is None and os.sep in command:
        raise InputError("is no program that can be run", file=command)
    return path


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
    counts: Counter[str] = Counter()
    example: dict[str, str] = {}
    for words in _texts(text, kind):
        key = re.sub(r"[-+\d.]+(?:[eE][-+]?\d+)?", "#", words)
        counts[key] += 1
        example.setdefault(key, words)
    told = [
        example[key] + (f" ({count} times)" if count > 1 else "")
        for key, count in counts.most_common(MOST_MESSAGES)
    ]
    rest = len(counts) - len(told)
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


# --- displacements: result files in ASCII (``.frd``) ----------------------------------------------
# Format: manual of CalculiX GraphiX, "Result format". Numbers have five digits after the point.

#: Last line of a whole file.
END = "9999"


@dataclass(frozen=True)
class NodalResult:
    """Displacements of one step, or of one mode of it.

    Parameters
    ----------
    mode : number of the mode from 1, 0 for a static step.
    value : frequency of the mode [Hz], or time of the step.
    node_ids : (N,). displacement : in the units of the deck, (N, 3).
    """

    mode: int
    value: float
    node_ids: np.ndarray
    displacement: np.ndarray


def read_displacements(path: Path | str) -> list[NodalResult]:
    """Read every block of displacements of a result file.

    Raises
    ------
    InputError : the file is absent, binary or broken.
    """
    path = Path(path)
    try:
        lines = path.read_text(encoding="latin-1").splitlines()
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", file=path) from None
    if not lines or lines[-1].strip() != END:
        raise InputError("this result of CalculiX has no end; was the run cut off?", file=path)
    results = []
    mode, value = 0, 0.0
    number = 0
    try:
        while number < len(lines):
            line = lines[number]
            number += 1
            if line.startswith("    1PSTEP"):
                mode = 0
            elif line.startswith("    1PMODE"):
                mode = int(line[10:])
            elif line.startswith("  100C"):
                value = float(line[12:24])
            elif line.startswith(" -4  DISP"):
                end = next(k for k in range(number, len(lines)) if lines[k].startswith(" -3"))
                rows = [row for row in lines[number:end] if row.startswith(" -1")]
                results.append(_block(mode, value, rows))
                number = end
    except (ValueError, StopIteration):
        raise InputError(
            f"the block at line {number} is no block of a CalculiX result in ASCII", file=path
        ) from None
    return results


def _block(mode: int, value: float, rows: list[str]) -> NodalResult:
    ids = np.array([int(row[3:13]) for row in rows], dtype=np.int64)
    parts = [[float(row[k : k + 12]) for k in (13, 25, 37)] for row in rows]
    return NodalResult(mode, value, ids, np.array(parts).reshape(-1, 3))


# --- eigenfrequencies, stresses and strains: printed results (``.dat``) ---------------------------

_NUMBER = r"[-+]?\d+\.\d+(?:E[-+]?\d+)?"
_MODE = re.compile(rf"\s+\d+((?:\s+{_NUMBER}){{4}})\s*")


@dataclass(frozen=True)
class PrintedResults:
    """What a ``.dat`` file holds, in the units of the deck.

    Parameters
    ----------
    frequencies : [Hz], (M,); an eigenvalue below zero, which has none, is not a number.
    element : of every integration point, (P,), in the order of the file.
    stress, strain : there, rows 11, 22, 33, 12, 13, 23 in the axes of the element, (P, 6); shear
        strains are tensor components, half the engineering ones.
    """

    frequencies: np.ndarray
    element: np.ndarray
    stress: np.ndarray
    strain: np.ndarray


def read_printed(path: Path | str) -> PrintedResults:
    """Read the printed results of the steps that :mod:`lcmchain.mapping.structure.deck` writes.

    Raises
    ------
    InputError : the file is absent or broken.
    """
    path = Path(path)
    try:
        lines = path.read_text(encoding="latin-1").splitlines()
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", file=path) from None
    frequencies: list[float] = []
    points: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    for number, line in enumerate(lines):
        if "E I G E N V A L U E   O U T P U T" in line:
            frequencies = _frequencies(lines, number + 1)
        elif line.startswith((" stresses (elem", " strains (elem")):
            points[line.split()[0]] = _points(lines, number + 1, path)
    nothing = np.empty(0, dtype=np.int64), np.empty((0, 6))
    element, stress = points.get("stresses", nothing)
    same, strain = points.get("strains", nothing)
    if not np.array_equal(element, same):
        raise InputError("stresses and strains are of different elements", file=path)
    return PrintedResults(np.array(frequencies), element, stress, strain)


def _frequencies(lines: list[str], first: int) -> list[float]:
    frequencies: list[float] = []
    for line in lines[first:]:
        match = _MODE.fullmatch(line)
        if match is None:
            if frequencies:
                break
            continue
        eigenvalue, _, cycles, _ = (float(text) for text in match[1].split())
        frequencies.append(cycles if eigenvalue >= 0.0 else np.nan)
    return frequencies


def _points(lines: list[str], first: int, path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Elements (P,) and components (P, 6) of the table whose head stands before ``first``."""
    elements, rows = [], []
    try:
        for line in lines[first + 1 :]:
            if not line.strip():
                break
            words = line.split()
            elements.append(int(words[0]))
            # Signs may leave no blank between two numbers, which have 14 characters each.
            rows.append([float(line[14 * k + 14 : 14 * k + 28]) for k in range(6)])
    except (ValueError, IndexError):
        raise InputError("the table of stresses is broken; was the run cut off?", file=path) from (
            None
        )
    return np.array(elements, dtype=np.int64), np.array(rows).reshape(-1, 6)
