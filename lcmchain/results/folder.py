"""The folder of a run's results: its summary and state, and one run at a time in it.

Hidden in ``.lcmchain`` lie the lock and the journal: the names of all files that the run writes,
each noted before the file appears. The next run knows by it what belongs to this one, however it
ended: it sets these files aside, and leaves alone what a user has put beside.
"""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from filelock import FileLock, Timeout

from lcmchain.atomic import announcing, protecting, remove_leftovers, replacing
from lcmchain.errors import InputError, OutputError

# --- state and summary of results -----------------------------------------------------------------
# The state stands as ``state`` in ``summary.json`` and on ``forming.nc``: ``running`` while a run
# is at work (or after it was killed), ``complete``, ``stopped: REASON`` where a guard or a failed
# stage ended it, ``interrupted`` where the user did.


SUMMARY_FILE = "summary.json"

RUNNING = "running"
COMPLETE = "complete"
INTERRUPTED = "interrupted"


def stopped(reason: object) -> str:
    """Return the state of results whose run ended for this reason."""
    return f"stopped: {reason}"


def write_summary(folder: Path, summary: Mapping) -> None:
    """Write ``summary.json``, whole or not at all."""
    with replacing(folder / SUMMARY_FILE) as path:
        path.write_text(json.dumps(summary, indent=2) + "\n", encoding="utf-8")


