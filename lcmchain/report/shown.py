"""Face fields as they are shown: title, unit, colours, and numbers in words."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from matplotlib.cm import ScalarMappable


@dataclass(frozen=True)
class Shown:
    """How a face field is shown: file, title, unit, colours."""

    name: str
    title: str
    unit: str
    factor: float  # from SI to the unit shown
    colour_map: str
    signed: bool  # zero in the middle of the colours
    decimals: int
    lowest: float | None = None  # value of the first colour, where it is not the smallest one
    reaches: float | None = None  # value that the last colour has at least

    @property
    def label(self) -> str:
        """Title with its unit, for axes and headlines."""
        return f"{self.title} [{self.unit}]" if self.unit else self.title

    @property
    def axis_label(self) -> str:
        return self.label[:1].lower() + self.label[1:]

    def text(self, value: float) -> str:
        """Write a value with its unit."""
        unit = self.unit if self.unit == "°" else f" {self.unit}".rstrip()
        rounded = round(float(value), self.decimals) + 0.0  # no minus zero
        # typographic minus, as on axes
        return f"{rounded:.{self.decimals}f}".replace("-", "\N{MINUS SIGN}") + unit


SHOWN = (
    Shown("shear_angle", "Shear angle", "°", 180.0 / np.pi, "RdBu_r", True, 1),
    Shown("thickness", "Thickness", "mm", 1e3, "viridis", False, 3),
    Shown("fibre_volume_fraction", "Fibre volume fraction", "", 1.0, "YlGnBu", False, 3),
    Shown("wrinkle_height", "Height of wrinkles", "mm", 1e3, "PuOr_r", True, 2),
    Shown("wrinkle_risk", "Wrinkle risk", "", 1.0, "YlOrRd", False, 2, lowest=0.0, reaches=1.0),
    Shown("springback", "Springback", "mm", 1e3, "viridis", False, 2),
)

#: Fields of a stack of plies as a whole.
STACK_SHOWN = (
    Shown("stack_thickness", "Thickness of the stack", "mm", 1e3, "viridis", False, 3),
    Shown(
        "stack_fibre_volume_fraction", "Fibre volume fraction of the stack", "", 1.0, "YlGnBu",
        False, 3,
    ),
)  # fmt: skip

#: What plies do to each other, on the upper face of the lower one.
BETWEEN_SHOWN = (
    Shown("ply_pressure_top", "Pressure between plies", "kPa", 1e-3, "viridis", False, 2),
    Shown("slip_path_top", "Slip path between plies", "mm", 1e3, "cividis", False, 2),
)

# Smallest limit of the colours of signed fields, in the unit shown: noise looks like noise.
LEAST_LIMIT = {"°": 1.0, "mm": 0.1}

# Values beyond these percentiles do not stretch the colours when they lie far out.
PERCENTILES = (0.2, 99.8)


def colour_scale(values: np.ndarray, shown: Shown) -> ScalarMappable:
    """Return the colours of values in the unit shown; a few outliers do not flatten the rest."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    values = values[np.isfinite(values)]
    if len(values) == 0:
        return ScalarMappable(Normalize(0.0, 1.0), shown.colour_map)
    low, high = values.min(), values.max()
    inner_low, inner_high = np.percentile(values, PERCENTILES)
    # A few outliers only: the colours stay with the rest, and the bar gets arrows.
    slack = 0.25 * (inner_high - inner_low)
    low, high = max(low, inner_low - slack), min(high, inner_high + slack)
    if shown.signed:
        limit = max(abs(low), abs(high))
        limit = _round_limit(limit, shown)
        low, high = -limit, limit
    if shown.lowest is not None:
        low = shown.lowest
    if shown.reaches is not None:
        high = max(high, shown.reaches)
    if high - low < 1e-3 * max(abs(high), 1e-12):  # constant but for round-off
        middle = 0.5 * (low + high)
        low, high = middle - 0.005 * abs(middle), middle + 0.005 * abs(middle)
    return ScalarMappable(Normalize(low, high), shown.colour_map)


def _round_limit(limit: float, shown: Shown) -> float:
    """Return the next round number that the colours of a signed field end at."""
    least = LEAST_LIMIT.get(shown.unit, 0.0)
    if limit <= least:
        return least
    if shown.unit == "°":
        step = 5.0 if limit > 10.0 else 1.0
    else:
        step = 10.0 ** np.floor(np.log10(limit)) * 0.5
    return float(step * np.ceil(limit / step - 1e-9))
