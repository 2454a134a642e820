"""Folders of results: one run at a time, nothing of an earlier one between, and their state."""

from lcmchain.results.folder import ResultsFolder
from lcmchain.results.log import RunLog
from lcmchain.results.progress import ProgressLines
from lcmchain.results.state import (
    COMPLETE,
    INTERRUPTED,
    RUNNING,
    SUMMARY_FILE,
    all_warnings,
    read_state,
    require_complete,
    stopped,
    write_summary,
)

__all__ = [
    "COMPLETE",
    "INTERRUPTED",
    "RUNNING",
    "SUMMARY_FILE",
    "ProgressLines",
    "ResultsFolder",
    "RunLog",
    "all_warnings",
    "read_state",
    "require_complete",
    "stopped",
    "write_summary",
]
