"""Gravity: the weight of the sheets.

Adds: a force -m g along z on every node. A guided tool has a weight of its own
(:mod:`lcmchain.effects.tool_motion`).
Source: Belytschko, Liu, Moran, "Nonlinear Finite Elements", section 6.2.
Stability limit: none.
Scene: ``process.gravity``.
Fields: ``energy_external`` (history) holds its work.
"""

from __future__ import annotations

from typing import Any

from lcmchain.effects.effect import Effect


def active(model: Any) -> list[Effect]:
    g = model.environment.gravity
    reason = f"{g:g} m/s2 along -z on the sheet" if g > 0.0 else "process.gravity = false"
    return [Effect("gravity", g > 0.0, reason)]
