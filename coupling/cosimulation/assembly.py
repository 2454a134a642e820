"""Assembles a system from its file: units loaded, connected and initialised."""

from __future__ import annotations

import time as clock
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from lcmchain import __version__
from lcmchain.coupling.cosimulation.archive import sha256_of, unpack
from lcmchain.coupling.cosimulation.connections import Lines, Link, initialise, loops_of, resolve
from lcmchain.coupling.cosimulation.description import (
    UnitDescription,
    Variable,
    VariableValues,
    read_description,
)
from lcmchain.coupling.cosimulation.instance import CallFailed
from lcmchain.coupling.cosimulation.part import FmuPart
from lcmchain.coupling.cosimulation.process_instance import new_instance
from lcmchain.coupling.cosimulation.start_values import (
    configure,
    start_values,
    with_declared_units,
    without_values,
)
from lcmchain.coupling.cosimulation.stopping import StopRequests
from lcmchain.coupling.cosimulation.system_file import SchemeEntry, System, UnitEntry, WindowEntry
from lcmchain.coupling.cosimulation.terminal_links import with_variables
from lcmchain.coupling.iteration import (
    CoupledSystem,
    Exchange,
    Scheme,
    Tolerance,
    WindowControl,
    aitken,
    fixed_point,
    gauss_seidel,
    iqn_ils,
    iqn_mvj,
    jacobi,
)
from lcmchain.errors import InputError, SimulationError

# --- scheme, windows and exchanges ----------------------------------------------------------------


def scheme_of(entry: SchemeEntry) -> Scheme:
    """Return a new scheme."""
    if entry.type == "jacobi":
        return jacobi()
    if entry.type == "gauss-seidel":
        return gauss_seidel()
    order, most = entry.order, entry.most_iterations
    factor = entry.relaxation
    if entry.type == "fixed-point":
        return fixed_point(1.0 if factor is None else factor, order=order, most_iterations=most)
    if entry.type == "aitken":
        return aitken(0.5 if factor is None else factor, order=order, most_iterations=most)
    first = 0.01 if factor is None else factor
    if entry.type == "iqn-mvj":
        return iqn_mvj(order=order, relaxation=first, most_iterations=most)
    return iqn_ils(
        order=order, relaxation=first, most_iterations=most, windows_reused=entry.windows_reused
    )


def windows_of(entry: WindowEntry) -> WindowControl:
    """Return the control of the window sizes."""
    return WindowControl(
        entry.size, smallest=entry.smallest, largest=entry.largest, residual=entry.residual
    )


def exchange_of(link: Link, system: System) -> Exchange:
    """Return the exchange of a connection; its unit conversion is the mapping."""
    entry = link.entry
    tolerance = Tolerance(
        relative=system.scheme.relative if entry.relative is None else entry.relative,
        absolute=entry.absolute,
    )
    return Exchange(
        link.source.name,
        link.target.name,
        link.output.name,
        link.input.name,
        mapping=None if link.conversion.is_identity else link.conversion,
        tolerance=tolerance,
        scale=entry.scale,
        relaxation=entry.relaxation,
        bounds=entry.bounds,
        of_window=entry.of_window,
        within=entry.within,
    )


def extrapolation_of(entry: SchemeEntry) -> int:
    """Return the order of the extrapolation into a new window."""
    if entry.extrapolation is not None:
        return entry.extrapolation
    return 0 if entry.explicit else 1


# --- units ----------------------------------------------------------------------------------------


#: Takes a line for the log.
Log = Callable[[str], None]
#: Variables of a unit and their start values (n,).
_Settings = list[tuple[Variable, VariableValues]]

#: Begin of the generation tool of units that this program made.
OWN_TOOL = "lcmchain "
#: Wall-clock time that a step of a unit in a process of its own may take by default [s].
STEP_LIMIT = 3600.0


