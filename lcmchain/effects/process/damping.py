"""Mass-proportional damping of the nodes, of all their motion or of the unsteady part of it.

Adds: a force -α m v, or -α m (v - w) with the mean w of the node's velocity over about the time τ:
τ dw/dt = v - w. The latter is a dashpot between the node and a companion of mass α τ m that nothing
else holds. Steady drawing is not resisted, vibrations faster than τ are damped as by the former,
and slower motions feel the companion's inertia instead of a drag.
Source: Belytschko, Liu, Moran, "Nonlinear Finite Elements", section 6.2; the companion: own.
Stability limit: none, since the damping is averaged over the step.
Scene: ``process.mass_damping`` (0 switches it off), ``process.damping_average``.
Fields: ``energy_damping``, ``history_energy_mass_damping`` (history): work of the force above.
"""

from __future__ import annotations

from lcmchain.effects.effect import Effect, EffectModel, Switch, of_table, refused
from lcmchain.jit import equation


@equation
def damped_velocity(velocity, acceleration, damping, interval):
    """Return v(n+½) from v(n-½), with the damping force at the mean of both."""
    half = 0.5 * damping * interval
    # the factor is the same for all nodes: one division outside their loop
    return ((1.0 - half) * velocity + interval * acceleration) * (1.0 / (1.0 + half))


@equation
def averaged_velocity(average, velocity, part):
    """Return the running mean w of a velocity after an interval, a part of the time constant τ."""
    return average + part * (velocity - average)


SWITCH = Switch(
    entry="process.mass_damping",
    without="what calms vibrations of the sheet",
    called=lambda scene: scene.process.mass_damping > 0.0,
    off=of_table("process", mass_damping=0.0),
    on=refused("its rate is 0; give process.mass_damping"),
)


def active(model: EffectModel) -> list[Effect]:
    rate, time = model.environment.mass_damping, model.averaging
    of = "" if time is None else f" of the motion relative to its mean over {1e3 * time:g} ms"
    return [Effect("mass damping", rate > 0.0, f"{rate:g} 1/s{of}")]
