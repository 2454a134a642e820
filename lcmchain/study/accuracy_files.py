"""Files of a study of accuracy: tables, chart, and ``report.html`` with both."""

from __future__ import annotations

import base64
import csv
import math
from collections.abc import Iterator
from pathlib import Path

import matplotlib
import numpy as np
import xarray as xr
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from rich.table import Table

from lcmchain import __version__
from lcmchain.atomic import replacing
from lcmchain.fields.netcdf_file import ROOT, write_netcdf
from lcmchain.report.html import ASSETS as REPORT_ASSETS
from lcmchain.report.style import FAINT, INK, RC, SERIES, headline, new_figure, save
from lcmchain.study.accuracy import AccuracyStudy, Setting
from lcmchain.study.comparison import BY_NAME
from lcmchain.study.results import plain_table, short

# --- tables: for the terminal, as Markdown, as CSV and as netCDF ----------------------------------


#: Mark of a setting that no other one beats in both error and time.
EFFICIENT = "*"
#: What stands in place of the errors of the reference.
REFERENCE = "reference"


def headings(study: AccuracyStudy) -> list[str]:
    """Return the headings of the columns."""
    errors = [f"{BY_NAME[q].title} [{BY_NAME[q].unit}]" for q in study.quantities]
    return ["setting", "varied", "elements", "steps", "time [s]", *errors]


def rows(study: AccuracyStudy) -> Iterator[list[str]]:
    """Yield the cells of every setting, quickest first, and of the reference."""
    efficient = {
        q: {setting.variant.name for setting in study.efficient(q)} for q in study.quantities
    }
    for setting in sorted(study.settings, key=lambda s: s.seconds):
        yield [*_head(setting), *_errors(study, setting, efficient)]
    yield [*_head(study.reference), *[REFERENCE for _ in study.quantities]]


def _order_rows(study: AccuracyStudy) -> Iterator[list[str]]:
    """Yield quantity, observed order, and how far the scene's mesh is from the limit by it."""
    scene = next((s for s in study.settings if s.variant.name == study.as_it_is), None)
    for name in study.quantities:
        law = study.orders.get(name)
        if law is None or not math.isfinite(law.order):
            yield [BY_NAME[name].title, "none seen", "-"]
        else:
            size = scene.variant.value if scene is not None else None
            left = BY_NAME[name].text(law.error(size)) if size else "-"
            yield [BY_NAME[name].title, f"{law.order:.1f}", left]


def failures(study: AccuracyStudy) -> list[str]:
    """Say which settings gave no result, and why."""
    return [
        f"{s.variant.name}: no result, {s.outcome.failure}"
        for s in study.settings
        if s.outcome.failure
    ]


def terminal_table(study: AccuracyStudy) -> Table:
    """Return the table for the terminal."""
    table = plain_table(
        f"What accuracy costs: {study.title}",
        "setting", "time\ns", *(_short(q) for q in study.quantities),
        caption=f"root mean square over the sheet against the reference (last row); {EFFICIENT} no "
        "other setting\nis both quicker and nearer; those on its own mesh tell nothing of the mesh",
    )  # fmt: skip
    for name, _, _, _, seconds, *errors in rows(study):
        table.add_row(name, seconds, *("" if e == REFERENCE else e for e in errors))
    return table


def order_table(study: AccuracyStudy) -> Table:
    """Return the orders of convergence for the terminal."""
    names = ("quantity", "order", "error of the scene's mesh")
    table = plain_table("Convergence over the edge length", *names)
    for cells in _order_rows(study):
        table.add_row(*cells)
    return table


def markdown(study: AccuracyStudy) -> str:
    """Return tables of errors and orders as Markdown."""
    names = headings(study)
    lines = [f"## {study.title}", ""]
    if study.sentence():
        lines += [study.sentence() + ".", ""]
    lines += [f"| {' | '.join(names)} |", "|---|---" + "|---:" * (len(names) - 2) + "|"]
    lines += [f"| {' | '.join(cells)} |" for cells in rows(study)]
    if study.orders:
        lines += ["", "| | order over the three finest meshes | error of the scene's mesh by it |"]
        lines += ["|---|---:|---:|", *(f"| {' | '.join(cells)} |" for cells in _order_rows(study))]
    lines += ["", *(f"- {text}" for text in (*study.notes, *failures(study)))]
    return "\n".join(lines).rstrip() + "\n"


