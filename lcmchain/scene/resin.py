"""Scene table of the resin."""
from typing import Annotated
from pydantic import Field
from lcmchain.quantities.entry_types import Density, Quantity, POSITIVE
from lcmchain.quantities.units import Dimension
from lcmchain.quantities.scene_model import SceneModel
DYNAMIC_VISCOSITY = Dimension("viscosity", "Pa*s", "0.1 Pa*s", ("Pa*s", "mPa*s"), 1e-12, 1e12)
class Resin(SceneModel):
    viscosity: Annotated[float, Quantity(DYNAMIC_VISCOSITY, POSITIVE)]
    density: Density = Field(default="1100 kg/m^3")
