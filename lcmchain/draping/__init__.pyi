from .drape import Draped, drape
from .surface import is_drapable

__all__ = ["Draped", "drape", "is_drapable"]
