"""What a coupon test gives: curves, comparisons with the analytic solution, files and figures."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import matplotlib
import numpy as np
from rich.table import Table

from lcmchain.atomic import replacing
from lcmchain.fields import write_forming_netcdf, write_vtu
from lcmchain.report.pictures import draw_field
from lcmchain.report.style import RC, SHOWN, headline, new_figure, save

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes


@dataclass(frozen=True)
class Comparison:
    """A simulated quantity beside its reference; ``origin`` says where that comes from."""

    quantity: str
    unit: str
    value: float
    reference: float
    origin: str

    @property
    def difference(self) -> float:
        """Difference in the unit of the quantity."""
        return self.value - self.reference

    @property
    def relative(self) -> float:
        """Difference relative to the reference."""
        return self.difference / self.reference


def compared(
    curves: Mapping[str, np.ndarray],
    displacement: float,
    name: str,
    unit: str,
    *,
    reference: str,
    origin: str,
) -> Comparison:
    """Compare a curve with that of its reference at a displacement [mm].

    reference : what the name of the reference's curve begins with; origin : where it comes from.
    """
    u = curves["displacement [mm]"]
    return Comparison(
        f"{name} at {displacement:.3g} mm",
        unit,
        float(np.interp(displacement, u, curves[f"{name} [{unit}]"])),
        float(np.interp(displacement, u, curves[f"{reference} {name} [{unit}]"])),
        origin,
    )


@dataclass(frozen=True)
class CouponResult:
    """Result of a coupon test.

    Parameters
    ----------
    name : as in ``lcmchain coupon NAME``.
    settings : geometry, mesh and speed, as texts with units.
    curves : columns of equal length by heading ("force [N]"), as written to ``curve.csv``.
    comparisons : with the analytic solution.
    draw : draws the curves into the file that it is given.
    datasets : groups of ``forming.nc``, where the coupon has them; ``shown`` names the field that
        is drawn on the deformed specimen.
    figures : further numbers by name, as written to ``coupon.json``.
    """

    name: str
    settings: Mapping[str, str]
    curves: Mapping[str, np.ndarray]
    comparisons: tuple[Comparison, ...]
    draw: Callable[[Path], None]
    datasets: Mapping[str, xr.Dataset] | None = None
    shown: str = ""
    figures: Mapping[str, object] = field(default_factory=dict)

    def table(self) -> Table:
        """Return the comparisons as a table for the terminal."""
        table = Table(title=f"{self.name}: {', '.join(self.settings.values())}")
        justify: Literal["left", "right"]
        for heading in ("quantity", "simulated", "reference", "difference", "", "reference from"):
            justify = "left" if heading in ("quantity", "reference from") else "right"
            table.add_column(heading, justify=justify)
        for c in self.comparisons:
            table.add_row(
                c.quantity, f"{c.value:.4g} {c.unit}", f"{c.reference:.4g} {c.unit}",
                f"{c.difference:+.2g} {c.unit}", f"{c.relative:+.2%}", c.origin,
            )  # fmt: skip
        return table


def write_coupon(folder: Path, result: CouponResult, remarks: Sequence[str] = ()) -> list[Path]:
    """Write curves, pictures, fields and comparisons into ``folder``; returns the files.

    ``remarks``: what a reader of the numbers has to know of the material.
    """
    files = [folder / "curve.csv", folder / f"{result.name}.png", folder / "coupon.json"]
    with replacing(files[0]) as path:
        np.savetxt(
            path,
            np.column_stack(list(result.curves.values())),
            fmt="%.8g",
            delimiter=",",
            header=",".join(result.curves),
            comments="",
        )
    result.draw(files[1])
    with replacing(files[2]) as path:
        summary = {
            "coupon": result.name,
            "settings": dict(result.settings),
            "comparisons": [
                asdict(c) | {"difference": c.difference, "relative": c.relative}
                for c in result.comparisons
            ],
            "figures": dict(result.figures),
            "warnings": list(remarks),
        }
        path.write_text(json.dumps(summary, indent=2) + "\n", encoding="utf-8")
    if result.datasets is not None:
        files += [folder / "forming.nc", folder / "forming.vtu"]
        write_forming_netcdf(files[-2], result.datasets)
        write_vtu(files[-1], result.datasets)
        for shown in SHOWN:
            if shown.name == result.shown:
                files.append(folder / f"{shown.name}.png")
                draw_field(files[-1], result.datasets["/"], shown)
    return files


# --- figures --------------------------------------------------------------------------------------


@contextmanager
def two_panels(path: Path, title: str, subtitle: str) -> Iterator[tuple]:
    """Yield the two axes of a figure that is saved at the end."""
    with matplotlib.rc_context(RC):
        figure = new_figure(9.6, 3.9)
        left = figure.add_axes((0.07, 0.135, 0.40, 0.67))
        right = figure.add_axes((0.56, 0.135, 0.40, 0.67))
        yield left, right
        headline(figure, title, subtitle)
        save(figure, path)


def finish(axis: Axes) -> None:
    """Grid, open frame, and an ordinate from zero."""
    finish_loop(axis)
    axis.set_xlim(left=0.0)
    axis.set_ylim(bottom=0.0)


def finish_loop(axis: Axes) -> None:
    """Grid and open frame, for curves on both sides of zero."""
    axis.grid(True, color="#e4e7ea", lw=0.6)
    axis.set_axisbelow(True)
    axis.spines["top"].set_visible(False)
    axis.spines["right"].set_visible(False)
    axis.tick_params(length=2.5)
