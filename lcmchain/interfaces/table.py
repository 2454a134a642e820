"""The scene's entry ``[[interfaces]]``: how two plies act on each other where they touch."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from lcmchain.quantities.entry_types import AbsentMeans, FrictionCoefficient, Number, Penalty, Range
from lcmchain.quantities.scene_model import SceneModel


class Interface(SceneModel):
    """Penalty contact and Coulomb friction between plies."""

    between: Annotated[tuple[str, str] | None, AbsentMeans("all plies")] = Field(
        default=None, description="Names of the two plies; without it all pairs."
    )
    friction: FrictionCoefficient = Field(default=0.0, description="Coulomb friction coefficient.")
    penalty: Annotated[Penalty | None, AbsentMeans("automatic")] = Field(
        default=None, description="Contact stiffness per area."
    )
    tangential_ratio: Annotated[float, Number(0.5, Range(0.0, 1.0, (0.0,)))] = Field(
        default=0.5, description="Tangential over normal contact stiffness."
    )
