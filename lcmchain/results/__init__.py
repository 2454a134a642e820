"""Folders of results.

folder.py locks the folder for one run, sets the files of an earlier one aside, and holds the
summary with the state of the results. log.py is what a run says while it goes on.
"""

from lcmchain.results.folder import (
    COMPLETE,
    INTERRUPTED,
    RUNNING,
    SUMMARY_FILE,
    ResultsFolder,
    all_warnings,
    read_state,
    require_complete,
    stopped,
    write_summary,
)
from lcmchain.results.log import ProgressLines, RunLog

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
