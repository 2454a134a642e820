"""The files of a study of accuracy."""

from __future__ import annotations

from pathlib import Path

from lcmchain.atomic import replacing
from lcmchain.study.accuracy import AccuracyStudy
from lcmchain.study.chart import draw_chart
from lcmchain.study.page import write_page
from lcmchain.study.tables import markdown, write_csv, write_study_netcdf


def write_accuracy(folder: Path, study: AccuracyStudy) -> list[Path]:
    """Write table, chart and page into a folder, and return the files."""
    files = [folder / f"accuracy.{suffix}" for suffix in ("csv", "nc", "md", "png")]
    files.append(folder / "report.html")
    table, data, text, chart, page = files
    write_csv(table, study)
    write_study_netcdf(data, study)
    with replacing(text) as temporary:
        temporary.write_text(markdown(study), encoding="utf-8")
    draw_chart(chart, study)
    write_page(page, study, chart)
    return files
