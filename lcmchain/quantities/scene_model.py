"""The base of every table of a scene file."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict


class SceneModel(BaseModel):
    """Base of all scene tables: frozen, and an unknown key is an error."""

    model_config = ConfigDict(frozen=True, extra="forbid", validate_default=True)
