"""Scene table of the functional mock-up unit that a scene is built into."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from lcmchain.quantities.entry_types import Row, Text
from lcmchain.quantities.scene_model import SceneModel

MOST_PARAMETERS = 100


class Unit(SceneModel):
    """What a master may set in the functional mock-up unit of the scene."""

    parameters: Annotated[
        tuple[Annotated[str, Text("tools.holder.motion.mass")], ...],
        Row(
            '["tools.holder.motion.mass"]',
            entries="keys",
            units=False,
            maximum_count=MOST_PARAMETERS,
        ),
    ] = Field(
        default=(),
        description="Entries with one number that a master may set before initialization; "
        "contact.friction always is one.",
    )
