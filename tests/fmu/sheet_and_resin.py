"""A sheet or stack and its resin, coupled within one process and as two units in the master."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from lcmchain.coupling.cosimulation.run import run_system
from lcmchain.coupling.cosimulation.system_file import system_from
from lcmchain.coupling.iteration import CoupledSystem, Exchange, Tolerance, iqn_ils
from lcmchain.coupling.iteration.interface import (
    PRESSURE_AT_REST,
    REFERENCE_PRESSURE,
    RESISTANCE,
    VOLUME_RATE,
    VOLUME_RATE_SLOPE,
)

#: What the sheet gives to the resin.
FORWARD = (VOLUME_RATE, VOLUME_RATE_SLOPE, REFERENCE_PRESSURE, RESISTANCE)


def in_one_process(sheet: Any, resin: Any, step: float, stop: float) -> CoupledSystem:
    """Advance both by windows of a step to a time [s]."""
    exchanges = [Exchange("sheet", "resin", name) for name in FORWARD]
    exchanges.append(Exchange("resin", "sheet", PRESSURE_AT_REST, tolerance=Tolerance(1e-10)))
    system = CoupledSystem(
        {"sheet": sheet, "resin": resin}, exchanges, iqn_ils(relaxation=1.0), window=step
    )
    while system.time < 0.999 * stop:
        system.advance(step)
    return system


def as_units(folder: Path, out: Path, step: float, stop: float) -> Mapping[str, Any]:
    """Run sheet.fmu and resin.fmu of a folder by the same windows; return the summary."""
    system = system_from(
        {
            "stop_time": f"{stop!r} s",
            "window": f"{step!r} s",
            "units": [
                {
                    "name": "sheet",
                    "fmu": "sheet.fmu",
                    "start": {"pore_pressure_at_rest": True, "threads": 1},
                },
                {"name": "resin", "fmu": "resin.fmu"},
            ],
            "connections": [
                *(f"sheet.{name} -> resin.{name}" for name in FORWARD),
                {"link": "resin.pressure_at_rest -> sheet.pore_pressure"},
            ],
            "scheme": {"type": "iqn-ils", "relative": 1e-10, "relaxation": 1.0},
        },
        None,
        directory=folder,
    )
    return run_system(system, out)
