"""Scene files from templates: text with ``$name`` where a value stands."""

from __future__ import annotations

import json
from importlib.resources import files
from string import Template


def filled(name: str, values: dict[str, str]) -> str:
    """Return a template with its values.

    Parameters
    ----------
    name : of the file in ``templates``, without ``.toml``.
    values : of all that the template asks for; more may be given.
    """
    text = (files(__package__) / "templates" / f"{name}.toml").read_text(encoding="utf-8")
    return Template(text).substitute(values)


def quoted(text: str) -> str:
    """Return a text as TOML writes it; its escapes are those of JSON."""
    return json.dumps(text, ensure_ascii=False)


def mm(length: float) -> str:
    """Return a length [m] as a scene gives it, to a micrometre."""
    return f"{round(1e3 * length, 3):g} mm"


def wrapped_comment(text: str) -> str:
    """Return a text as comment lines of a scene."""
    import textwrap

    lines = textwrap.wrap(text, width=96, break_long_words=False, break_on_hyphens=False)
    return "\n".join(f"# {line}" for line in lines)
