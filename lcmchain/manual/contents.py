"""The pages of the manual, in the order in which they are read."""

from __future__ import annotations

import difflib
from dataclasses import dataclass
from pathlib import Path

from lcmchain.errors import InputError

FOLDER = Path(__file__).resolve().parent

#: Topics by section; a topic is the name of its file without ``.md``.
SECTIONS: dict[str, tuple[str, ...]] = {
    "Start": ("index", "tutorial", "new", "jobs"),
    "Jobs": (
        "run",
        "report",
        "pictures",
        "scene",
        "outlines",
        "stacks",
        "grippers",
        "stages",
        "pressure",
        "diaphragms",
        "coupons",
        "identification",
        "draping",
        "membrane-shell",
        "mapping",
        "structure",
        "infiltration",
        "formats",
        "fmu",
        "fields-of-units",
        "precice",
        "cosim",
        "verify",
        "study",
        "bench",
        "python",
    ),
    "Theory": (
        "element",
        "materials",
        "resin",
        "departures",
        "contact",
        "time-integration",
        "larger-steps",
        "coupling",
        "pore-pressure",
        "filling",
    ),
    "Evidence": (
        "hemisphere",
        "accuracy-table",
        "choice-table",
        "convergence-table",
        "regularisation-table",
        "verification",
        "benchmark-table",
        "hard-case-table",
        "coupling-table",
        "speed",
        "limits",
    ),
    "Reference": ("glossary", "scene-reference", "effects", "presets", "fields", "commands"),
    "Development": ("extending", "gpu"),
}

TOPICS: tuple[str, ...] = tuple(topic for topics in SECTIONS.values() for topic in topics)


@dataclass(frozen=True)
class Page:
    """One page: its topic, its title (the first heading) and its Markdown."""

    topic: str
    title: str
    text: str


def read_page(topic: str) -> Page:
    """Read the page of a topic.

    Raises
    ------
    InputError : no such topic; names the nearest one.
    """
    if topic not in TOPICS:
        raise InputError(f'the manual has no page "{topic}"; {_nearest(topic)}')
    text = (FOLDER / f"{topic}.md").read_text(encoding="utf-8")
    first_line, _, _ = text.partition("\n")
    if not first_line.startswith("# "):
        raise ValueError(f"{topic}.md does not begin with its title")
    return Page(topic, first_line.removeprefix("# ").strip(), text)


def read_pages() -> list[Page]:
    """Read all pages in their order."""
    return [read_page(topic) for topic in TOPICS]


def _nearest(topic: str) -> str:
    wanted = topic.lower().removesuffix(".md")
    within = [name for name in TOPICS if wanted and wanted in name]
    close = within or difflib.get_close_matches(wanted, TOPICS, n=1, cutoff=0.4)
    hint = f'did you mean "{close[0]}"? ' if close else ""
    return f"{hint}lcmchain docs --list names them all"
