"""Kinematic draping: a pin-jointed net of inextensible fibres laid onto the surface of a tool."""

from lcmchain.draping.drape import Draped, drape
from lcmchain.draping.surface import is_drapable

__all__ = ["Draped", "drape", "is_drapable"]
