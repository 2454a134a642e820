"""Units behind FMI 3.0, by pythonfmu3: this file only translates.

Getters and setters are of our own: fields travel whole, where the stock ones call a function for
every variable (and reshape with an argument that NumPy 2.4 no longer has).

Calls that are those of FMI 2.0 stand here once more, and in no common base class: pythonfmu3 may
look up a method in the dictionary of the very first class alone (``entry_fmi3.py``).
"""

from __future__ import annotations

from typing import Any
from xml.etree.ElementTree import Element

from pythonfmu3 import Fmi3Slave
from pythonfmu3.enums import Fmi3Status
from pythonfmu3.fmi3slave import Fmi3StepResult

from lcmchain.fmu.conduct import CATEGORIES, Phase, Status, outermost, watch
from lcmchain.fmu.description import model_description
from lcmchain.fmu.fmi2 import report_to, set_texts, whole
from lcmchain.fmu.instances import open_unit, read_state
from lcmchain.fmu.part import SavedState, Unreadable
from lcmchain.fmu.variables import Kind

# pythonfmu3 reads as many values as the master says, which may be more than there are: beyond the
# end of the list it would use nothing as an object. The guard of the library on Linux cuts the
# number; elsewhere this is how far it may be wrong.
SPARE = 1024

# First of the numbers that the guard of the library hands on as continuous states when a master
# enters initialization mode; start and stop time follow, the second where there is one
# (``library/fmi3.c``). The exporter itself drops them.
EXPERIMENT = -3.0e-300


class UnitSlave3(Fmi3Slave):
    """One instance of the unit in whose resources the entry file lies."""

    log_categories = CATEGORIES

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        watch()
        self.unit = open_unit(
            kwargs["resources"], self.instance_name, report_to(self.log_queue), arrays=True
        )
        self.guid = self.unit.definition.guid
        self._enumerations = {
            reference
            for reference, variable in enumerate(self.unit.definition.variables)
            if variable.is_enumeration
        }
        self._experiment: list[float] = []  # start time, and stop time where there is one
        self._spare = [float("nan")] * max(self.unit.layout.slot_count, SPARE)

    def to_xml(self, model_options: dict[str, str] | None = None) -> Element:
        """Return the model description of the unit."""
        return model_description(self.unit.definition, 3)

    # --- course of a simulation -------------------------------------------------------------------

    @outermost
    def enter_initialization_mode(self) -> None:
        if self._experiment and self.unit.phase is Phase.INSTANTIATED:
            if self.unit.set_up(*self._experiment) is not Status.OK:
                return
        self.unit.enter_initialization()

    @outermost
    def exit_initialization_mode(self) -> None:
        self.unit.exit_initialization()

    @outermost
    def do_step(self, current_time: float, step_size: float) -> Fmi3StepResult:
        return Fmi3StepResult(status=Fmi3Status(int(self.unit.step(current_time, step_size))))

    @outermost
    def terminate(self) -> None:
        self.unit.terminate()

    # --- access by value reference ----------------------------------------------------------------

    @outermost
    def get_float64(self, vrs: list[int]) -> list[float]:
        return self.unit.get_numbers(vrs, Kind.REAL).tolist() + self._spare

    @outermost
    def get_int32(self, vrs: list[int]) -> list[int]:
        return whole(self.unit.get_numbers(vrs, Kind.INTEGER).tolist()) + [0] * SPARE

    @outermost
    def get_boolean(self, vrs: list[int]) -> list[bool]:
        values = whole(self.unit.get_numbers(vrs, Kind.BOOLEAN).tolist())
        return [bool(value) for value in values] + [False] * SPARE

    @outermost
    def get_string(self, vrs: list[int]) -> list[str]:
        return self.unit.get_texts(vrs) + [""] * SPARE

    @outermost
    def get_int64(self, vrs: list[int]) -> list[int]:
        if not self._enumerations.issuperset(vrs):
            self.unit.refuse("only enumerations are read as 64-bit integers", changes=False)
            return [0] * (len(vrs) + SPARE)
        return self.get_int32(vrs)

    @outermost
    def get_uint64(self, vrs: list[int]) -> list[Any]:
        self.unit.refuse("there are no variables of unsigned integers", changes=False)
        return [_Zero()] * (len(vrs) + SPARE)

    @outermost
    def set_float64(self, vrs: list[int], values: list[float]) -> None:
        self.unit.set_numbers(vrs, values, Kind.REAL)

    @outermost
    def set_int32(self, vrs: list[int], values: list[int]) -> None:
        self.unit.set_numbers(vrs, values, Kind.INTEGER)

    @outermost
    def set_boolean(self, vrs: list[int], values: list[bool]) -> None:
        self.unit.set_numbers(vrs, values, Kind.BOOLEAN)

    @outermost
    def set_string(self, vrs: list[int], values: list[str]) -> None:
        set_texts(self.unit, vrs, values)

    @outermost
    def set_int64(self, vrs: list[int], values: list[int]) -> None:
        self.unit.refuse("there are no variables of 64-bit integers", changes=True)

    @outermost
    def set_uint64(self, vrs: list[int], values: list[int]) -> None:
        self.unit.refuse("there are no variables of unsigned integers", changes=True)

    # --- what a co-simulation unit without events answers -----------------------------------------

    @outermost
    def update_discrete_states(self) -> _NoEvents:
        return _NoEvents()

    @outermost
    def set_time(self, time: float) -> None:
        self.unit.refuse("the time of a co-simulation unit is not set", changes=False)

    @outermost
    def get_continuous_states(self) -> list[float]:
        return [0.0] * SPARE

    get_continuous_state_derivatives = get_continuous_states
    get_event_indicators = get_continuous_states

    @outermost
    def get_nominals_of_continuous_states(self, count: int) -> list[float]:
        return [1.0] * (max(count, 0) + SPARE)

    @outermost
    def set_continuous_states(self, values: list[float]) -> None:
        if values[:1] == [EXPERIMENT] and len(values) in (2, 3):
            self._experiment = values[1:]
        else:
            self.unit.refuse("the unit has no continuous states", changes=True)

    # --- rollback ---------------------------------------------------------------------------------

    @outermost
    def _get_fmu_state(self) -> SavedState | None:
        return self.unit.save()

    @outermost
    def _set_fmu_state(self, state: object) -> None:
        self.unit.restore(state)

    @staticmethod
    @outermost
    def _fmu_state_to_bytes(state: object) -> bytes:
        return state.to_bytes() if isinstance(state, SavedState) else b""

    @staticmethod
    @outermost
    def _fmu_state_from_bytes(state: bytes) -> SavedState | Unreadable:
        return read_state(state)


class _NoEvents:
    discreteStatesNeedUpdate = terminateSimulation = False
    nominalContinuousStatesChanged = valuesOfContinuousStatesChanged = nextEventTimeDefined = False


class _Zero:
    value = 0
