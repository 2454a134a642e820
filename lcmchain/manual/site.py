"""Build the manual as HTML pages in a folder: complete, or not at all."""

from __future__ import annotations

import hashlib
import html
import json
import os
import shutil
import tempfile
import time
from importlib.metadata import version
from pathlib import Path
from string import Template

import platformdirs

from lcmchain.errors import InputError
from lcmchain.manual.contents import FOLDER, SECTIONS, TOPICS, Page, read_pages
from lcmchain.manual.markdown import Heading, code_style, plain_text, render

ASSETS = FOLDER / "assets"
PICTURES = FOLDER / "pictures"
MAXIMUM_AGE_DAYS = 30


def cached_site() -> Path:
    """Return the folder of the built manual in the user's cache; build it where it is missing.

    The folder is named by version and content, so that a new version never shows old pages.

    Raises
    ------
    InputError : the cache folder cannot be written.
    """
    parent = platformdirs.user_cache_path("lcmchain", appauthor=False) / "manual"
    folder = parent / f"{version('lcmchain')}-{_content_key()}"
    if folder.is_dir():
        os.utime(folder)  # last use, for the removal of stale folders
        return folder
    build_site(folder)
    _remove_stale(parent, folder)
    return folder


def build_site(folder: Path) -> None:
    """Write all pages, their pictures, style and search into a folder that does not exist yet.

    Raises
    ------
    InputError : the folder exists, or cannot be made or written.
    """
    if folder.exists():
        raise InputError("exists already; name a new folder", file=folder)
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        building = Path(tempfile.mkdtemp(dir=folder.parent, prefix=".manual-"))
    except OSError as error:
        raise InputError(
            f"the manual cannot be written here ({error.strerror}); name a folder with --out",
            file=folder,
        ) from None
    try:
        _write_site(building)
        building.chmod(0o755)  # mkdtemp makes folders private
        try:
            building.rename(folder)
        except OSError:
            if not folder.is_dir():  # else another process has built the same pages meanwhile
                raise
    finally:
        shutil.rmtree(building, ignore_errors=True)


def _write_site(folder: Path) -> None:
    pages = read_pages()
    template = Template((ASSETS / "page.html").read_text(encoding="utf-8"))
    for number, page in enumerate(pages):
        before = pages[number - 1] if number > 0 else None
        after = pages[number + 1] if number + 1 < len(pages) else None
        rendered = render(page.text)
        text = template.substitute(
            title=html.escape(page.title),
            version=html.escape(version("lcmchain")),
            navigation=_navigation(pages, page, rendered.headings),
            content=rendered.html,
            before=_neighbour(before, "before"),
            after=_neighbour(after, "after"),
        )
        (folder / f"{page.topic}.html").write_text(text, encoding="utf-8")
    shutil.copytree(PICTURES, folder / "pictures")
    style = (ASSETS / "style.css").read_text(encoding="utf-8")
    (folder / "style.css").write_text(style + code_style(), encoding="utf-8")
    index = [[page.topic, page.title, plain_text(page.text)] for page in pages]
    script = (ASSETS / "search.js").read_text(encoding="utf-8")
    (folder / "search.js").write_text(
        f"const pages = {json.dumps(index, ensure_ascii=False)};\n{script}", encoding="utf-8"
    )


def _navigation(pages: list[Page], here: Page, headings: list[Heading]) -> str:
    titles = {page.topic: page.title for page in pages}
    lines = []
    for section, topics in SECTIONS.items():
        lines.append(f"<h2>{section}</h2>\n<ul>")
        for topic in topics:
            current = ' aria-current="page"' if topic == here.topic else ""
            link = f'<a href="{topic}.html"{current}>{html.escape(titles[topic])}</a>'
            parts = [
                f'<li><a href="#{heading.anchor}">{html.escape(heading.text)}</a></li>'
                for heading in headings
                if topic == here.topic and heading.level == 2
            ]
            inner = f"<ul>{''.join(parts)}</ul>" if parts else ""
            lines.append(f"<li>{link}{inner}</li>")
        lines.append("</ul>")
    return "\n".join(lines)


def _neighbour(page: Page | None, side: str) -> str:
    if page is None:
        return "<span></span>"
    return f'<a class="{side}" href="{page.topic}.html">{html.escape(page.title)}</a>'


def _content_key() -> str:
    """Hash of everything that the pages are made of."""
    digest = hashlib.blake2b(digest_size=6)
    files = [FOLDER / f"{topic}.md" for topic in TOPICS]
    files += [*sorted(ASSETS.iterdir()), *sorted(PICTURES.iterdir()), *sorted(FOLDER.glob("*.py"))]
    for file in files:
        digest.update(file.name.encode() + b"\0")
        digest.update(hashlib.blake2b(file.read_bytes()).digest())
    return digest.hexdigest()


def _remove_stale(parent: Path, kept: Path) -> None:
    """Remove manuals of other versions that nobody has opened for a month."""
    oldest = time.time() - MAXIMUM_AGE_DAYS * 86400.0
    for folder in parent.iterdir():
        if folder != kept and folder.stat().st_mtime < oldest:
            shutil.rmtree(folder, ignore_errors=True)
