"""Scene table of the files that a run writes."""

from __future__ import annotations

from pydantic import Field

from lcmchain.quantities.entry_types import Switch
from lcmchain.quantities.scene_model import SceneModel


class Output(SceneModel):
    """Which files a run writes beside its netCDF file and summary."""

    pictures: Switch = Field(default=True, description="Draw fields, forces and energies.")
    vtu: Switch = Field(
        default=True, description="Write the last frame and the time series for ParaView."
    )
