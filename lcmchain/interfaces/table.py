"""The scene's entry ``[[interfaces]]``: how two plies act on each other where they touch."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from lcmchain.quantities.entry_types import (
    AbsentMeans,
    FrictionCoefficient,
    Name,
    Number,
    Penalty,
    Range,
    Row,
)
from lcmchain.quantities.scene_model import SceneModel


class Interface(SceneModel):
    """How two plies press and slide on each other where they touch."""

    between: Annotated[
        tuple[Annotated[str, Name("ply_1")], Annotated[str, Name("ply_2")]] | None,
        Row('["ply_1", "ply_2"]', count=2, entries="names", units=False),
        AbsentMeans("all plies that touch"),
    ] = Field(
        default=None,
        description="Two plies, or two materials of [materials] for all plies of theirs.",
    )
    friction: FrictionCoefficient = Field(default=0.0, description="Coulomb friction coefficient.")
    penalty: Annotated[Penalty | None, AbsentMeans("automatic")] = Field(
        default=None, description="Contact stiffness per area."
    )
    tangential_ratio: Annotated[float, Number(0.5, Range(0.0, 1.0, (0.0,)))] = Field(
        default=0.5, description="Tangential over normal contact stiffness."
    )
