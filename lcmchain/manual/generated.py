"""The reference pages that are written from the code; a test compares them with what is kept."""

from __future__ import annotations

from pathlib import Path

from lcmchain.atomic import replacing
from lcmchain.manual.command_reference import Group, command_page
from lcmchain.manual.contents import FOLDER
from lcmchain.manual.effect_reference import effect_page
from lcmchain.manual.field_reference import field_page
from lcmchain.manual.preset_reference import preset_page
from lcmchain.manual.scene_reference import scene_page


def generated_pages(root: Group) -> dict[str, str]:
    """Return the Markdown of every generated page by topic; ``root`` is the group of commands."""
    return {
        "scene-reference": scene_page(),
        "effects": effect_page(),
        "presets": preset_page(),
        "fields": field_page(),
        "commands": command_page(root),
    }


def write_generated_pages(root: Group) -> list[Path]:
    """Write the generated pages beside this file and return their paths."""
    files = []
    for topic, text in generated_pages(root).items():
        files.append(FOLDER / f"{topic}.md")
        with replacing(files[-1]) as path:
            path.write_text(text, encoding="utf-8")
    return files
