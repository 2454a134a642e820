"""Look of all figures: fonts and colours, how fields are shown, and names and captions of files."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lcmchain.atomic import replacing

if TYPE_CHECKING:
    from matplotlib.cm import ScalarMappable
    from matplotlib.figure import Figure


DPI = 200
INK = "#22272e"
FAINT = "#8a929c"
FIBRE_COLOURS = ("#1f5fa8", "#d1572a", "#3b8f4e")
#: Distinct for the common kinds of colour blindness (Okabe and Ito).
SERIES = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#7f7f7f")

RC: dict[Any, Any] = {
    "font.size": 8.5,
    "axes.titlesize": 9.0,
    "axes.labelsize": 8.5,
    "axes.edgecolor": "#5b636d",
    "axes.linewidth": 0.7,
    "axes.labelcolor": INK,
    "text.color": INK,
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "xtick.color": INK,
    "ytick.color": INK,
    "xtick.major.width": 0.7,
    "ytick.major.width": 0.7,
    "legend.fontsize": 7.5,
    "legend.frameon": False,
    "axes.unicode_minus": True,
}


def new_figure(width: float, height: float) -> Figure:
    """Return a figure [inches] that needs no display."""
    # Imported where something is drawn: a run reads the names of its files here at its start.
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), dpi=DPI, facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def save(figure: Figure, path: Path | str) -> None:
    """Write a figure as PNG.

    Raises
    ------
    InputError : the place cannot be written.
    """
    with replacing(path) as temporary:
        figure.savefig(temporary, format="png", dpi=DPI)


def headline(figure: Figure, title: str, subtitle: str) -> None:
    """Put title and subtitle at the upper left."""
    width, height = figure.get_size_inches()
    figure.text(0.3 / width, 1.0 - 0.17 / height, title, fontsize=12, weight="bold", va="top")
    figure.text(0.3 / width, 1.0 - 0.42 / height, subtitle, fontsize=8.5, color="#555d67", va="top")


# --- fields as they are shown ---------------------------------------------------------------------


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


#: Colour of faces without a value.
UNKNOWN = (1.0, 1.0, 1.0, 1.0)


def shades_of(colours: ScalarMappable, values: np.ndarray) -> np.ndarray:
    """Return the colours (F, 4) of values on faces (F,): white where there is none, not black."""
    return np.where(np.isnan(values)[:, None], UNKNOWN, colours.to_rgba(values))


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


# --- files of pictures ----------------------------------------------------------------------------


#: Picture of the start, which a check leaves in the folder of the results.
START_PICTURE = "initial.png"

#: Captions in the order in which pictures are shown.
CAPTIONS: dict[str, str] = {
    **{
        f"{shown.name}.png": f"{shown.title} on the formed shape: oblique, and from above with the "
        "initial outline and the places of the largest and the smallest value"
        for shown in SHOWN
    },
    **{
        f"{shown.name}.png": f"{shown.title}: all plies that lie over each other, told on the "
        "uppermost ply seen"
        for shown in STACK_SHOWN
    },
    **{
        f"plies_{shown.name}.png": f"{shown.title} of every ply, formed and from above, with its "
        "initial outline; the colours are the same for all plies"
        for shown in SHOWN
    },
    **{
        f"plies_{shown.name}.png": f"{shown.title}, on the upper face of each ply that another one "
        "lies on, from above; white where none does or ever did"
        for shown in BETWEEN_SHOWN
    },
    "courses.png": "Courses of the ply on the formed shape, and from above the gaps along their "
    "joints; overlaps are negative",
    "plies_courses.png": "Courses of the plies from above, with the gaps along their joints; "
    "overlaps are negative",
    "plies_fibre_directions.png": "Fibre lines of all families of every ply, formed and from above",
    "exploded.png": "Formed plies lifted off each other, with their shear angle and fibre lines",
    "fibre_directions.png": "Fibre lines of all families on the formed shape; they followed a "
    "fibre before forming",
    "tools.png": "Formed shape between the tools in their final position, which are transparent",
    "sections.png": "Sections through sheet and tools: to scale, and unrolled with the thickness "
    "stretched, so that gaps and penetrations show",
    "force.png": "Forces on the tools over the travel of the punch, or its angle, and over time "
    "with the travels",
    "force_over_travel.png": "Force on every tool over its own travel: mean over the intervals of "
    "the histories, and the band up to the largest force of a single step",
    "energy.png": "Energy balance, and kinetic energy and balance error as ratios",
}

#: Captions of the pictures of an infiltration, by what their names end in.
OF_FILLINGS = {
    "_filling_medium_time": "Infiltration: lines of equal fill time in the flow medium on the part",
    "_filling_time": "Infiltration: lines of equal fill time, with gates, vents and dry spots",
    "_filling_pressure": "Infiltration: pressure of the resin shortly before the part is full",
    "_filling_curves": "Infiltration: pressure and flow rate of the gates, volumes of resin",
}

#: What begins the names of the pictures of stages.
PREFIX = "stage_"
#: The pictures of every stage, by what their names end in.
CAPTIONS_OF_STAGE = {
    "tools": "the sheet between the tools that are at work, at the end of the stage",
    "sections": "sections through sheet and tools at the end of the stage",
    "shear_angle": "shear angle at the end of the stage",
}


def caption_of(file_name: str) -> str:
    """Return the caption of a picture, of any other file its name in words."""
    stem = file_name.rpartition("/")[2].rpartition(".")[0]
    if stem.startswith("animation"):
        return "Forming from the start to the end; colours and view are the same in all frames"
    if stem.startswith(PREFIX):
        for ending, caption in CAPTIONS_OF_STAGE.items():
            if stem.endswith(f"_{ending}"):
                number, _, name = (
                    stem.removeprefix(PREFIX).removesuffix(f"_{ending}").partition("_")
                )
                return f"Stage {number}, {name}: {caption}"
    for ending, caption in OF_FILLINGS.items():
        if stem.endswith(ending):
            return f"{caption} ({stem.removesuffix(ending)})"
    return CAPTIONS.get(f"{stem}.png", stem.replace("_", " ").replace("-", " "))


def picture_name(number: int, name: str, what: str) -> str:
    """Return the file of a picture of a stage, counted from 1."""
    return f"{PREFIX}{number}_{name}_{what}.png"
