"""Picture of the errors that a mapping adds to its fields, on the target."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np

from lcmchain.mapping.picture import UNMAPPED_COLOUR, drawn_target, height_of
from lcmchain.mapping.report import MappingReport
from lcmchain.mapping.sheet import FIBRE_FAMILIES
from lcmchain.mapping.target import TargetMesh
from lcmchain.mapping.transfer import MappedFields
from lcmchain.report.renderer import axes_at, draw_colour_bar, draw_facets, fit_axis
from lcmchain.report.shown import Shown, colour_scale
from lcmchain.report.style import FAINT, RC, headline, new_figure, save
from lcmchain.report.view import FROM_ABOVE

COLOURS = "YlOrRd"
SHOWN = (
    Shown("thickness", "Thickness", "µm", 1e6, COLOURS, False, 2, lowest=0.0),
    Shown("fibre_volume_fraction", "Fibre volume fraction", "", 1.0, COLOURS, False, 5, lowest=0.0),
    Shown("areal_fibre_mass", "Areal fibre mass", "g/m²", 1e3, COLOURS, False, 3, lowest=0.0),
    Shown("shear_angle", "Shear angle", "°", 180.0 / np.pi, COLOURS, False, 3, lowest=0.0),
    *(
        Shown(name, name.replace("_", " ").capitalize(), "°", 180.0 / np.pi, COLOURS, False, 3,
              lowest=0.0)
        for name in FIBRE_FAMILIES
    ),
)  # fmt: skip
PANEL, BAR = 4.2, 1.35  # width of a panel and of the colour bar beside it [in]
LEFT, GAP, TOP, BOTTOM = 0.25, 0.4, 0.95, 0.0  # around the panels [in]


def draw_errors(
    path: Path | str, target: TargetMesh, mapped: MappedFields, report: MappingReport
) -> None:
    """Draw the errors of up to six fields on the target (PNG), the worst cell of each ringed."""
    shown = [one for one in SHOWN if one.name in mapped.errors]
    # From above, where no cell hides another but on upright walls.
    mesh, view = drawn_target(target), FROM_ABOVE
    height = height_of(view, [mesh])
    rows = max(-(-len(shown) // 2), 1)
    with matplotlib.rc_context(RC):
        size = (2 * (LEFT + PANEL + BAR), TOP + rows * (height + GAP) + BOTTOM)
        figure = new_figure(*size)
        for number, field in enumerate(shown):
            left = LEFT + (number % 2) * (LEFT + PANEL + BAR)
            bottom = size[1] - TOP - (number // 2) * (height + GAP) - height
            axis = axes_at(figure, left, bottom, PANEL, height)
            bar = axes_at(figure, left + PANEL + 0.05, bottom + 0.18 * height, 0.16, 0.64 * height)
            errors = field.factor * mapped.errors[field.name]
            colours = colour_scale(errors, field)
            painted = colours.to_rgba(np.nan_to_num(errors))
            painted[np.isnan(errors)] = UNMAPPED_COLOUR
            draw_facets(axis, mesh.corners, view, painted[mesh.cell], rim=mesh.rim, shaded=False)
            fit_axis(axis, view.on_screen(mesh.corners).reshape(-1, 2), 0.02)
            axis.set_axis_off()
            if np.isfinite(errors).any():
                worst = int(np.nanargmax(errors))
                place = view.on_screen(1e3 * target.centroids[worst][None])[0]
                axis.plot(*place, "o", ms=9, mfc="none", mec="black", mew=1.0, zorder=5)
                text = f"{field.title}: largest {field.text(float(errors[worst]))}, cell {worst}"
                axis.set_title(text, color=FAINT, loc="left")
            draw_colour_bar(figure, bar, colours, errors, field)
        note = "difference to a mapping between twice finer meshes; a ring marks the worst cell"
        headline(figure, f"{report.name}: error that the mapping adds", note)
        save(figure, path)
