"""``report.html``: everything that a run has to say for itself, in one file without network."""

from __future__ import annotations

import base64
import io
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lcmchain import __version__
from lcmchain.atomic import replacing
from lcmchain.fields.dataset import HISTORY, SHEET
from lcmchain.judgements.grades import GRADES, worst_grade
from lcmchain.judgements.verdicts import verdicts
from lcmchain.report.chapters import dry_spot_rows, filling_rows, mapping_rows, stage_chapters
from lcmchain.report.numbers import (
    gripper_table,
    grouped_warnings,
    key_numbers,
    load_table,
    ply_numbers,
)
from lcmchain.report.page_data import curve_data, tool_data, view_data
from lcmchain.report.shown import CAPTIONS, caption_of
from lcmchain.report.style import SERIES
from lcmchain.results import COMPLETE

if TYPE_CHECKING:
    import xarray as xr

    from lcmchain.effects.effect import Effect
    from lcmchain.scene import Scene

REPORT_FILE = "report.html"
ASSETS = Path(__file__).resolve().parent / "assets"

#: Quality of the pictures in the report; the files beside it are without loss.
WEBP_QUALITY = 88


def write_report(
    folder: Path | str,
    scene: Scene,
    effects: Sequence[Effect],
    datasets: Mapping[str, xr.Dataset],
    summary: Mapping[str, Any],
    *,
    pictures: Sequence[str] = (),
) -> Path:
    """Write ``report.html`` into the folder of the results, complete or not at all.

    Parameters
    ----------
    folder : of the results.
    scene : of the run.
    effects : from :func:`lcmchain.check.run_effects`.
    datasets : groups of ``forming.nc``, also of a run that was stopped.
    summary : content of ``summary.json``; what it does not hold is left out.
    pictures : names of PNG files of the run in the folder.

    Raises
    ------
    InputError : the folder cannot be written.
    OutputError : writing failed on the way.
    """
    from jinja2 import Environment, FileSystemLoader, StrictUndefined
    from plotly.offline import get_plotlyjs

    environment = Environment(
        loader=FileSystemLoader(ASSETS), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    packed = list(_pictures(Path(folder), pictures))
    chapters = stage_chapters(summary, datasets, packed)
    in_chapters = {picture[0] for _, _, own in chapters for picture in own}
    text = environment.get_template("report.html").render(
        _content(scene, effects, datasets, summary),
        stages=chapters,
        pictures=[picture for picture in packed if picture[0] not in in_chapters],
        style=(ASSETS / "report.css").read_text(encoding="utf-8"),
        script=(ASSETS / "report.js").read_text(encoding="utf-8"),
        plotly=get_plotlyjs(),
    )
    path = Path(folder) / REPORT_FILE
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return path


def _content(
    scene: Scene,
    effects: Sequence[Effect],
    datasets: Mapping[str, xr.Dataset],
    summary: Mapping[str, Any],
) -> dict[str, Any]:
    sheet, history = datasets[SHEET], datasets[HISTORY]
    found = verdicts(summary, scene, datasets)
    counts = {grade: sum(v.grade == grade for v in found) for grade in reversed(GRADES)}
    return {
        "title": scene.title,
        "version": __version__,
        "state": summary.get("state", COMPLETE),
        "worst": worst_grade(found),
        "counts": {grade: count for grade, count in counts.items() if count},
        "verdicts": found,
        "numbers": [*key_numbers(summary), *ply_numbers(summary)],
        "loads": [
            (what, *table)
            for what, table in (
                ("tools", load_table(summary)),
                ("grippers", gripper_table(summary)),
            )
            if table[1]
        ],
        "warnings": grouped_warnings(summary),
        "data": {
            "series": SERIES,
            "curves": curve_data(history),
            "view": view_data(sheet, tool_data(scene, sheet, history)),
        },
        "effects": effects,
        "given": scene.source.given,
        "defaulted": scene.source.defaulted,
        "mappings": [(name, mapping_rows(r)) for name, r in summary.get("mapping", {}).items()],
        "fillings": [
            (name, list(filling_rows(r)), list(dry_spot_rows(r)))
            for name, r in summary.get("infiltration", {}).items()
        ],
        "provenance": list(_provenance_rows(summary.get("provenance", {}))),
        "scene_text": scene.source.text,
    }


def _pictures(folder: Path, names: Sequence[str]) -> Iterator[tuple[str, str, str]]:
    """Yield file name, caption and data address of pictures in the order of ``CAPTIONS``."""
    from PIL import Image

    order = list(CAPTIONS)
    for name in sorted(names, key=lambda n: order.index(n) if n in order else len(order)):
        packed = io.BytesIO()
        with Image.open(folder / name) as picture:
            picture.convert("RGB").save(packed, "WEBP", quality=WEBP_QUALITY)
        address = f"data:image/webp;base64,{base64.b64encode(packed.getvalue()).decode()}"
        yield name, caption_of(name), address


def _provenance_rows(origin: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield names and values of what :func:`lcmchain.provenance.provenance` gathers."""
    for name, value in origin.items():
        if name == "files":
            for entry in value:
                yield f"SHA-256 of {entry['file']} ({entry['key']})", entry["sha256"]
        elif name == "libraries":
            yield from value.items()
        elif value is not None:
            label = name.replace("_", " ").replace("sha256", "SHA-256")
            yield label, str(value)
