"""What ``lcmchain cosim`` does not take of a unit; the doctor says it in the same words."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from xml.etree.ElementTree import Element

#: Names that a sentence lists.
MOST_NAMES = 5


def version_problem(version: str) -> str:
    """Return why units of a version of FMI are not taken; nothing where they are."""
    if re.fullmatch(r"2\.0|3\.\d+(\.\d+)?", version):
        return ""
    if re.match(r"[23]\..*[A-Za-z]", version):
        return (
            f'is of FMI "{version}", a draft whose interface is not that of the standard; 2.0 and '
            "3.0 are read: export it again for one of these"
        )
    return f'is of FMI "{version}"; 2.0 and 3.0 are read'


def names_twice(root: Element) -> list[str]:
    """Return the names that stand in a model description more than once."""
    names = [entry.get("name", "") for entry in root.find("ModelVariables") or ()]
    return [name for name, count in Counter(names).items() if count > 1]


def left_out(root: Element) -> list[str]:
    """Return in sentences what is not taken of a unit, from the root of its model description."""
    variables = list(root.find("ModelVariables") or ())
    clocks = [v.get("name", "") for v in variables if v.tag == "Clock"]
    clocked = [v.get("name", "") for v in variables if v.tag != "Clock" and v.get("clocks")]
    binary = [v.get("name", "") for v in variables if v.tag == "Binary"]
    twice = names_twice(root)
    found = []
    if clocks:
        found.append(
            f"its clocks ({_some(clocks)}) do not tick, because lcmchain cosim offers none: what "
            "waits for them stands still" + (f" ({_some(clocked)})" if clocked else "")
        )
    if binary:
        found.append(f"its binary variables ({_some(binary)}) are left out")
    if twice:
        found.append(
            f"the names of variables are not unique ({_some(twice)}): lcmchain cosim cannot "
            "connect or set these; give each its own name"
        )
    return found


def _some(names: Sequence[str]) -> str:
    shown = ", ".join(names[:MOST_NAMES])
    return f"{shown} and {len(names) - MOST_NAMES} more" if len(names) > MOST_NAMES else shown
