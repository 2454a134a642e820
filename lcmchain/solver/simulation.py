"""A forming simulation that can be advanced to any time, saved, and restored."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from lcmchain.compilation.references import Reference
from lcmchain.compilation.threads import thread_count
from lcmchain.effects import fibre_bending
from lcmchain.effects.interaction import NO_BOUND, Bound, bound, in_places
from lcmchain.effects.process.pace import PaceLaw, next_pace
from lcmchain.elements.family import Body, Condition
from lcmchain.errors import InputError, SimulationError
from lcmchain.interfaces.change import change_interfaces
from lcmchain.interfaces.in_frames import FRAME_ROWS, frame_of_points
from lcmchain.interfaces.surfaces import InterfaceData
from lcmchain.model import Model, build_model
from lcmchain.scene.scene import Scene
from lcmchain.solver import guards, histories, rest, stages
from lcmchain.solver.interactions.contact_forces import find_near_nodes
from lcmchain.solver.loop import Arrays, LoopArguments, advance, in_order
from lcmchain.solver.recovery import diagnosis, halving_warnings
from lcmchain.state import (
    CHUNKS,
    CONTACT,
    CONTACT_DAMPING,
    CONTROLLING_ELEMENT,
    CONTROLLING_PART,
    DAMPING_RATE,
    EXTERNAL,
    FRICTION,
    HALVINGS,
    KINETIC,
    LAST_STEP,
    MASS_DAMPING,
    MEAN_KINETIC,
    MOST_HALVINGS,
    OMEGA2,
    PACE,
    PLY_REFRESH,
    RENEWAL,
    RENEWED,
    STAGE,
    TIME,
    Scratch,
    State,
)
from lcmchain.tools.motion import GUIDED, guided_load, prescribed_travel
from lcmchain.tools.table import lever, turning

# Steps between two looks at guards, contact search and step size: long enough to cost little,
# short enough that a fabric under compaction stiffens by less than step_safety allows for.
STEPS_PER_CHUNK = 50
# The in-plane frequency changes slowly: its bound, which costs as much as a hundred evaluations of
# the forces, is renewed every so many chunks, unless the sheet may stiffen in between; after a look
# that has found it calm only after as many as the second number. It is calm where ω² has risen by
# less than this part since the last look: what it may rise in three times as many chunks is little
# beside what step_safety leaves.
CHUNKS_PER_FREQUENCY = 8
CALM_CHUNKS_PER_FREQUENCY = 24
CALM_RISE = 1e-2
# Elements follow the curvature that they share with neighbours every so many chunks: their forces
# hardly depend on it (``elements/solid_shell/curvature.py``).
CHUNKS_PER_RENEWAL = 4
# Every change of the step shifts the energy that central differences conserve a little: a step that
# could be longer by less than this (of ω²) stays as it is.
STEP_HYSTERESIS = 0.98
# Nodes are searched for contact within the way that they may go until the next search, taken at
# this multiple of the present largest speed, and never below this part of the thickness.
SEARCH_SPEED_FACTOR = 3.0
SEARCH_THICKNESS_PART = 0.1

#: What limits the step where the viscosity of a fabric does, after "damping by".
VISCOUS_FABRIC = "the viscosity of the fabric"

# The search for contact looks ahead by a time that shrinks with ω. When it is compiled, that of the
# elements is not known yet: with a large one it looks ahead by little.
OMEGA2_OF_FIRST_SEARCH = 1e12

#: Name of what a frame of plies that touch holds beside arrays of the state.
BETWEEN_PLIES = "between_plies"


@dataclass(frozen=True)
class Snapshot:
    """What a saved frame holds.

    time [s]; energy by name [J], ``balance_error`` included; and the arrays of the state that are
    declared for frames (:class:`lcmchain.state.State`), as they are there, with plies that touch
    also what is between them.
    """

    time: float
    energy: dict[str, float]
    arrays: dict[str, np.ndarray]

    @property
    def position(self) -> np.ndarray:
        """Positions of the nodes (node_count, 3) [m]."""
        return np.ascontiguousarray(self.arrays["position"].T)

    @property
    def tool_travel(self) -> np.ndarray:
        """Travel of the tools (tool_count,) [m]."""
        return self.arrays["tool_travel"]

    @property
    def tool_force(self) -> np.ndarray:
        """Force of the sheets on the tools (tool_count, 3) [N]."""
        return self.arrays["tool_force"]

    @property
    def history(self) -> np.ndarray:
        """What laws with memory remember (history_size,)."""
        return self.arrays["history"]

    @property
    def contact_force(self) -> np.ndarray:
        """Sum of the normal forces of all tools on each node (node_count,) [N]."""
        return self.arrays["contact_force"]

    @property
    def pore_pressure(self) -> np.ndarray:
        """Pressure of the fluid in the elements, by lane (padded_count,) [Pa]; empty without."""
        return self.arrays["pore_pressure"]

    @property
    def between_plies(self) -> np.ndarray | None:
        """Contact between plies (FRAME_ROWS, node_count), see lcmchain.interfaces.in_frames."""
        return self.arrays.get(BETWEEN_PLIES)


@dataclass
class StepControl:
    """What limits the time step at present."""

    step: float = 0.0  # [s], with the safety factor
    element: int = -1
    cause: str = ""
    history: dict[str, int] = field(default_factory=dict)  # steps made under each cause


class Simulation:
    """One forming simulation.

    Parameters
    ----------
    model : constants; state : start, at rest in the reference when omitted.

    Raises
    ------
    InputError : the state of another model.
    """

    def __init__(self, model: Model, state: State | None = None) -> None:
        if state is not None:
            state.require_fits(model)  # compiled code does not look where an array ends
        self.model = model
        self.state = state or State.at_rest(model)
        if model.stages and state is None:
            stages.begin_first(model, self.state)
        self.control = StepControl()
        self._constants: tuple[Model, tuple[object, ...], Reference] | None = None
        self._loop_arguments: Reference | None = None
        self._orders: dict[int, tuple[tuple[Reference, ...], Reference | None]] = {}
        self._bind()

    @classmethod
    def from_scene(cls, scene: Scene) -> Simulation:
        """Build the simulation of a scene."""
        return cls(build_model(scene, pore_pressure=scene.wet_forming is not None))

    @property
    def time(self) -> float:
        """Present time [s]."""
        return self.state.time

    def restore(self, state: State) -> None:
        """Continue from a copy of ``state`` (checkpoint, rollback of a co-simulation step).

        Raises
        ------
        InputError : the state of another model.
        """
        state.require_fits(self.model)
        self.state = state.copy()
        self._bind()

    def set_velocity(self, velocity: np.ndarray) -> None:
        """Start with velocities (3, node_count) [m/s]; their energy counts as put in from outside.

        Without that entry the guard of the energy balance takes it for energy from nowhere.
        """
        mass, old = self.model.nodes.mass, self.state.velocity
        self.state.work[EXTERNAL] += 0.5 * np.sum(mass * (velocity**2 - old**2))
        old[:] = velocity

    def set_position(self, position: np.ndarray) -> None:
        """Start from positions (3, node_count) [m]; their strain energy counts as put in.

        The simulation must not have made a step yet. What vibrates at ω starts with the energy that
        central differences conserve, 1 - ω²dt²/4 of the strain energy.
        """
        before = self.stored_energy()
        self.state.position[:] = position
        self.state.work[EXTERNAL] += self.stored_energy() - before

    def stored_energy(self) -> float:
        """Return the strain energy with its hourglass part [J]."""
        energy = self.energy()
        return energy["internal"] + energy["hourglass"]

    def compile(self) -> None:
        """Compile (or load from the cache) every kernel that a run needs, without a step."""
        before = self.state.copy()
        for call in self.first_calls().values():
            call()
        self.prepare_steps()
        self.restore(before)

    def first_calls(self) -> dict[str, Callable[[], Any]]:
        """Return calls that compile what a run needs, by what they compute, the longest first.

        Each can be made without the others. They change the state, which has to be restored.
        """

        def search() -> None:
            self.state.clock[OMEGA2] = OMEGA2_OF_FIRST_SEARCH
            self.find_contact()

        calls: dict[str, Callable[[], Any]] = {
            "steps": lambda: self._advance(0, 1.0),
            "highest frequency": self._highest_frequency,
            "contact search": search,
            "shared curvature": self._renew,
            "pressures": lambda: self._step_of(OMEGA2_OF_FIRST_SEARCH, 0, 0),
            "condition of the elements": self.require_sound,
            "energies": self.energy,
        }
        if (plies := self.model.ply_contact) is not None:
            of_stages = [own.ply_contact for own in self.model.stages if own.ply_contact]
            if len({own.data.interface.tobytes() for own in of_stages}) > 1:
                calls["interfaces of stages"] = lambda: change_interfaces(
                    plies.data, plies.laws, self._arrays, 0.0
                )
            calls["contact between plies"] = lambda: self.between_plies(plies.data)
        if not self.model.tool_names:
            del calls["contact search"]
        if not self.model.pressed:
            del calls["pressures"]
        return calls

    def advance_to(self, time: float, on_chunk: Callable[[Simulation], None] | None = None) -> None:
        """Advance to ``time`` [s] exactly; call ``on_chunk`` after every chunk of steps.

        A time that has passed changes nothing: back leads ``restore`` alone, with a copy of the
        state that was taken then. Borders of stages on the way are met exactly too: a stage begins
        with the first step after the end of the one before.

        Raises
        ------
        InputError : the time is no finite number.
        SimulationError : a guard stopped the run; the state is that of the stop.
        """
        if not math.isfinite(time):
            raise InputError(f"advance_to: needs a time in s, not {time}")
        while self.time < time:
            self._begin_stage()
            stage = self.model.present_stage
            until = time if stage is None or self._is_last else min(time, stage.end)
            if rest.is_at_rest(self.model, self.state):
                rest.pass_time(self.model, self.state, until, self.energy())
            else:
                self._make_next_chunk(until)
            if on_chunk is not None:
                on_chunk(self)
        self.require_sound()

    def _make_next_chunk(self, until: float) -> None:
        """Make the next chunk of steps on the way to a time [s]."""
        step = self.prepare_steps()
        remaining = (until - self.time) / self.state.pace
        count = max(1, math.ceil(remaining / step))
        first_after_stop = rest.starts_again(self.model, self.state)
        chunk = 1 if first_after_stop else min(count, STEPS_PER_CHUNK)
        self._make_chunk(chunk, remaining / count)
        if first_after_stop:
            rest.book_start(self.model, self.state)
        if chunk == count:
            self.state.clock[TIME] = until
        if self.model.pace is not None:
            self._find_pace(self.model.pace, chunk * (remaining / count))
        stage = self.model.present_stage
        if stage is not None and stage.rest_energy is not None:
            rest.calm(self.model, self.state, self.stored_energy)

    @property
    def _is_last(self) -> bool:
        """Whether no stage follows the present one."""
        return self.model.stage + 1 == len(self.model.stages)

    def _begin_stage(self) -> None:
        """Go over to the next stage where the present one has ended."""
        while stages.is_over(self.model, self.state):
            number = self.model.stage + 1
            self.model = stages.begin_stage(self.model, self.state, number, self._arrays)

    def snapshot(self) -> Snapshot:
        """Return what a saved frame holds of the present."""
        arrays = self.state.frame()
        if self.model.ply_contact is not None:
            arrays[BETWEEN_PLIES] = self.between_plies(self.model.ply_contact.data)
        return Snapshot(self.time, self.energy(), arrays)

    def between_plies(self, data: InterfaceData) -> np.ndarray:
        """Return what a frame holds of the contact between plies (FRAME_ROWS, node_count)."""
        state, frame = self.state, np.empty((FRAME_ROWS, self.model.node_count))
        frame_of_points(
            data, state.position, state.ply_slope, state.ply_facet, state.ply_rows, frame
        )
        return frame

    def require_resolved(self) -> None:
        """Check from time to time that the mesh follows the deformation; for after every chunk.

        Raises
        ------
        SimulationError : the hourglass terms carry a large part of the load, and not for a moment;
            or much of the energy has vanished when the process ends.
        """
        if guards.resolution_is_due(self.model, self.state):
            energy = self.energy()
            guards.require_resolved(self.model, self.state, energy)
            guards.require_balanced(self.model, self.state, energy)

    def energy(self) -> dict[str, float]:
        """Return the energy balance [J]; ``inelastic`` is what laws with memory dissipated.

        ``viscous`` is what they dissipated by what resists the rate of the strain.

        ``internal`` and ``hourglass`` are potentials of the present strains, not the work of the
        internal forces: ``balance_error`` shows what time integration, the step size and the
        unsymmetric cross terms of Eqs. (15) and (19) have added or lost. All energies are those of
        the last step: its forces were taken at the positions before they moved on.
        """
        state = self.state
        position = state.position - state.last_step * state.velocity
        internal = hourglass = inelastic = viscous = 0.0
        for body in self.model.bodies:
            past = self._history(body)
            strain, stabilising = body.stored_energy(position, past)
            internal += strain
            hourglass += stabilising
            inelastic += body.dissipated_energy(past)
            viscous += body.viscous_energy(past)
        if self.model.fibre_bending is not None:
            internal += fibre_bending.stored_energy(self.model.fibre_bending, position)
        work = state.work
        energy = {
            "kinetic": work[KINETIC],
            "internal": internal,
            "hourglass": hourglass,
            "contact": work[CONTACT],
            "friction": work[FRICTION],
            **({"inelastic": inelastic} if self.model.remembers else {}),
            **({"viscous": viscous} if self.model.resists_rates else {}),
            "damping": work[CONTACT_DAMPING] + work[MASS_DAMPING],
            # what renewals of shared curvature and of springs put in comes from outside of them
            "external": work[EXTERNAL] - work[RENEWAL] - work[PLY_REFRESH],
        }
        energy = {name: float(value) for name, value in energy.items()}
        spent = sum(value for name, value in energy.items() if name != "external")
        energy["balance_error"] = spent - energy["external"]
        return energy

    def critical_step(self) -> float:
        """Return the stable step [s] of the present state, without the safety factor."""
        omega2, element, code = self._highest_frequency()
        return self._step_of(omega2, element, code, self._damping_rate())[0]

    def prepare_steps(self) -> float:
        """Check the elements, search for contact, and return the stable step [s], safety included.

        What it finds holds for the next ``STEPS_PER_CHUNK`` steps.

        Raises
        ------
        SimulationError : a guard stopped the run.
        """
        state = self.state
        conditions = self.require_sound()
        self._renew()
        present = float(state.clock[OMEGA2])
        renew = present == 0.0 or state.counters[CHUNKS] >= CHUNKS_PER_FREQUENCY
        if renew or self._may_stiffen(conditions, present):
            omega2, element, code = self._highest_frequency()
            calm = STEP_HYSTERESIS * present < omega2 < (1.0 + CALM_RISE) * present
            calm &= self._follow_damping()
            wait = CALM_CHUNKS_PER_FREQUENCY if calm else CHUNKS_PER_FREQUENCY
            state.counters[CHUNKS] = CHUNKS_PER_FREQUENCY - wait
            if not calm or omega2 > present:
                state.clock[OMEGA2] = omega2
                state.counters[CONTROLLING_ELEMENT] = element
                state.counters[CONTROLLING_PART] = code
        state.counters[CHUNKS] += 1
        self.find_contact()
        element = int(state.counters[CONTROLLING_ELEMENT])
        code = int(state.counters[CONTROLLING_PART])
        rate = float(state.clock[DAMPING_RATE])
        step, self.control.cause = self._step_of(float(state.clock[OMEGA2]), element, code, rate)
        step *= self.model.step_safety * state.step_factor
        self.control.step = step
        self.control.element = element
        return step

    def make_steps(self, count: int, step: float) -> None:
        """Make ``count`` steps of ``step`` [s], stable or not, without another search for contact.

        Samples of the histories that fall due on the way are taken; they change no step.

        Raises
        ------
        SimulationError : a position or velocity is no number any more.
        """
        self._make_sampled(count, step)
        self._count_steps(count)
        guards.require_finite(self.model, self.state, f"The steps of {step:.3g} s were given")

    def _make_chunk(self, count: int, step: float) -> None:
        """Make steps; where they end in no numbers, go back and halve the step, for good.

        Raises
        ------
        SimulationError : half the step does not cure it; the state is the one before the steps.
        """
        state, before = self.state, self._before
        before.set_to(state)
        self._make_sampled(count, step)
        node = guards.lost_node(state)
        tried = f"after {MOST_HALVINGS} halvings of the step"
        if node is not None and before.counters[HALVINGS] < MOST_HALVINGS:
            tried = "with half the step as well"
            count, step = 2 * count, 0.5 * step
            state.set_to(before)
            self._make_sampled(count, step)
            halvings = int(state.counters[HALVINGS])
            state.halvings[halvings] = (before.time, *before.position[:, node])
            state.counters[HALVINGS] += 1
            node = guards.lost_node(state)
        if node is not None:
            state.set_to(before)
            raise SimulationError(
                f"a position or velocity is not a number at node {node} (element "
                f"{self.model.element_at(node)}), {tried}. "
                + diagnosis(self.model, state, self.energy(), count * step)
            )
        self._count_steps(count)

    def _make_sampled(self, count: int, step: float) -> None:
        """Make steps, and take the samples of the histories that fall due between them."""
        made = 0
        while made < count:
            part = min(count - made, histories.steps_to_sample(self.model, self.state, step))
            self._advance(part, step)
            made += part
            if histories.is_due(self.model, self.state, step):
                histories.take_sample(self.model, self.state, self.energy())

    def _find_pace(self, law: PaceLaw, duration: float) -> None:
        """Let the process go on as fast as the sheet follows, after steps of a duration [s]."""
        state, work = self.state, self.state.work
        kinetic = float(work[KINETIC])
        spent = kinetic + float(work[MASS_DAMPING] + work[CONTACT_DAMPING] + work[FRICTION])
        state.clock[PACE], state.clock[MEAN_KINETIC] = next_pace(
            law,
            state.pace,
            float(state.clock[MEAN_KINETIC]),
            kinetic=kinetic,
            stored=float(work[EXTERNAL]) - spent,
            duration=duration,
        )

    def _count_steps(self, count: int) -> None:
        history = self.control.history
        history[self.control.cause] = history.get(self.control.cause, 0) + count

    def warnings(self) -> list[str]:
        """Say what the run did that nobody asked for."""
        return halving_warnings(self.model, self.state)

    def require_sound(self) -> list[Condition]:
        """Check that the state is sound, and return the condition of every body.

        Raises
        ------
        SimulationError : a guard found that it is not.
        """
        conditions = [
            body.condition(self.state.position, self._history(body)) for body in self.model.bodies
        ]
        for body, condition in zip(self.model.bodies, conditions, strict=True):
            guards.require_sound(self.model, self.state, body, condition)
        guards.require_outside(self.model, self.state)
        guards.require_on_the_face(self.model, self.state)
        guards.require_passive(self.model, self.state)
        return conditions

    @property
    def arrays(self) -> Reference:
        """What the compiled loops read and write, as long as no other state is restored."""
        return self._arrays

    def _bind(self) -> None:
        if self.model.stages:
            self.model = self.model.in_stage(int(self.state.counters[STAGE]), self.state)
        self._before = self.state.copy()
        self._scratch = Scratch.zeros(self.model)
        arrays: dict[str, Any] = {
            **self.model.nodes._asdict(), **self.state.as_dict(), **self._scratch.as_dict(),
        }  # fmt: skip
        if not self.model.lets_go:
            arrays["free"] = self.model.nodes.free  # nothing changes it
        self._arrays = Reference(Arrays(**arrays))

    def _advance(self, step_count: int, step: float) -> None:
        advance(self._arguments(), step_count, float(step))

    def _arguments(self) -> Reference:
        """Return what the loop works on, as long as model, arrays and threads are the present."""
        if self._constants is None or self._constants[0] is not self.model:
            interactions = in_places(tuple(map(Reference, self.model.interactions)))
            self._constants = self.model, interactions, Reference(self.model.environment)
            self._loop_arguments = None
        model, interactions, environment = self._constants
        bodies, bending = self._ordered()
        given = self._loop_arguments
        if given is None or given.arrays is not self._arrays or given.bodies is not bodies:
            given = self._loop_arguments = Reference(
                LoopArguments(
                    self._arrays, bodies, bending, interactions, environment, model.averaging
                )
            )
        return given

    def _ordered(self) -> tuple[tuple[Reference, ...], Reference | None]:
        """Return the bodies with their orders of a step for the present threads.

        And the fibres' bending, whose blocks lie where these orders have them.
        """
        batches = thread_count()
        if batches not in self._orders:
            self._orders[batches] = in_order(self.model, batches)
        return self._orders[batches]

    def _history(self, body: Body) -> np.ndarray:
        return self.model.history_of(body, self.state.history)

    def _highest_frequency(self) -> tuple[float, int, int]:
        """Return the largest ω² bound of all bodies, its element, and the code of its cause."""
        found = []
        for body in self.model.bodies:
            omega2, element, code = body.highest_frequency(
                self.state.position, self._history(body), self.model.nodes.mass
            )
            found.append((omega2, body.first_element + element, code))
        omega2, element, code = max(found, key=lambda bound: bound[0])
        return omega2 + self.model.fibre_bending_omega2, element, code

    def _damping_rate(self) -> float:
        """Return the largest rate c/m [1/s] of what resists the rate of the strain in a body."""
        return max(
            body.damping_rate(self.state.position, self._history(body))
            for body in self.model.bodies
        )

    def _follow_damping(self) -> bool:
        """Renew the bound of the damping rate, as that of ω²; tell whether it is calm."""
        present, rate = float(self.state.clock[DAMPING_RATE]), self._damping_rate()
        calm = STEP_HYSTERESIS * present <= rate <= (1.0 + CALM_RISE) * present
        if not calm or rate > present:
            self.state.clock[DAMPING_RATE] = rate
        return calm

    def _renew(self) -> None:
        """Renew what elements take from their neighbours, at the start and now and then."""
        state = self.state
        if state.counters[RENEWED] % CHUNKS_PER_RENEWAL == 0:
            half_before = state.position - 0.5 * state.clock[LAST_STEP] * state.velocity
            given = self.model.renew(state.position, state.history, half_before)
            state.work[RENEWAL] -= given
            state.counters[RENEWED] = 0
        state.counters[RENEWED] += 1

    def _may_stiffen(self, conditions: list[Condition], omega2: float) -> bool:
        bodies = zip(self.model.bodies, conditions, strict=True)
        return any(body.may_stiffen(condition, omega2) for body, condition in bodies)

    def find_contact(self) -> None:
        """Search for the nodes that can touch a tool within the next ``STEPS_PER_CHUNK`` steps."""
        state, model = self.state, self.model
        if not model.tool_names:
            return
        interval = STEPS_PER_CHUNK * 2.0 / math.sqrt(state.clock[OMEGA2])
        speed = math.sqrt(float(np.max(np.sum(state.velocity**2, axis=0))))
        tools = range(len(model.tool_names))
        ahead = np.array([self._coming_tool_speed(k, interval) for k in tools])
        reach = SEARCH_SPEED_FACTOR * (speed + ahead) * interval
        reach += SEARCH_THICKNESS_PART * max(body.material.thickness for body in model.bodies)
        reach += model.nodes.offset.max()
        stage = model.present_stage
        if stage is not None:
            reach[~stage.tools_at_work] = -np.inf
        find_near_nodes(self._arrays, model.tools, reach)
        if stage is not None and stage.absent is not None:
            state.near[:, stage.absent] = 0

    def _coming_tool_speed(self, tool: int, interval: float) -> float:
        """Return how fast a tool will move at most at the nodes [m/s]."""
        travel_speed = self._coming_travel_speed(tool, interval)
        if not turning(self.model.tools)[tool]:
            return travel_speed
        return travel_speed * lever(self.model.tools, tool, self.state.position.T)

    def _coming_travel_speed(self, tool: int, interval: float) -> float:
        state, tools, pace = self.state, self.model.tools, self.state.pace
        if state.driven[tool]:
            return abs(pace * float(state.tool_input[tool, 0]))
        then = self.time + pace * interval
        now = abs(float(state.tool_velocity[tool]))
        if tools.motion_kind[tool] == GUIDED:
            load = guided_load(tools, tool, float(state.tool_input[tool, 1]), then)
            return now + abs(load) / float(tools.mass[tool]) * interval
        return max(now, abs(pace * prescribed_travel(tools, tool, then)[1]))

    def _step_of(
        self, omega2: float, element: int, code: int, damping_rate: float = 0.0
    ) -> tuple[float, str]:
        """Return 2/ω with what the present interactions add to the elements', and the cause.

        A damping rate c/M that lags half a step behind is stable for ω²dt²/4 + (c/M) dt/2 <= 1.
        """
        model = self.model
        ahead = STEPS_PER_CHUNK * 2.0 / math.sqrt(omega2)
        bounds = [bound(one, model, self.state, ahead) for one in model.interactions]
        bounds.append(Bound(0.0, damping_rate, VISCOUS_FABRIC))
        largest = max(bounds, key=lambda one: one.omega2, default=NO_BOUND)
        cause = largest.cause
        if largest.omega2 <= omega2:
            cause = model.body_of_element(element).cause(code)
        total = sum((one.omega2 for one in reversed(bounds)), start=omega2)
        rate = sum(one.rate for one in bounds)
        step = 2.0 * (math.sqrt(0.25 * rate**2 + total) - 0.5 * rate) / total
        if step < 1.0 / math.sqrt(total):  # what resists a speed makes more of it
            cause = f"damping by {max(bounds, key=lambda one: one.rate).cause}"
        return step, cause
