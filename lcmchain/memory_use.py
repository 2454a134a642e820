"""Memory of this process, as far as the system tells it."""

from __future__ import annotations

import os
import sys
from pathlib import Path


def largest_memory() -> int:
    """Return the most memory that this process has held so far [byte]; 0 where nothing tells it."""
    try:
        import resource
    except ImportError:  # Windows
        return 0
    largest = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return largest if sys.platform == "darwin" else 1024 * largest


def resident_memory() -> int:
    """Return the memory that this process holds [byte]; 0 where nothing tells it."""
    try:
        pages = Path("/proc/self/statm").read_text(encoding="ascii").split()[1]
        return int(pages) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, AttributeError):  # another system than Linux
        return 0
