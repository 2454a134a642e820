"""Units behind FMI 2.0, by pythonfmu: this file only translates."""

from __future__ import annotations

import ctypes
import math
from typing import Any, NamedTuple
from xml.etree.ElementTree import Element

from pythonfmu import Fmi2Slave

from lcmchain.fmu.conduct import CATEGORIES, Report, Status, outermost, watch
from lcmchain.fmu.description import model_description
from lcmchain.fmu.instances import open_unit, read_state
from lcmchain.fmu.part import SavedState, Unreadable
from lcmchain.fmu.unit import Unit
from lcmchain.fmu.variables import Kind

# Where a list of CPython keeps the address of its entries: after its count, type and length.
_ENTRIES_OF_LIST = 3 * ctypes.sizeof(ctypes.c_void_p)


class UnitSlave2(Fmi2Slave):
    """One instance of the unit in whose resources the entry file lies."""

    log_categories = CATEGORIES

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        watch()
        self.unit = open_unit(
            kwargs["resources"], self.instance_name, formatted(self.log_queue), arrays=False
        )
        self.guid = self.unit.definition.guid

    def to_xml(self, model_options: dict[str, str] | None = None) -> Element:
        """Return the model description of the unit."""
        return model_description(self.unit.definition, 2)

    # --- course of a simulation -------------------------------------------------------------------

    @outermost
    def setup_experiment(
        self, start_time: float, stop_time: float | None = None, tolerance: float | None = None
    ) -> None:
        self.unit.set_up(start_time, stop_time)

    @outermost
    def enter_initialization_mode(self) -> None:
        self.unit.enter_initialization()

    @outermost
    def exit_initialization_mode(self) -> None:
        self.unit.exit_initialization()

    @outermost
    def do_step(self, current_time: float, step_size: float) -> bool:
        return self.unit.step(current_time, step_size) is Status.OK

    @outermost
    def terminate(self) -> None:
        self.unit.terminate()

    # --- access by value reference, of many values at once ----------------------------------------

    @outermost
    def get_real(self, vrs: list[int]) -> list[float]:
        return self.unit.get_numbers(vrs, Kind.REAL).tolist()

    @outermost
    def get_integer(self, vrs: list[int]) -> list[int]:
        return whole(self.unit.get_numbers(vrs, Kind.INTEGER).tolist())

    @outermost
    def get_boolean(self, vrs: list[int]) -> list[bool]:
        return [bool(v) for v in whole(self.unit.get_numbers(vrs, Kind.BOOLEAN).tolist())]

    @outermost
    def get_string(self, vrs: list[int]) -> list[str]:
        return self.unit.get_texts(vrs)

    @outermost
    def set_real(self, vrs: list[int], values: list[float]) -> None:
        self.unit.set_numbers(vrs, values, Kind.REAL)

    @outermost
    def set_integer(self, vrs: list[int], values: list[int]) -> None:
        self.unit.set_numbers(vrs, values, Kind.INTEGER)

    @outermost
    def set_boolean(self, vrs: list[int], values: list[bool]) -> None:
        self.unit.set_numbers(vrs, values, Kind.BOOLEAN)

    @outermost
    def set_string(self, vrs: list[int], values: list[str]) -> None:
        set_texts(self.unit, vrs, values)

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


class Logged(NamedTuple):
    """A message as the exporters of both versions read it."""

    status: int
    category: str
    msg: str
    debug: bool = False


def report_to(queue: list[Logged]) -> Report:
    """Return what puts messages where the exporter takes them from."""
    return lambda status, category, text: queue.append(Logged(int(status), category, text))


def formatted(queue: list[Logged]) -> Report:
    """Return what puts messages where a logger of FMI 2.0 takes them from.

    Such a logger formats as ``printf`` does: a single % of "3 % slower" is to it the begin of a
    value, which it reads from memory that holds none.
    """
    report = report_to(queue)
    return lambda status, category, text: report(status, category, text.replace("%", "%%"))


def set_texts(unit: Unit, vrs: list[int], values: list[str]) -> None:
    """Set texts; those that are no UTF-8 have left holes in the list, which Python must not see."""
    try:
        ctypes.pythonapi.PyErr_Clear()
    except BaseException:
        pass  # what the exporter has left behind when it made the list
    entries = ctypes.c_void_p.from_address(id(values) + _ENTRIES_OF_LIST).value or 0
    count = len(vrs)
    if any(pointer is None for pointer in (ctypes.c_void_p * count).from_address(entries)):
        values = []
    unit.set_texts(vrs, values)


def whole(values: list[float]) -> list[int]:
    """Return numbers as integers; 0 for what a refused call could not tell."""
    return [0 if math.isnan(value) else int(value) for value in values]
