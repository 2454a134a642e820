"""What state results are in: as ``state`` in ``summary.json`` and on ``forming.nc``.

``running`` while a run is at work (or after it was killed), ``complete``, ``stopped: REASON`` where
a guard or a failed stage ended it, ``interrupted`` where the user did.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

from lcmchain.atomic import replacing
from lcmchain.errors import InputError

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
