"""A unit without any type of FMI: its life, its values, and its conduct whatever it is asked.

No public method of :class:`Unit` raises. What the standard forbids is refused with a message and
changes nothing; a step that cannot be done is undone. The adapters (:mod:`lcmchain.fmu.fmi2`,
:mod:`lcmchain.fmu.fmi3`) only translate, and a :class:`lcmchain.fmu.part.Part` is the physics.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from lcmchain.errors import LcmchainError
from lcmchain.fmu.conduct import (
    Messages,
    Phase,
    Refused,
    Report,
    Status,
    StepOutcome,
    catching,
    encodable,
    guarded,
    outermost,
    take_noted,
)
from lcmchain.fmu.part import Part, PartState, SavedState, UnitDefinition
from lcmchain.fmu.variables import STEP_OUTCOME, Kind, Layout, Outputs, Values, Variable

# A master that sums up its steps drifts from ours by rounding, relative to the experiment's length.
CLOCK_TOLERANCE = 1e-9


class Unit:
    """One instance of a unit.

    Inputs are held over a communication step. Outputs are those of the last communication point.

    Parameters
    ----------
    definition : what the unit is. part : its physics.
    name : of the instance.
    report : takes its messages.
    arrays : whether a field has one value reference (FMI 3) or one for every entry (FMI 2).
    """

    def __init__(
        self, definition: UnitDefinition, part: Part, name: str, report: Report, *, arrays: bool
    ) -> None:
        self.definition, self.part, self.name = definition, part, name
        self.layout = Layout(definition.variables, arrays=arrays)
        self.phase = Phase.INSTANTIATED
        self.outcome = StepOutcome.NOT_READY
        self.message = ""
        self.say = Messages(name, report)
        self._by_name = {variable.name: variable for variable in definition.variables}
        self._start_time: float | None = None if arrays else 0.0
        self._stop_time: float | None = None
        self._is_set_up = arrays  # FMI 3 has no call of its own for it
        self._built = False
        self._changed = False  # a parameter, since the simulation was built
        self._refusals: list[str] = []
        self.values = Values(self.layout)
        part.attach(self.values, self.say)
        self._stale: set[str] = set()
        self._stale_all()

    # --- course of a simulation -------------------------------------------------------------------

    @guarded
    @outermost
    def set_up(self, start_time: float, stop_time: float | None = None) -> Status:
        """Note when the experiment starts, and when it ends at the latest [s].

        Where nobody says when it starts, the first step does.
        """
        self._require("set up the experiment", Phase.INSTANTIATED)
        for what, value in (("start", start_time), ("stop", stop_time)):
            if value is not None and not math.isfinite(value):
                raise Refused(f"the {what} time is {value}")
        if stop_time is not None and stop_time < start_time:
            raise Refused(f"the stop time {stop_time:g} s lies before the start, {start_time:g} s")
        self._start_time, self._is_set_up = float(start_time), True
        self._stop_time = None if stop_time is None else float(stop_time)
        self._stale_all()
        return Status.OK

    @guarded
    def enter_initialization(self) -> Status:
        """Build and compile the simulation."""
        self._require("enter initialization mode", Phase.INSTANTIATED)
        if not self._is_set_up:
            raise Refused("initialization mode was asked for before the experiment was set up")
        self.phase = Phase.INITIALIZING
        self._rebuild()
        return Status.OK

    @guarded
    def exit_initialization(self) -> Status:
        """Take what was set in initialization mode, and check where results go."""
        self._require("leave initialization mode", Phase.INITIALIZING)
        self.phase = Phase.STEPPING
        if self.outcome is StepOutcome.INTERRUPTED:
            raise Refused("the user has interrupted the initialization; reset the unit")
        if self._changed or not self._built:
            self._rebuild()
        try:
            self.part.begin()
        except LcmchainError as error:
            self._built, self.message = False, str(error)
            raise
        self.outcome, self.message = StepOutcome.READY, ""
        return Status.OK

    @guarded
    @outermost
    def step(self, time: float, size: float) -> Status:
        """Advance from ``time`` to ``time + size`` [s] exactly, or change nothing and discard."""
        if take_noted():
            self.outcome = StepOutcome.INTERRUPTED
        obstacle = self._obstacle(time, size)
        self._refusals.clear()
        if obstacle:
            return self._discard(f"the step from {time:.9g} s by {size:.9g} s: {obstacle}")
        if self._is_past_the_stop(time + size):
            return self._discard(
                f"the step from {time:.9g} s to {time + size:.9g} s leads past the stop time, "
                f"{self._stop_time:.9g} s",
                status=Status.ERROR,
            )
        before = self.part.capture()
        try:
            self.part.use_threads()
            self.part.target = time + size - (self._start_time or 0.0)
            self._advance(size)
        except BaseException as error:
            self._undo(before)
            stopped = isinstance(error, KeyboardInterrupt)
            reason = "it was interrupted" if stopped else str(error) or type(error).__name__
            self._discard(
                f"the step from {time:.9g} s to {time + size:.9g} s was stopped and undone: "
                f"{reason}. Inputs of the step: {self.values.inputs_in_words()}",
                StepOutcome.INTERRUPTED if stopped else StepOutcome.UNDONE,
            )
            return Status.DISCARD
        self.outcome, self.message = StepOutcome.READY, ""
        self._stale_all()
        return Status.OK

    @guarded
    @outermost
    def terminate(self) -> Status:
        """Write the results."""
        self._require("terminate", Phase.STEPPING)
        self.phase = Phase.TERMINATED
        if self._built:
            self.part.finish(self.message)
        return Status.OK

    # --- values -----------------------------------------------------------------------------------

    @guarded
    @outermost
    def get_numbers(self, references: Sequence[int], kind: Kind) -> np.ndarray:
        """Return the values of variables that are no texts, one field after the other."""
        slots = self._located(references, kind)
        stale = {v.group for v in self.layout.touched(slots)} & self._stale
        for group in stale:
            self._refresh(group)
        return self.values.numbers[slots].copy()

    @guarded
    @outermost
    def get_texts(self, references: Sequence[int]) -> list[str]:
        """Return the values of texts."""
        touched = self._variables_of(self._located(references, Kind.STRING))
        self.values.texts["message"] = self.message
        return [encodable(self.values.texts[variable.name]) for variable in touched]

    @guarded
    @outermost
    def set_numbers(self, references: Sequence[int], values: Sequence[float], kind: Kind) -> Status:
        """Set parameters or inputs that are no texts; all of them or none."""
        slots = self._settable(references, kind)
        count = self.values.numbers[slots].size
        if len(values) != count:
            raise Refused(f"{len(values)} values were set for {count}")
        self._require_within_limits(slots, values)
        self.values.numbers[slots] = values
        return Status.OK

    @guarded
    @outermost
    def set_texts(self, references: Sequence[int], values: Sequence[object]) -> Status:
        """Set parameters that are texts; all of them or none."""
        touched = self._variables_of(self._settable(references, Kind.STRING))
        texts = [text for text in values if isinstance(text, str)]
        if len(values) != len(touched) or len(texts) != len(values):
            raise Refused("what was set is no text in UTF-8, or not one text for each variable")
        self.values.texts |= {variable.name: text for variable, text in zip(touched, texts)}
        return Status.OK

    # --- rollback ---------------------------------------------------------------------------------

    @guarded
    @outermost
    def save(self) -> SavedState | None:
        """Return a copy of the whole state, inputs included; None if there is none."""
        numbers, texts = self.values.settings()
        return SavedState(
            guid=self.definition.guid,
            fingerprint=self.definition.fingerprint,
            phase=self.phase,
            start_time=self._start_time,
            numbers=numbers,
            texts=texts,
            outcome=int(self.outcome),
            message=self.message,
            part=self.part.capture() if self._built else None,
        )

    @guarded
    @outermost
    def restore(self, saved: object) -> Status:
        """Go back to a saved state of this unit, of this process or another; it stays as it is."""
        state = self._own_state(saved)
        before = self.save()
        try:
            self._take(state)
        except BaseException:
            if isinstance(before, SavedState):
                self._take(before)
            raise
        return Status.OK

    def _own_state(self, saved: object) -> SavedState:
        """Return what was handed in as a state of this unit; refuse all else."""
        if isinstance(saved, LcmchainError):  # bytes that could not be read
            raise Refused(str(saved))
        if not isinstance(saved, SavedState):
            raise Refused("this is no state of a unit")
        if saved.guid != self.definition.guid:
            raise Refused("the state is that of another unit")
        mine = self.definition.fingerprint
        differing = [part for part in mine if saved.fingerprint.get(part) != mine[part]]
        if differing:
            raise Refused(
                f"the state was saved with other {' and '.join(differing)}; simulate up to it anew"
            )
        for name, values in saved.numbers.items():
            variable = self._by_name.get(name)
            if variable is None or values.shape != (variable.count,):
                raise Refused(f"the state holds {name} with {values.size} values")
        return saved

    def _take(self, saved: SavedState) -> None:
        old = self.values.settings()[0]
        same = all(
            np.array_equal(old[name], values, equal_nan=True)
            for name, values in saved.numbers.items()
            if self._decides_build(self._by_name[name])
        )
        self.values.take(saved.numbers, saved.texts)
        if saved.part is None:
            self._built = False
        else:
            if not self._built or not same:
                self._rebuild()
            self.part.reinstate(saved.part)
        self.phase, self._start_time = saved.phase, saved.start_time
        self._is_set_up = True
        if self.outcome is not StepOutcome.INTERRUPTED:
            self.outcome = StepOutcome(saved.outcome)
        self.message = saved.message
        self._changed = False
        self._refusals.clear()
        self._stale_all()

    # --- conduct ----------------------------------------------------------------------------------

    def refuse(self, reason: str, *, changes: bool) -> None:
        """Say that a call was refused. What should have changed something stops the next step.

        On Linux the text makes the call an error (``library/guard.h``). Elsewhere pythonfmu can
        only report success for a call that is no step, or end the instance. Many masters also
        ignore the status. They learn with their next step, which is discarded, that what they set
        was refused.
        """
        if changes:
            self._refusals.append(reason)
        self.say(reason, Status.ERROR)

    def interrupted(self) -> None:
        """Note that the user stopped the unit in another call than a step."""
        self.outcome = StepOutcome.INTERRUPTED

    def _obstacle(self, time: float, size: float) -> str:
        """Return why a step cannot even be tried, empty if it can."""
        if self.phase is not Phase.STEPPING:
            return f"the unit is {self.phase.value}"
        if self.outcome is StepOutcome.INTERRUPTED:
            return "the user has interrupted the unit; reset it to start over"
        if not self._built:
            return f"initialization has failed: {self.message or 'see the messages before'}"
        if self._refusals:
            return f"a call before it was refused: {'; '.join(dict.fromkeys(self._refusals))}"
        if not math.isfinite(time) or not math.isfinite(size):
            return "its time or size is no number"
        if size <= 0.0:
            return "its size is negative" if size < 0.0 else "its size is 0"
        start = time if self._start_time is None and self.part.present == 0.0 else self._start_time
        present = self.part.present + (start or 0.0)
        if abs(time - present) > CLOCK_TOLERANCE * max(self.definition.stop_time, abs(present)):
            return (
                f"the unit stands at {present:.9g} s, not at {time:.9g} s; go on from there, or "
                "restore a state of that time"
            )
        not_finite = self.values.not_finite()
        if not_finite:
            return not_finite
        self._start_time = start
        return ""

    def _is_past_the_stop(self, end: float) -> bool:
        """Return whether a time lies behind the stop time by more than masters sum up wrongly."""
        if self._stop_time is None:
            return False
        slack = CLOCK_TOLERANCE * max(self.definition.stop_time, abs(self._stop_time))
        return end > self._stop_time + slack

    def _discard(
        self,
        text: str,
        outcome: StepOutcome = StepOutcome.UNDONE,
        *,
        status: Status = Status.DISCARD,
    ) -> Status:
        if self.outcome in (StepOutcome.READY, StepOutcome.UNDONE):
            self.outcome, self.message = outcome, text
        self.say(text, status)
        return status

    @catching
    def _advance(self, size: float) -> None:
        self.part.advance(size)

    def _undo(self, before: PartState) -> None:
        self.part.reinstate(before)
        self._stale_all()

    def _rebuild(self) -> None:
        self._built = False
        try:
            self.part.build()
        except LcmchainError as error:
            self.message = str(error)
            raise
        self._built, self._changed = True, False
        self._stale_all()

    def _stale_all(self) -> None:
        self._stale = {variable.group for variable in self.definition.variables} - {""}

    def _refresh(self, group: str) -> None:
        """Compute the outputs of a group for the present state; 0 before there is one."""
        if group == "status":
            outcome = int(self.outcome)
            outputs: Outputs = {"status": outcome, STEP_OUTCOME.name: outcome}
        elif group == "time":
            outputs = {
                "time": (self._start_time or 0.0) + (self.part.present if self._built else 0.0)
            }
        elif self._built:
            outputs = self.part.outputs(group)
        else:
            return
        self.values.set_outputs(outputs)
        if group not in ("status", "time"):
            self._stale.discard(group)

    def _located(self, references: Sequence[int], kind: Kind) -> slice | np.ndarray:
        try:
            return self.layout.locate(references, kind)
        except KeyError as error:
            raise Refused(
                # The exporters hand unsigned numbers on as signed ones.
                f"no {kind.value} variable has the value reference {error.args[0] % 2**32}"
            ) from None

    def _variables_of(self, slots: slice | np.ndarray) -> list[Variable]:
        return [self.definition.variables[index] for index in self.layout.of_slot[slots]]

    def _settable(self, references: Sequence[int], kind: Kind) -> slice | np.ndarray:
        slots = self._located(references, kind)
        if self.phase is Phase.TERMINATED:
            raise Refused("values were set although the unit is terminated")
        for variable in self.layout.touched(slots):
            if variable.causality not in ("parameter", "input"):
                raise Refused(f"{variable.name} cannot be set: it is no parameter and no input")
            if variable.causality == "parameter":
                if self.phase is Phase.STEPPING:
                    raise Refused(
                        f"the parameter {variable.name} cannot be set after initialization"
                    )
                self._changed |= self._decides_build(variable)
        return slots

    def _require_within_limits(self, slots: slice | np.ndarray, values: Sequence[float]) -> None:
        """Refuse values outside of the limits that the model description states."""
        limits = [(v.minimum, v.maximum) for v in self.layout.touched(slots)]
        if limits.count((None, None)) == len(limits):  # as of all fields, with their many values
            return
        for variable, value in zip(self._variables_of(slots), values, strict=True):
            low, high = variable.minimum, variable.maximum
            if low is not None and value < low:
                raise Refused(f"{variable.name} was set to {value:g}; set it to {low:g} or more")
            if high is not None and value > high:
                raise Refused(f"{variable.name} was set to {value:g}; set it to {high:g} or less")

    @staticmethod
    def _decides_build(variable: Variable) -> bool:
        own = variable.causality == "parameter"
        return own and variable.name not in ("threads", "out_dir")

    def _require(self, what: str, phase: Phase) -> None:
        if self.phase is not phase:
            raise Refused(f"it was asked to {what}, but it is {self.phase.value}")
