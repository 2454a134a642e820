"""``report.html`` of a study: chart, tables and what they mean, in one file without network."""

from __future__ import annotations

import base64
from pathlib import Path

from lcmchain import __version__
from lcmchain.atomic import replacing
from lcmchain.report.html import ASSETS as REPORT_ASSETS
from lcmchain.study.accuracy import AccuracyStudy
from lcmchain.study.tables import failures, headings, order_rows, rows

ASSETS = Path(__file__).resolve().parent / "assets"


def write_page(path: Path, study: AccuracyStudy, chart: Path) -> None:
    """Write the page of a study of accuracy, whole or not at all; ``chart`` is its PNG file."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader(ASSETS), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    text = environment.get_template("accuracy.html").render(
        title=study.title,
        version=__version__,
        sentence=study.sentence(),
        reference=study.reference.variant.name,
        headings=headings(study),
        rows=list(rows(study)),
        orders=list(order_rows(study)) if study.orders else [],
        notes=study.notes,
        failures=failures(study),
        chart="data:image/png;base64," + base64.b64encode(chart.read_bytes()).decode(),
        style=(REPORT_ASSETS / "report.css").read_text(encoding="utf-8"),
    )
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
