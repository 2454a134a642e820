"""Numbers beyond which a result is questionable: its warnings and its verdicts read them here."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

#: Error of the energy balance, in parts of what :func:`balance_scale` names.
LARGEST_BALANCE_ERROR = 0.01
#: Kinetic in parts of the internal energy when the process ends: the sheet is at rest below it,
LARGEST_KINETIC_PART_AT_END = 0.05
#: and during the process: inertia is no part of forces and shape below it,
LARGEST_KINETIC_PART = 0.1
#: where it is not exceeded over more than this part of the stroke.
LONGEST_DYNAMIC_PART = 0.1
#: Where the pace is found: a sheet with less than this part of its largest internal energy is only
#: touched, and the kinetic energy is compared with that part. A run of the holder's hemisphere that
#: was seven times above the limit up to there had the same shape at its end, to 0.01 degrees.
TOUCHED_PART = 0.01
#: Work of damping in parts of the external work.
LARGEST_DAMPING_PART = 0.05
#: Hourglass in parts of the internal energy.
LARGEST_HOURGLASS_PART = 0.05
#: Change of a force while elements are drawn over a radius, in parts of it. Half of it is how far
#: the force may be from its mean; the 5 mm elements of the paper on a fillet of 10 mm make 6 %.
LARGEST_RIPPLE = 0.1
#: Depth that nodes reach inside a tool, in parts of the thickness.
LARGEST_PENETRATION = 0.1
#: The same inside another ply, in parts of the thickness of the thinner one of the two.
LARGEST_PLY_DEPTH = 0.1
#: Thickness that the depths of nodes in tools add to a sheet between them, in parts of it, and the
#: force over the thickness that they take, in parts of it.
LARGEST_HIDDEN_THICKNESS = 0.01
LARGEST_HIDDEN_FORCE = 0.02
#: Strain of fibres. The most brittle reinforcement, carbon, breaks at three times as much (1.5 %,
#: data sheet of T300); glass and aramid bear more.
LARGEST_FIBRE_STRAIN = 0.005
#: Root-mean-square distance of a mapping's target from the sheet, in parts of the thickness: half a
#: thickness off lies the face of the sheet, and a target may be meshed on it.
LARGEST_TARGET_DISTANCE = 0.55

#: Elements per wavelength below which a wave of the sheet is not resolved; half as many form none.
LEAST_ELEMENTS_PER_WAVE = 8

#: A share this many times its threshold makes a result bad, no longer doubtful.
BAD = 3.0
#: Part of the area of the sheet up to which an excess is local: doubtful, and bad beyond.
LOCAL_AREA = 0.01


def balance_scale(summary: Mapping[str, Any]) -> str:
    """Say what the error of the energy balance is compared with."""
    if summary.get("strained", True):
        return "of the largest internal energy"
    return "of the largest part of the balance (the sheet is not strained)"
