"""Scene table of the files that a run writes."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from lcmchain.quantities.entry_types import AbsentMeans, PositiveTime, Switch
from lcmchain.quantities.scene_model import SceneModel

#: Samples of the histories over the process where ``history_interval`` is not given.
DEFAULT_SAMPLES = 200
MOST_SAMPLES = 100_000


class Output(SceneModel):
    """Which files a run writes beside its netCDF file and summary, and how fine its histories."""

    pictures: Switch = Field(default=True, description="Draw fields, forces and energies.")
    vtu: Switch = Field(
        default=True, description="Write the last frame and the time series for ParaView."
    )
    report: Switch = Field(
        default=True, description="Write report.html, with verdicts, curves and a 3D view."
    )
    history_interval: Annotated[
        PositiveTime | None, AbsentMeans(f"process.time / {DEFAULT_SAMPLES}")
    ] = Field(
        default=None,
        description="Time between two samples of forces, energies and travel; forces are means "
        "over it.",
    )