def read_summary(folder: Path) -> dict:
    """Read ``summary.json``; empty where there is none, or none that can be read."""
    try:
        summary = json.loads((folder / SUMMARY_FILE).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return summary if isinstance(summary, dict) else {}


def all_warnings(summary: Mapping) -> list[str]:
    """Return the warnings of forming, of every mapping and of every later stage."""
    later = [
        *summary["mapping"].items(),
        *summary.get("structure", {}).items(),
        *summary.get("infiltration", {}).items(),
    ]
    return [
        *summary["warnings"],
        *(f"{name}: {text}" for name, report in later for text in report.get("warnings", ())),
    ]


def read_state(folder: Path) -> str:
    """Return the state of the results in a folder that no run is at work in.

    A run that still calls itself running was killed: it is interrupted, and so is one that had no
    time to say anything.
    """
    state = str(read_summary(folder).get("state", INTERRUPTED))
    return INTERRUPTED if state == RUNNING else state


def require_complete(state: object, *, file: Path | str, allowed: bool = False) -> list[str]:
    """Refuse fields of a run that did not come to its end, or warn where they are ``allowed``.

    Parameters
    ----------
    state : the attribute ``state`` of ``forming.nc``; None where the file has none.

    Returns
    -------
    The warning, if there is one.

    Raises
    ------
    InputError : the run is not complete.
    """
    if state is None or state == COMPLETE:
        return []
    text = f'these are fields of an unfinished run (state "{state}")'
    if allowed:
        return [f"{file}: {text}"]
    raise InputError(
        f"{text}; finish the run with --resume, or pass --allow-incomplete to take the last frame "
        "as it is",
        file=file,
    )


# --- the folder, for one run at a time ------------------------------------------------------------


HIDDEN = ".lcmchain"
JOURNAL = "files"
PREVIOUS = "previous-"


class ResultsFolder:
    """A folder that one run writes its results into.

    Made by :meth:`locked`. Earlier results are not lost before the run is complete: they go to
    ``previous-complete``, ``previous-stopped`` or ``previous-interrupted`` inside the folder.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._hidden = path / HIDDEN
        self._journal = self._hidden / JOURNAL
        self._gathered = self._hidden / "previous"
        self._discarded = self._hidden / "discarded"
        self._noted: set[str] = set()
        self._begun = False
        self._require_no_input: Callable[[Path], None]

    @classmethod
    @contextmanager
    def locked(cls, path: Path, inputs: Iterable[Path] = ()) -> Iterator[ResultsFolder]:
        """Lock a folder for one run, and note every file that is written into it meanwhile.

        Parameters
        ----------
        path : made if it does not exist.
        inputs : files that the run reads and must never write over.

        Raises
        ------
        InputError : another run is at work in it, or a file to be written is one of the inputs.
        """
        results = cls(path)
        is_new = not path.exists()
        results._hidden.mkdir(parents=True, exist_ok=True)
        lock = FileLock(results._hidden / "lock")
        try:
            lock.acquire(timeout=0)
        except Timeout:
            raise InputError(
                f"another run is at work in this folder{_who(path)}; wait for its end, or name "
                "another folder with --out",
                file=path,
            ) from None
        try:
            with protecting(inputs) as results._require_no_input, announcing(results._note):
                yield results
        finally:
            # nothing was begun: leave the folder as it was
            if not results._journal.exists() and not results._gathered.exists():
                shutil.rmtree(path if is_new else results._hidden, ignore_errors=True)
            lock.release()

    @property
    def files(self) -> list[str]:
        """Names of the files that the run in this folder has written, relative to it."""
        return sorted(name for name in self._announced() if (self.path / name).exists())

    def require_apart(self, names: Iterable[str]) -> None:
        """Refuse to begin where a file to be written is one of the run's own inputs.

        Raises
        ------
        InputError : names the file.
        """
        for name in (*names, *self.files):
            self._require_no_input(self.path / name)

    def begin(self, *, resume: bool) -> None:
        """Begin a run: go on with the files that are there, or set them aside."""
        for folder in {(self.path / name).parent for name in (SUMMARY_FILE, *self._announced())}:
            remove_leftovers(folder)
        if self._discarded.exists():
            shutil.rmtree(self._discarded)
        if not resume:
            self._set_aside()
        self._journal.touch()
        self._noted = set(self.files)
        self._begun = True

    def remove_previous(self) -> None:
        """Remove what earlier runs left: the present one is complete."""
        for folder in self.path.glob(f"{PREVIOUS}*"):
            if (folder / HIDDEN / JOURNAL).exists():
                self._remove(folder)

    def _remove(self, folder: Path) -> None:
        """Remove a folder of results at once: a killed run leaves none that has lost a part."""
        os.replace(folder, self._discarded)
        shutil.rmtree(self._discarded)

    def _announced(self) -> set[str]:
        """Return the names in the journal, also of files that a killed run did not finish."""
        try:
            names = self._journal.read_text(encoding="utf-8").splitlines()
        except FileNotFoundError:
            return set()
        return {name for name in names if name}

    def _set_aside(self) -> None:
        """Move the files of an earlier run into a folder named after their state.

        They gather in a hidden folder, the summary and the journal last, before that folder gets
        its name: a run that is killed on the way leaves it to the next one to go on.
        """
        gathered, names = self._gathered, self.files
        if not names and not gathered.exists():
            return
        state = read_state(self.path if SUMMARY_FILE in names else gathered)
        previous = self.path / f"{PREVIOUS}{state.partition(':')[0]}"
        if previous.exists() and not (previous / HIDDEN / JOURNAL).exists():
            raise InputError(
                "earlier results have to go here, and this is no folder of results; rename it, or "
                "name another folder with --out",
                file=previous,
            )
        for name in sorted(names, key=lambda name: name == SUMMARY_FILE):
            (gathered / name).parent.mkdir(parents=True, exist_ok=True)
            os.replace(self.path / name, gathered / name)
            _remove_empty_folders(self.path / name, self.path)
        (gathered / HIDDEN).mkdir(exist_ok=True)
        if self._journal.exists():
            os.replace(self._journal, gathered / HIDDEN / JOURNAL)
        if previous.exists():
            self._remove(previous)
        os.replace(gathered, previous)

    def _note(self, file: Path) -> None:
        """Note a file that is about to appear, if it lies in this folder."""
        if not self._begun:
            return
        try:
            name = file.absolute().relative_to(self.path.absolute()).as_posix()
        except ValueError:
            return
        if name in self._noted:
            return
        self._noted.add(name)
        try:
            with open(self._journal, "a", encoding="utf-8") as journal:
                journal.write(f"{name}\n")
        except OSError as error:
            raise OutputError(error.strerror or str(error), file=self._journal) from error


def _remove_empty_folders(file: Path, top: Path) -> None:
    """Remove the folders that a moved file leaves empty, up to ``top``."""
    for folder in file.parents:
        if folder == top or any(folder.iterdir()):
            return
        folder.rmdir()


def _who(path: Path) -> str:
    run = read_summary(path).get("run")
    if not isinstance(run, dict):
        return ""
    return f" (process {run.get('process')} on {run.get('host')}, since {run.get('started')})"