def _write_csv(path: Path, study: AccuracyStudy) -> None:
    """Write a row per setting, with typical, high (95 %) and largest error in SI or as parts."""
    kinds = ("typical", "high", "largest")
    errors = [f"{q}_{kind}" for q in study.quantities for kind in kinds]
    with replacing(path) as temporary, open(temporary, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(
            ["setting", "varied", "overrides", "elements", "steps", "threads", "seconds", *errors,
             "failure"]
        )  # fmt: skip
        for setting in (*study.settings, study.reference):
            numbers = setting.outcome.numbers
            writer.writerow(
                [
                    setting.variant.name, setting.variant.axis,
                    "; ".join(setting.variant.overrides),
                    int(numbers.get("element_count", 0)), int(numbers.get("step_count", 0)),
                    setting.outcome.threads, f"{setting.seconds:.4g}",
                    *(f"{getattr(setting.errors[q], k):.6g}" for q in study.quantities
                      for k in kinds),
                    setting.outcome.failure,
                ]
            )  # fmt: skip


def _write_study_netcdf(path: Path, study: AccuracyStudy) -> None:
    """Write times and errors over settings and quantities."""
    everything = (*study.settings, study.reference)
    kinds = ("typical", "high", "largest")
    error = np.array(
        [
            [[getattr(s.errors[q], kind) for kind in kinds] for q in study.quantities]
            for s in everything
        ]
    )
    about = "in SI, or as a part of the quantity; against the setting of the attribute reference"
    dataset = xr.Dataset(
        {
            "seconds": ("setting", [s.seconds for s in everything], {"units": "s"}),
            "error": (("setting", "quantity", "kind"), error, {"comment": about}),
            "element_count": (
                "setting", [s.outcome.numbers.get("element_count", np.nan) for s in everything],
            ),
            "step_count": (
                "setting", [s.outcome.numbers.get("step_count", np.nan) for s in everything],
            ),
            "order": (
                "quantity",
                [study.orders[q].order if q in study.orders else np.nan for q in study.quantities],
            ),
        },
        coords={
            "setting": [s.variant.name for s in everything],
            "quantity": study.quantities,
            "kind": list(kinds),
        },
        attrs={"title": study.title, "reference": study.reference.variant.name},
    )  # fmt: skip
    write_netcdf(path, {ROOT: dataset})


def _short(quantity: str) -> str:
    return f"{BY_NAME[quantity].short}\n{BY_NAME[quantity].unit}"


def _head(setting: Setting) -> list[str]:
    numbers = setting.outcome.numbers
    return [
        setting.variant.name,
        setting.variant.axis,
        f"{int(numbers['element_count']):,}" if "element_count" in numbers else "-",
        f"{int(numbers['step_count']):,}" if "step_count" in numbers else "-",
        f"{setting.seconds:.{3 if setting.seconds >= 1.0 else 2}g}",
    ]


def _errors(
    study: AccuracyStudy, setting: Setting, efficient: dict[str, set[str]]
) -> Iterator[str]:
    for name in study.quantities:
        error = setting.error(name)
        if math.isnan(error):
            yield "-"
            continue
        mark = EFFICIENT if setting.variant.name in efficient[name] else ""
        yield f"{short(BY_NAME[name].scale * error)}{mark}"


# --- chart: error against time, with the settings that no other one beats -------------------------


MARKERS = "osD^vP*Xph"
#: Room that a label takes [points].
LABEL_WIDTH, LABEL_HEIGHT = 55.0, 9.0


def _draw_chart(
    path: Path | str, study: AccuracyStudy, quantities: list[str] | None = None
) -> None:
    """Draw a panel per quantity: typical error over solver time, both logarithmic.

    Parameters
    ----------
    quantities : names of those to draw, all by default.
    """
    names = quantities or study.quantities
    columns = min(3, len(names))
    row_count = math.ceil(len(names) / columns)
    axes = list(dict.fromkeys(s.variant.axis for s in study.settings))
    with matplotlib.rc_context(RC):
        width, height = 3.25 * columns + 0.3, 2.75 * row_count + 1.3
        figure = new_figure(width, height)
        for k, name in enumerate(names):
            row, column = divmod(k, columns)
            place = (
                (0.62 + 3.25 * column) / width,
                1.0 - (0.95 + 2.75 * row + 2.15) / height,
                2.45 / width,
                2.15 / height,
            )
            _draw_panel(figure.add_axes(place), study, name, axes)
        handles = [
            matplotlib.lines.Line2D(
                [], [], ls="", marker=MARKERS[i % len(MARKERS)], color=SERIES[i % len(SERIES)],
                ms=5, label=axis,
            )
            for i, axis in enumerate(axes)
        ]  # fmt: skip
        handles.append(matplotlib.lines.Line2D([], [], color=INK, lw=1.0, label="efficient"))
        figure.legend(handles=handles, loc="lower center", ncol=min(4, len(handles)))
        headline(
            figure,
            "What accuracy costs in time",
            f"{study.title}; error against {study.reference.variant.name}",
        )
        save(figure, path)


def _draw_panel(panel, study: AccuracyStudy, name: str, axes: list[str]) -> None:
    quantity = BY_NAME[name]
    usable = [s for s in study.settings if math.isfinite(s.error(name)) and s.error(name) > 0.0]
    shown = [s for s in usable if not study.on_finest(s)]
    front = [s for s in study.efficient(name) if s in shown]
    panel.plot(
        [s.seconds for s in front], [quantity.scale * s.error(name) for s in front],
        color=INK, lw=1.0, zorder=1,
    )  # fmt: skip
    for setting in shown:
        i = axes.index(setting.variant.axis)
        panel.plot(
            setting.seconds, quantity.scale * setting.error(name), ls="",
            marker=MARKERS[i % len(MARKERS)], color=SERIES[i % len(SERIES)],
            ms=4.5, mec="white", mew=0.4, zorder=3,
        )  # fmt: skip
    panel.set_xscale("log")
    panel.set_yscale("log")
    panel.margins(x=0.16, y=0.16)
    for axis in (panel.xaxis, panel.yaxis):
        axis.set_major_formatter(lambda value, _: f"{value:g}")
        low, high = axis.get_view_interval()
        few = high < 30.0 * low
        axis.set_minor_formatter(lambda value, _, few=few: _minor(value) if few else "")
    _label(panel, name, [s for s in shown if s.variant.name == study.as_it_is], front)
    panel.grid(True, which="major", color="#e4e7ea", lw=0.6)
    panel.set_axisbelow(True)
    for side in ("top", "right"):
        panel.spines[side].set_visible(False)
    panel.set_title(f"{quantity.title}: error [{quantity.unit}]", loc="left")
    panel.set_xlabel("solver time [s]")
    panel.tick_params(which="both", length=2.5, color=FAINT)


def _minor(value: float) -> str:
    """Label 2 and 5 times a power of ten alone, so that labels do not run into each other."""
    digit = round(value / 10.0 ** math.floor(math.log10(value)))
    return f"{value:g}" if digit in (2, 5) else ""


def _label(panel, name: str, scene: list[Setting], front: list[Setting]) -> None:
    """Name the scene as it is and settings of the front, as far as their labels stay apart."""
    width, height = (panel.figure.get_size_inches() * 72.0) * panel.get_position().size
    (x0, x1), (y0, y1) = (
        [math.log(v) for v in limits] for limits in (panel.get_xlim(), panel.get_ylim())
    )
    scale = BY_NAME[name].scale
    taken: list[tuple[float, float]] = []
    for setting in [*scene, *(s for s in front if s not in scene)]:
        error = scale * setting.error(name)
        x = width * (math.log(setting.seconds) - x0) / (x1 - x0)
        y = height * (math.log(error) - y0) / (y1 - y0)
        if any(abs(x - a) < LABEL_WIDTH and abs(y - b) < LABEL_HEIGHT for a, b in taken):
            continue
        taken.append((x, y))
        right = x > 0.72 * width
        panel.annotate(
            setting.variant.name, (setting.seconds, error), (-4 if right else 4, 4),
            textcoords="offset points", ha="right" if right else "left", fontsize=6, zorder=4,
            weight="bold" if setting in scene else "normal", color=INK,
        )  # fmt: skip


# --- page: chart, tables and what they mean, in one file without network --------------------------


ASSETS = Path(__file__).resolve().parent / "assets"


def write_page(path: Path, study: AccuracyStudy, chart: Path) -> None:
    """Write the page of a study of accuracy, whole or not at all; ``chart`` is its PNG file."""
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
        orders=list(_order_rows(study)) if study.orders else [],
        notes=study.notes,
        failures=failures(study),
        chart="data:image/png;base64," + base64.b64encode(chart.read_bytes()).decode(),
        style=(REPORT_ASSETS / "report.css").read_text(encoding="utf-8"),
    )
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


# --- all files ------------------------------------------------------------------------------------


def write_accuracy(folder: Path, study: AccuracyStudy) -> list[Path]:
    """Write table, chart and page into a folder, and return the files."""
    files = [folder / f"accuracy.{suffix}" for suffix in ("csv", "nc", "md", "png")]
    files.append(folder / "report.html")
    table, data, text, chart, page = files
    _write_csv(table, study)
    _write_study_netcdf(data, study)
    with replacing(text) as temporary:
        temporary.write_text(markdown(study), encoding="utf-8")
    _draw_chart(chart, study)
    write_page(page, study, chart)
    return files
