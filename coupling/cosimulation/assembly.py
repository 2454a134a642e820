"""From the file of a system to units that are loaded, connected and initialised."""

from __future__ import annotations

import time as clock
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from lcmchain.coupling.cosimulation.archive import sha256_of, unpack
from lcmchain.coupling.cosimulation.connections import Lines, Link, resolve
from lcmchain.coupling.cosimulation.description import UnitDescription, read_description
from lcmchain.coupling.cosimulation.initialization import initialise
from lcmchain.coupling.cosimulation.instance import CallFailed, new_instance
from lcmchain.coupling.cosimulation.part import FmuPart
from lcmchain.coupling.cosimulation.scheme import (
    exchange_of,
    extrapolation_of,
    scheme_of,
    windows_of,
)
from lcmchain.coupling.cosimulation.start_values import start_values, with_declared_units
from lcmchain.coupling.cosimulation.system_file import System, UnitEntry
from lcmchain.coupling.iteration import CoupledSystem
from lcmchain.errors import InputError, SimulationError

#: Takes a line for the log.
Log = Callable[[str], None]


@dataclass
class Assembly:
    """A system whose units are initialised; a context that ends and frees them.

    Parameters
    ----------
    parts : by name. coupled : goes through time. lines : what changes in jumps.
    loops : iterations of the algebraic loops of the initialisation, by their connections.
    remarks : what the user should know.
    """

    system: System
    parts: dict[str, FmuPart]
    coupled: CoupledSystem
    lines: Lines
    links: list[Link]
    loops: dict[str, int]
    remarks: list[str] = field(default_factory=list)

    def __enter__(self) -> Assembly:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the simulation of all units and free them."""
        for part in self.parts.values():
            with suppress(CallFailed):
                part.instance.terminate()
        free(self.parts)


def free(parts: dict[str, FmuPart]) -> None:
    """Free the instances of units."""
    for part in parts.values():
        part.instance.free()


def assemble(system: System, folder: Path, log: Log) -> Assembly:
    """Unpack, load, connect and initialise all units.

    Parameters
    ----------
    folder : an empty one to unpack into; it has to be there until the assembly is closed.

    Raises
    ------
    InputError : an archive, a variable, a connection or a scheme that does not fit.
    SimulationError : a unit fails, or a loop of the initialisation does not converge.
    """
    remarks = list(system.remarks)
    unpacked: dict[str, tuple[Path, str]] = {}
    parts: dict[str, FmuPart] = {}
    settings = []
    try:
        for entry in system.units:
            part = _loaded(entry, system, folder, unpacked, log, remarks)
            parts[entry.name] = part
            settings.append(start_values(entry.name, part.description, entry.start))
        _require_able(system, parts, remarks)
        links = [resolve(entry, parts, remarks) for entry in system.connections]
        _require_single(links)
        for part, values in zip(parts.values(), settings):
            _set_up(part, values, system)
        loops = initialise(list(parts.values()), links)
        signals = [link for link in links if link.is_signal]
        scheme = scheme_of(system.scheme)
        lines = Lines(
            [link for link in links if not link.is_signal], serial=scheme.order == "serial"
        )
        lines.attach()
        lines.refresh()
        coupled = CoupledSystem(
            dict(parts),
            [exchange_of(link, system) for link in signals],
            scheme,
            window=windows_of(system.window),
            substeps={entry.name: entry.substeps for entry in system.units},
            prediction=extrapolation_of(system.scheme),
            on_failure=system.scheme.on_failure,
        )
    except BaseException:
        free(parts)
        raise
    for text in [*map(_changed, links), *(f"remark: {text}" for text in remarks)]:
        if text:
            log(text)
    return Assembly(system, parts, coupled, lines, links, loops, remarks)


def _loaded(
    entry: UnitEntry,
    system: System,
    folder: Path,
    unpacked: dict[str, tuple[Path, str]],
    log: Log,
    remarks: list[str],
) -> FmuPart:
    """Return a unit with its instance; an archive that two units share is unpacked once."""
    begin = clock.perf_counter()
    file = system.directory / entry.fmu
    if not file.is_file():
        raise InputError(
            f'there is no such file "{entry.fmu}" in {system.directory}; names are relative to '
            "the file of the system",
            key=f"units.{entry.name}.fmu",
        )
    key = str(file.resolve())
    if key not in unpacked:
        place = folder / f"unit_{len(unpacked)}"
        unpack(file, place)
        unpacked[key] = place, sha256_of(file)
    place, sha256 = unpacked[key]
    description = read_description(place, file)
    with_declared_units(entry.name, description, entry.quantities)
    remarks += [f'unit "{entry.name}": {text}' for text in description.remarks]
    if description.needs_tool:
        remarks.append(
            f'unit "{entry.name}" needs the tool that made it ({description.generation_tool})'
        )
    name = entry.name

    def take(status: str, category: str, message: str) -> None:
        log(f"unit {name}: {status}{f' [{category}]' if category else ''}: {message}")

    instance = new_instance(description, place, name, take, debug=entry.debug)
    part = FmuPart(name, file, sha256, description, instance, system.start_time)
    part.spent.instantiation = clock.perf_counter() - begin
    return part


def _changed(link: Link) -> str:
    """Return in words what a connection does to a value; nothing where it does nothing."""
    change = link.conversion
    if change.is_identity:
        return ""
    units = f"{link.output.unit_text} to {link.input.unit_text}"
    return f"connection {link.name}: {units}, {change.factor:g} v + {change.offset:g}"


def _set_up(part: FmuPart, values: list, system: System) -> None:
    try:
        part.instance.set_up(system.start_time, system.stop_time, system.unit_tolerance)
        for variable, given in values:
            part.instance.write(variable, given)
    except CallFailed as failure:
        raise SimulationError(
            f'unit "{part.name}" does not take its start values: {failure}'
        ) from failure


def _require_able(system: System, parts: dict[str, FmuPart], remarks: list[str]) -> None:
    """Refuse a scheme or windows that a unit is not able to follow.

    Raises
    ------
    InputError : names the unit and what to take instead.
    """
    window, scheme = system.window, system.scheme
    goes_back = not scheme.explicit or (window.smallest or window.size) < window.size
    seen: dict[str, str] = {}
    for name, part in parts.items():
        able: UnitDescription = part.description
        if goes_back and not able.can_save:
            raise InputError(
                f'unit "{name}" cannot go back to an earlier state (canGetAndSetFMUstate is '
                f"false), which {_wanted(system)} needs; take scheme.type = "
                '"jacobi" or "gauss-seidel" with windows of one size, or a unit that can',
                key="scheme.type" if not scheme.explicit else "window.smallest",
            )
        if window.varies and not able.variable_steps:
            raise InputError(
                f'unit "{name}" takes steps of one size only '
                "(canHandleVariableCommunicationStepSize is false); leave smallest and largest out",
                key="window",
            )
        if able.internal_step and system.window.size < able.internal_step * (1.0 - 1e-9):
            remarks.append(
                f'unit "{name}" computes in steps of {able.internal_step:g} s, longer than the '
                f"window of {window.size:g} s: its outputs change in some windows only"
            )
        if able.only_once and part.sha256 in seen:
            raise InputError(
                f'units "{seen[part.sha256]}" and "{name}" are the same, of which a process can '
                "hold one only (canBeInstantiatedOnlyOncePerProcess); copy nothing, ask its maker",
                key=f"units.{name}",
            )
        seen[part.sha256] = name
        part.returns = goes_back


def _wanted(system: System) -> str:
    if not system.scheme.explicit:
        return f'the scheme "{system.scheme.type}"'
    return "a window that can be halved (window.smallest)"


def _require_single(links: list[Link]) -> None:
    """Refuse two connections into one input, also where one of them sets a single value of it."""
    taken: dict[tuple[str, str, int], str] = {}
    for link in links:
        for reference in link.input.references:
            # in FMI 2 every type counts its own references
            place = (link.target.name, link.input.type_name, int(reference))
            if place in taken:
                raise InputError(
                    f'"{taken[place]}" and "{link.entry.link}" set the same input',
                    key="connections",
                )
            taken[place] = link.entry.link
