"""``lcmchain docs [TOPIC]``, the manual in the browser, and ``schema``, scenes for editors."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import Annotated

import typer

from lcmchain.atomic import replacing
from lcmchain.commands.options import output_folder
from lcmchain.commands.terminal import console, say
from lcmchain.errors import InputError
from lcmchain.manual.command_reference import Group
from lcmchain.manual.contents import SECTIONS, read_page


def docs(
    context: typer.Context,
    topic: Annotated[
        str, typer.Argument(metavar="[TOPIC]", help="Page to open; --list names them.")
    ] = "index",
    list_topics: Annotated[
        bool, typer.Option("--list", help="List the pages instead of opening one.")
    ] = False,
    no_browser: Annotated[
        bool, typer.Option("--no-browser", help="Only print where the page lies.")
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", "-o", metavar="DIR", help="Build into this new folder; default the cache."
        ),
    ] = None,
    regenerate: Annotated[
        bool,
        typer.Option("--regenerate", help="For developers: write the reference pages again."),
    ] = False,
) -> None:
    """Open the manual in the browser."""
    if list_topics:
        _list_topics()
        return
    if regenerate:
        from lcmchain.manual.generated import write_generated_pages

        root = context.find_root().command
        assert isinstance(root, Group)
        for file in write_generated_pages(root):
            say(f"Wrote {file}")
        return
    from lcmchain.manual.site import build_site, cached_site

    page = read_page(topic)  # a wrong topic is told before anything is built
    if out is not None:
        build_site(out)
    file = (out or cached_site()) / f"{page.topic}.html"
    say(str(file))
    if not no_browser and _has_display():
        _open(file)


def _list_topics() -> None:
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for heading in ("section", "topic", "page"):
        table.add_column(heading)
    for section, topics in SECTIONS.items():
        for number, topic in enumerate(topics):
            table.add_row(section if number == 0 else "", topic, read_page(topic).title)
    console().print(table)


def _has_display() -> bool:
    """Tell whether a browser can show a window; on Linux a server has none."""
    if sys.platform in ("win32", "darwin"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def _open(file: Path) -> None:
    import webbrowser

    if not webbrowser.open(file.resolve().as_uri()):
        raise InputError("no browser can be started; open this file yourself", file=file)


def schema(
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", "-o", metavar="FILE", help="Write to a file instead of the terminal."
        ),
    ] = None,
) -> None:
    """Print the JSON Schema of scene files, for completion and checks in editors."""
    from lcmchain.scene import scene_json_schema

    text = json.dumps(scene_json_schema(), indent=2) + "\n"
    if out is None:
        sys.stdout.write(text)
        return
    with output_folder(out.parent), replacing(out) as path:
        path.write_text(text, encoding="utf-8")