@dataclass
class Assembly:
    """A system whose units are initialised; a context that terminates and frees them.

    Parameters
    ----------
    parts : units by name.
    coupled : the system that advances in time.
    lines : connections of values that change in jumps.
    loops : iterations of the algebraic loops of the initialisation, by their connections.
    remarks : messages for the user.
    requests : to stop, which end calls into units in processes of their own.
    """

    system: System
    parts: dict[str, FmuPart]
    coupled: CoupledSystem
    lines: Lines
    links: list[Link]
    loops: dict[str, int]
    remarks: list[str] = field(default_factory=list)
    requests: StopRequests = field(default_factory=StopRequests)

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
    folder : an empty one to unpack into; it is needed until the assembly is closed.
    log : takes messages of units and remarks.

    Raises
    ------
    InputError : an archive, a variable, a connection or a scheme that does not fit.
    SimulationError : a unit fails, or a loop of the initialisation does not converge.
    """
    remarks = list(system.remarks)
    unpacked: dict[str, tuple[Path, str]] = {}
    parts: dict[str, FmuPart] = {}
    settings = []
    requests = StopRequests()
    try:
        for entry in system.units:
            part = _loaded(entry, system, folder, unpacked, log, remarks, requests)
            parts[entry.name] = part
            settings.append(start_values(entry.name, part.description, entry.start))
        _require_able(system, parts, remarks)
        descriptions = {name: part.description for name, part in parts.items()}
        connections = with_variables(system, descriptions).connections
        links = [resolve(entry, parts, remarks) for entry in connections]
        _require_single(links)
        _tell_lost_values(parts, settings, links, remarks)
        for part, values in zip(parts.values(), settings):
            _set_up(part, values, system)
        loops = initialise(list(parts.values()), links)
        signals = [link for link in links if link.is_signal]
        if not system.scheme.explicit and system.scheme.jumps == "once":
            _tell_loops_of_jumps(links, list(parts), system, remarks)
        scheme = scheme_of(system.scheme)
        lines = _lines_of(links, list(parts), system)
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
            jumps=lines if system.scheme.jumps == "iterated" else None,
        )
    except BaseException:
        free(parts)
        raise
    for text in [*map(_changed, links), *(f"remark: {text}" for text in remarks)]:
        if text:
            log(text)
    return Assembly(system, parts, coupled, lines, links, loops, remarks, requests)


def _lines_of(links: list[Link], order: list[str], system: System) -> Lines:
    """Return the connections of values that change in jumps.

    Raises
    ------
    InputError : they are to be iterated, and none of them leads back.
    """
    scheme = system.scheme
    lines = Lines(
        [link for link in links if not link.is_signal],
        order=order if scheme_of(scheme).order == "serial" else None,
        iterated=scheme.jumps == "iterated",
        relative=scheme.relative,
        most_iterations=scheme.most_iterations,
    )
    if scheme.jumps == "iterated" and not lines.backward:
        raise InputError(
            "no connection of whole numbers, switches, texts or discrete reals leads back to a "
            "unit that has gone before, so there is nothing to iterate; leave jumps out",
            key="scheme.jumps",
        )
    return lines


def _loaded(
    entry: UnitEntry,
    system: System,
    folder: Path,
    unpacked: dict[str, tuple[Path, str]],
    log: Log,
    remarks: list[str],
    requests: StopRequests,
) -> FmuPart:
    """Return a unit with its instance; an archive of several units is unpacked once.

    unpacked : folder and hash of archives by their paths, which it adds to.
    """
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
        target = folder / f"unit_{len(unpacked)}"
        unpack(file, target)
        unpacked[key] = target, sha256_of(file)
    unit_folder, sha256 = unpacked[key]
    description = read_description(unit_folder, file)
    with_declared_units(entry.name, description, entry.quantities, system.measures)
    description, configuration = configure(entry.name, description, entry.start)
    remarks += [f'unit "{entry.name}": {text}' for text in description.remarks]
    if description.needs_tool and description.generation_tool != f"{OWN_TOOL}{__version__}":
        remarks.append(
            f'unit "{entry.name}" needs the tool that made it ({description.generation_tool})'
        )
    name = entry.name

    def take(status: str, category: str, message: str) -> None:
        log(f"unit {name}: {status}{f' [{category}]' if category else ''}: {message}")

    apart = runs_apart(entry, description)
    try:
        instance = new_instance(
            description, unit_folder, name, take, debug=entry.debug, apart=apart,
            limit=entry.step_limit or STEP_LIMIT, requests=requests,
        )  # fmt: skip
    except CallFailed as failure:
        raise SimulationError(f'unit "{name}" is lost: {failure}') from failure
    part = FmuPart(name, file, sha256, description, instance, system.start_time, apart=apart)
    part.configuration = configuration
    part.spent.instantiation = clock.perf_counter() - begin
    return part


def runs_apart(entry: UnitEntry, description: UnitDescription) -> bool:
    """Whether a unit gets a process of its own: by default those of other tools do.

    Raises
    ------
    InputError : a limit for a unit that gets none.
    """
    is_own = description.generation_tool.startswith(OWN_TOOL)
    apart = not is_own if entry.process is None else entry.process == "own"
    if entry.step_limit is not None and not apart:
        raise InputError(
            'only a unit in a process of its own can be ended; add process = "own"',
            key=f"units.{entry.name}.step_limit",
        )
    return apart


def _changed(link: Link) -> str:
    """Return in words how a connection converts a value; empty where it does not."""
    change = link.conversion
    if change.is_identity:
        return ""
    units = f"{link.output.unit_text} to {link.input.unit_text}"
    return f"connection {link.name}: {units}, {change.factor:g} v + {change.offset:g}"


def _tell_lost_values(
    parts: dict[str, FmuPart], settings: list[_Settings], links: list[Link], remarks: list[str]
) -> None:
    """Add remarks on arrays that were resized and have no values any more."""
    for part, part_settings in zip(parts.values(), settings):
        known = {variable.name for variable, _ in part_settings}
        known |= {link.input.name for link in links if link.target is part}
        sentences = without_values(part.description, part.configuration, known)
        remarks += [f'unit "{part.name}": {text}' for text in sentences]


def _set_up(part: FmuPart, settings: _Settings, system: System) -> None:
    """Set structural parameters, experiment and start values of a unit."""
    sizes = part.configuration.settings
    try:
        if sizes:
            part.instance.configure(sizes)
    except CallFailed as failure:
        listed = ", ".join(f"{variable.name} = {values[0]}" for variable, values in sizes)
        raise SimulationError(
            f'unit "{part.name}" does not take its structural parameters ({listed}): {failure}; '
            "leave them out, or export the unit with these values"
        ) from failure
    try:
        part.instance.set_up(system.start_time, system.stop_time, system.unit_tolerance)
        for variable, values in settings:
            part.instance.write(variable, values)
            part.note(variable, values)
    except CallFailed as failure:
        raise SimulationError(
            f'unit "{part.name}" does not take its start values: {failure}'
        ) from failure


def _require_able(system: System, parts: dict[str, FmuPart], remarks: list[str]) -> None:
    """Refuse a scheme or windows that a unit cannot follow; tell units whether they go back.

    Raises
    ------
    InputError : names the unit and what to take instead.
    """
    window, going_back = system.window, _going_back(system)
    shared: dict[str, str] = {}  # units in this process, by the hash of the archive
    for name, part in parts.items():
        able: UnitDescription = part.description
        if going_back is not None and not able.can_save:
            what, key = going_back
            raise InputError(
                f'unit "{name}" cannot go back to an earlier state (canGetAndSetFMUstate is '
                f'false), which {what} needs; take scheme.type = "jacobi" or "gauss-seidel" with '
                "windows of one size and without scheme.jumps, or a unit that can",
                key=key,
            )
        if window.varies and not able.variable_steps:
            raise InputError(
                f'unit "{name}" takes steps of one size only '
                "(canHandleVariableCommunicationStepSize is false); leave smallest and largest out",
                key="window",
            )
        if able.internal_step and window.size < able.internal_step * (1.0 - 1e-9):
            remarks.append(
                f'unit "{name}" computes in steps of {able.internal_step:g} s, longer than the '
                f"window of {window.size:g} s: its outputs change in some windows only"
            )
        if able.only_once and part.sha256 in shared and not part.apart:
            raise InputError(
                f'units "{shared[part.sha256]}" and "{name}" are the same, of which a process can '
                "hold one only (canBeInstantiatedOnlyOncePerProcess); give one of them "
                'process = "own"',
                key=f"units.{name}",
            )
        if not part.apart:
            shared[part.sha256] = name
        part.returns = going_back is not None


def _tell_loops_of_jumps(
    links: list[Link], order: list[str], system: System, remarks: list[str]
) -> None:
    """Tell of loops that an iterating scheme does not iterate, because they change in jumps.

    Raises
    ------
    InputError : there is no loop that it iterates; names the connections and what to do.
    """
    in_loops = [link for group in loops_of(links) for link in group]
    jumps = [link for link in in_loops if not link.is_signal]
    curable = [link for link in jumps if link.could_be_signal]
    turn = {name: number for number, name in enumerate(order)}
    iterated = any(
        system.scheme.order == "parallel" or turn[link.source.name] >= turn[link.target.name]
        for link in links
        if link.is_signal
    )
    if not jumps or (iterated and not curable):
        return
    names = ", ".join(link.name for link in (curable or jumps))
    entry = f'{{ link = "{(curable or jumps)[0].name}", continuous = true }}'
    what = (
        "is of reals that the units declare discrete; they are handed over once in a window. Set "
        f"continuous = true for these connections if they are to be iterated, as in {entry}: "
        if curable
        else "is of whole numbers, switches or texts, which are handed over once in a window and "
        "not iterated: "
    )
    if iterated:
        remarks.append(f"a loop {what}{names}")
        return
    raise InputError(
        f'the loop that the scheme "{system.scheme.type}" could iterate {what}{names}. Or take '
        '"jacobi" or "gauss-seidel", with scheme.jumps = "iterated" where windows are to be '
        "repeated until nothing of it changes",
        key="scheme.type",
    )


def _going_back(system: System) -> tuple[str, str] | None:
    """Return what needs units to go back to an earlier state, and its key; None if nothing does."""
    scheme, window = system.scheme, system.window
    if not scheme.explicit:
        return f'the scheme "{scheme.type}"', "scheme.type"
    if (window.smallest or window.size) < window.size:
        return "a window that can be halved (window.smallest)", "window.smallest"
    if scheme.jumps == "iterated":
        return 'scheme.jumps = "iterated"', "scheme.jumps"
    return None


def _require_single(links: list[Link]) -> None:
    """Refuse two connections into one input, also where one of them sets a single value of it."""
    connected: dict[tuple[str, str, int], str] = {}
    for link in links:
        for reference in link.input.references:
            # in FMI 2 every type counts its own references
            scalar = (link.target.name, link.input.type_name, int(reference))
            if scalar in connected:
                raise InputError(
                    f'"{connected[scalar]}" and "{link.entry.link}" set the same input',
                    key="connections",
                )
            connected[scalar] = link.entry.link
