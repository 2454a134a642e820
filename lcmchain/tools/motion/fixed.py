"""Tool at rest."""

from __future__ import annotations

from typing import Any, ClassVar, Literal

import numpy as np

from lcmchain.tools.motion.base import FIXED, ToolMotion


class FixedMotion(ToolMotion):
    """The tool does not move."""

    kind: ClassVar[int] = FIXED

    type: Literal["fixed"] = "fixed"

    def table_entries(self, axis: np.ndarray, process_time: float, *, key: str) -> dict[str, Any]:
        return self.columns(np.asarray(axis, dtype=float))
