"""Coulomb friction between sheet and tool, with an elastic slip.

Adds: a tangential force on a node in contact, at most the coefficient times the pressure force.
Source: return mapping of stick and slip, e.g. Wriggers, "Computational Contact Mechanics", section
5.2.
Stability limit: none beside that of the contact, whose stiffness is the larger one.
Scene: ``contact.friction``, ``tools.friction`` (0 for all: no springs are kept), and
``contact.tangential_ratio``.
Fields: ``tool_force``, ``energy_friction`` (history).
"""

from __future__ import annotations

import math

from lcmchain.effects.effect import Effect, EffectModel, Switch, refused
from lcmchain.elements.vectors import dot, plus
from lcmchain.jit import equation
from lcmchain.packs import choose


@equation
def friction(stick, slip_increment, normal, stiffness, limit):
    """Return the new elastic slip [m] and the friction force [N].

    ``stick`` (elastic slip of the tangential spring, [m]) is carried to the present tangent plane,
    grows by the relative displacement since the last step, and returns to the cone |F| <= limit.
    The slip is measured relative to the tool, so that a common motion produces none. Numbers, or
    packs of them.
    """
    out_of_plane = dot(stick, normal)
    trial = plus(-out_of_plane, normal, stick)
    trial = plus(1.0, trial, slip_increment)
    squared = dot(trial, trial)
    length = math.sqrt(squared)
    scale = choose(stiffness * length > limit, limit / (stiffness * length), 1.0)
    trial = (scale * trial[0], scale * trial[1], scale * trial[2])
    force = (-stiffness * trial[0], -stiffness * trial[1], -stiffness * trial[2])
    return trial, force


@equation
def friction_loss(before, after, way, stiffness):
    """Return what a friction spring takes for good [J] while the node moves on by a way [m].

    The work of its force is taken by the mean of the elastic slips ``before`` and ``after`` the
    step: that is what the motion loses by central differences. The part of it that the spring does
    not store is lost: by sliding, by the turn of the tangent plane, and where the node lifts off
    (``after`` is zero). If the work of sliding were taken at the end of the step instead, a node
    that the surface throws back within a few steps would lose up to half of its friction work
    uncounted.

    Parameters
    ----------
    before, after : elastic slip, whose forces acted at the two ends of the step [m].
    way : of the node relative to the tool [m].
    stiffness : of the spring [N/m].
    """
    mean = plus(1.0, before, after)
    stored = dot(after, after) - dot(before, before)
    return 0.5 * stiffness * (dot(mean, way) - stored)


SWITCH = Switch(
    entry="contact.friction, tools.friction",
    without="the forces along the tools' surfaces: draw-in and the tools' forces",
    called=lambda scene: any((tool.friction or 0.0) > 0.0 for tool in scene.tools),
    off=lambda scene: {
        "tools": tuple(tool.model_copy(update={"friction": 0.0}) for tool in scene.tools)
    },
    on=refused(
        "no tool has a coefficient of friction above 0; give contact.friction or tools.friction"
    ),
)


def active(model: EffectModel) -> list[Effect]:
    """Return one effect per tool."""
    return [
        Effect(f"friction on {name}", coefficient > 0.0, f"coefficient {coefficient:g}")
        for name, coefficient in zip(model.tool_names, model.tools.friction.tolist(), strict=True)
    ]
