"""Connections between units: checked and converted, brought in jumps, solved at the start.

Sizes, types and units of measurement of both ends fit, are converted, or are refused. Signals go
through the coupling as fields. Values that change in jumps are set just before steps. In the
initialisation all values reach their inputs, and algebraic loops are solved.
"""

from __future__ import annotations

import functools
import time as clock
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from graphlib import TopologicalSorter

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from lcmchain.coupling.cosimulation.description import TRUTHS, Variable, VariableValues
from lcmchain.coupling.cosimulation.instance import CallFailed
from lcmchain.coupling.cosimulation.part import FmuPart
from lcmchain.coupling.cosimulation.physical_units import Conversion, UnitError, conversion
from lcmchain.coupling.cosimulation.system_file import ConnectionEntry
from lcmchain.coupling.iteration import PartFailed
from lcmchain.coupling.iteration.attempt import largest_size
from lcmchain.coupling.iteration.schemes import QuasiNewton
from lcmchain.errors import InputError, SimulationError


@dataclass(frozen=True, eq=False)
class Link:
    """A variable of one unit that sets a variable of another one."""

    source: FmuPart
    output: Variable
    target: FmuPart
    input: Variable
    conversion: Conversion
    entry: ConnectionEntry

    @property
    def name(self) -> str:
        return f"{self.source.name}.{self.output.name} -> {self.target.name}.{self.input.name}"

    @property
    def is_signal(self) -> bool:
        """Whether it goes through the coupling as a field; else it is set before steps."""
        is_signal = self.output.is_signal or (self.entry.continuous and self.output.is_real)
        return is_signal and self.input.is_real

    @property
    def could_be_signal(self) -> bool:
        """Whether it is no signal only because its output is declared to change in jumps."""
        return not self.is_signal and self.output.is_real and self.input.is_real

    def fetch(self) -> VariableValues:
        """Return the present values (n,) of the source in the type and unit of the target."""
        values = self.source.read(self.output)
        if self.input.is_text:
            return values
        if self.input.is_real:
            return self.conversion(values.astype(np.float64))
        return values.astype(self.input.dtype)

    def deliver(self, values: VariableValues) -> None:
        """Set the input of the target to values (n,)."""
        if not self.input.is_text and not np.all(np.isfinite(values)):
            raise PartFailed(f'"{self.output.name}" holds what is no number', part=self.source.name)
        self.target.write(self.input, values)


def resolve(entry: ConnectionEntry, parts: dict[str, FmuPart], remarks: list[str]) -> Link:
    """Return the link of a connection; a unit of measurement that is assumed becomes a remark.

    Raises
    ------
    InputError : a variable that does not exist or cannot be connected, or ends whose sizes, types
        or units of measurement do not fit; names both ends.
    """
    source_name, output_name, target_name, input_name = entry.ends
    source, target = parts[source_name], parts[target_name]
    key = f'connection "{entry.link}"'
    try:
        output = source.description.find(output_name)
        input_ = target.description.find(input_name)
    except InputError as error:
        raise InputError(error.message, key=key) from None
    if output.causality not in ("output", "calculatedParameter", "parameter", "local"):
        raise InputError(f'"{output_name}" is no output but {output.causality}', key=key)
    if input_.causality != "input":
        hint = "; give it a start value" if input_.causality == "parameter" else ""
        raise InputError(f'"{input_name}" is no input but {input_.causality}{hint}', key=key)
    if output.size != input_.size:
        raise InputError(
            f"{source_name}.{output_name} has {output.size} values, {target_name}.{input_name} "
            f"takes {input_.size}",
            key=key,
        )
    _require_lossless(output, input_, key)
    if entry.continuous and not (output.is_real and input_.is_real):
        raise InputError(
            f"continuous is for reals; {output.name} is {output.type_name}, {input_.name} is "
            f"{input_.type_name}",
            key=key,
        )
    change = Conversion()
    if entry.convert_units:
        change = _unit_conversion(output, input_, key, remarks)
    change = change.then(Conversion(entry.factor, entry.offset))
    if not change.is_identity and not input_.is_real:
        raise InputError(f'factor and offset are for real inputs, "{input_name}" is none', key=key)
    return Link(source, output, target, input_, change, entry)


def _require_lossless(output: Variable, input_: Variable, key: str) -> None:
    """Refuse types that would change values on the way."""
    if output.is_text and input_.is_text:
        return
    both = f"{output.name} is {output.type_name}, {input_.name} is {input_.type_name}"
    if output.is_text or input_.is_text:
        raise InputError(f"{both}; only a text goes to a text", key=key)
    if output.kind in TRUTHS:
        return  # 0 and 1 are numbers of all kinds
    if input_.kind in TRUTHS:
        raise InputError(f"{both}; a number is no switch", key=key)
    source, target = _numeric(output), _numeric(input_)
    # numpy calls int64 to float64 safe; above 2^53 it is not
    exact = np.can_cast(source, target, "safe") and not (
        source.kind in "iu" and source.itemsize == 8 and target.kind == "f"
    )
    if not exact:
        raise InputError(f"{both}; values could be changed on the way", key=key)


def _numeric(variable: Variable) -> np.dtype:
    """Return the type of a number; of an enumeration one that holds its few items."""
    return np.dtype("i4") if variable.type_name == "Enumeration" else variable.dtype


def _unit_conversion(
    output: Variable, input_: Variable, key: str, remarks: list[str]
) -> Conversion:
    if not (output.is_real and input_.is_real):
        if input_.is_real and input_.unit is not None and not input_.unit.is_plain:
            given = "a switch, so 0 or 1" if output.kind in TRUTHS else "a whole number"
            remarks.append(
                f'{key}: "{output.name}" is {given}, and is taken to be in {input_.unit.name}'
            )
        return Conversion()
    if output.unit is None or input_.unit is None:
        stated = output.unit or input_.unit
        if stated is not None and not stated.is_plain:
            bare = output.name if output.unit is None else input_.name
            remarks.append(
                f'{key}: "{bare}" has no unit of measurement and is taken to be in {stated.name}'
            )
        return Conversion()
    try:
        return conversion(output.unit, input_.unit, relative=output.relative or input_.relative)
    except UnitError as error:
        raise InputError(f"{output.name} -> {input_.name}: {error}", key=key) from None


def _strong_components(count: int, edges: Sequence[tuple[int, int]]) -> tuple[int, list[int]]:
    """Return the number of loops and single nodes of a directed graph, and which one a node is in.

    edges : pairs (from, to) of ``count`` nodes.
    """
    rows, columns = ([edge[end] for edge in edges] for end in (0, 1))
    graph = coo_matrix((np.ones(len(edges)), (rows, columns)), shape=(count, count))
    group_count, group_of = connected_components(graph, directed=True, connection="strong")
    return group_count, group_of.tolist()


def loops_of(links: Sequence[Link]) -> list[list[Link]]:
    """Return the connections between units that depend on each other, loop by loop."""
    names = sorted({part.name for link in links for part in (link.source, link.target)})
    index = {name: number for number, name in enumerate(names)}
    edges = [(index[link.source.name], index[link.target.name]) for link in links]
    count, loop_of = _strong_components(len(names), edges)
    loops: list[list[Link]] = [[] for _ in range(count)]
    for (source, target), link in zip(edges, links):
        if loop_of[source] == loop_of[target]:
            loops[loop_of[source]].append(link)
    return [loop for loop in loops if loop]


# --- values that change in jumps ------------------------------------------------------------------


class Lines:
    """Connections of values that change in jumps: switches, whole numbers, texts, discrete reals.

    In a serial order a unit gets the new values of the units before it, and the values at the begin
    of the window of those after it. In a parallel order all get the values at the begin.

    With iteration, the values at the begin are a first guess: :meth:`begin` and :meth:`follow` make
    this the ``jumps`` of a coupled system, which repeats the window until nothing changes.

    Parameters
    ----------
    order : names of the units in the order of a serial scheme; None if all advance at once.
    iterated : whether windows are repeated until these values stay.
    relative : change of real numbers that does not count, relative to their size.
    """

    def __init__(
        self,
        links: Sequence[Link],
        *,
        order: Sequence[str] | None,
        iterated: bool = False,
        relative: float = 0.0,
        most_iterations: int = 1,
    ) -> None:
        self._links, self._serial = list(links), order is not None
        self.most_iterations, self._relative = most_iterations, relative
        turn = {name: number for number, name in enumerate(order or ())}
        self.backward = [
            link
            for link in self._links
            if order is None or turn[link.source.name] >= turn[link.target.name]
        ]
        self._kept = self.backward if iterated or not self._serial else []
        self._frozen: dict[Link, VariableValues] = {}  # at the begin of the window
        self._given: dict[Link, VariableValues] = {}  # in this iteration

    def refresh(self) -> None:
        """Keep the present values of the sources: a window begins."""
        self._frozen = {link: link.fetch() for link in self._kept}
        self._given = dict(self._frozen)

    def begin(self) -> None:
        """Go back to the values at the begin of the window."""
        self._given = dict(self._frozen)

    def follow(self) -> list[str]:
        """Take the present values of the sources; return in words what that changes."""
        changes = []
        for link, before in self._given.items():
            now = link.fetch()
            if not _agree(before, now, self._relative):
                changes.append(_change(link, before, now))
            self._given[link] = now
        return changes

    def bring(self, target: FmuPart) -> None:
        """Set the inputs of a unit that is about to step."""
        for link in self._links:
            if link.target is target:
                kept = self._given.get(link)
                link.deliver(link.fetch() if kept is None else kept)

    def attach(self) -> None:
        """Have every unit call :meth:`bring` before its steps."""
        for part in {link.target.name: link.target for link in self._links}.values():
            part.bring = functools.partial(self.bring, part)


def _agree(before: VariableValues, now: VariableValues, relative: float) -> bool:
    """Whether values are the same; reals up to ``relative`` times their largest."""
    if now.dtype.kind != "f":
        return bool(np.array_equal(before, now))
    size = float(np.abs(now).max(initial=0.0))
    return bool(np.all(np.abs(now - before) <= relative * size))


def _change(link: Link, before: VariableValues, now: VariableValues) -> str:
    """Return in words how the values of a connection change; of a field the first that does."""
    index = int(np.flatnonzero(before.reshape(-1) != now.reshape(-1))[0])
    old, new = (_shown(link, values.reshape(-1)[index]) for values in (before, now))
    where = f", value {index}," if now.size > 1 else ""
    return f"{link.name}{where} from {old} to {new}"


def _shown(link: Link, value: object) -> str:
    if link.input.kind in TRUTHS:
        return "true" if value else "false"
    return f'"{value}"' if link.input.is_text else str(value)


# --- initialisation -------------------------------------------------------------------------------

#: Most iterations of a loop, and the change that ends them, relative to the values.
MOST_ITERATIONS = 100
TOLERANCE = 1e-12
#: Growth over the first values beyond which a loop has no solution: there y + 1 equals y within
#: the tolerance.
HOPELESS = 1e12


def initialise(parts: Sequence[FmuPart], links: Sequence[Link]) -> dict[str, int]:
    """Initialise units whose start values are set.

    Returns
    -------
    Iterations by the names of the connections of each loop.

    Raises
    ------
    SimulationError : a unit fails, or a loop does not converge; names its connections.
    """
    for part in parts:
        _initialising(part, part.instance.enter_initialization)
    iterations = {}
    for group in _in_order(links):
        if len(group) == 1 and not _feeds(group[0], group[0]):
            group[0].deliver(group[0].fetch())
        else:
            iterations[", ".join(link.name for link in group)] = _solve(group)
    for part in parts:
        _initialising(part, part.instance.exit_initialization)
    return iterations


def _initialising(part: FmuPart, call: Callable[[], None]) -> None:
    begin = clock.perf_counter()
    try:
        call()
    except CallFailed as failure:
        raise SimulationError(
            f'unit "{part.name}" failed in its initialisation at {part.time:g} s: {failure}'
        ) from failure
    finally:
        part.spent.initialisation += clock.perf_counter() - begin


def _feeds(one: Link, other: Link) -> bool:
    """Whether the input of a connection acts directly on the output of another one."""
    if one.target is not other.source:
        return False
    description, output = other.source.description, other.output.name
    if other.output.causality in ("parameter", "calculatedParameter"):
        return False
    depends = description.depends_initially.get(output, description.depends.get(output))
    return depends is None or one.input.name in depends


def _in_order(links: Sequence[Link]) -> list[list[Link]]:
    """Return the connections in an order in which each acts on later ones only; loops together."""
    if not links:
        return []
    pairs = [(i, j) for i, one in enumerate(links) for j, other in enumerate(links)
             if _feeds(one, other)]  # fmt: skip
    group_count, group_of = _strong_components(len(links), pairs)
    before: dict[int, set[int]] = {group: set() for group in range(group_count)}
    for i, j in pairs:
        if group_of[i] != group_of[j]:
            before[group_of[j]].add(group_of[i])
    order = TopologicalSorter(before).static_order()
    return [[link for i, link in enumerate(links) if group_of[i] == group] for group in order]


def _solve(loop: list[Link]) -> int:
    """Iterate a loop of connections until none changes its value; return the iterations."""
    signals = [link for link in loop if link.is_signal]
    newton = QuasiNewton(relaxation=1.0, windows_reused=0)
    newton.begin_window()
    given: list[VariableValues] | None = None
    first = 0.0
    for iteration in range(1, MOST_ITERATIONS + 1):
        answers = {link: link.fetch() for link in loop}
        if given is None:
            for link in loop:
                link.deliver(answers[link])
            given = [answers[link] for link in loop]
            first = max((largest_size(answers[link]) for link in signals), default=0.0) or 1.0
            continue
        if any(not largest_size(answers[link]) < HOPELESS * first for link in signals):
            break
        if all(_same(before, answers[link]) for before, link in zip(given, loop)):
            return iteration
        proposed = dict(answers)
        if signals:
            x = np.concatenate([v for v, link in zip(given, loop) if link.is_signal])
            answer = np.concatenate([answers[link] for link in signals])
            weights = np.full(x.size, 1.0 / max(float(np.abs(answer).max()), 1e-300))
            following, at = newton.propose(x, answer, weights), 0
            for link in signals:
                proposed[link] = following[at : at + link.input.size]
                at += link.input.size
        for link in loop:
            link.deliver(proposed[link])
        given = [proposed[link] for link in loop]
    names = ", ".join(link.name for link in loop)
    raise SimulationError(
        f"the algebraic loop of the initialisation does not converge in {MOST_ITERATIONS} "
        f"iterations: {names}. It may have no solution, or several: give the inputs start values "
        "near one, or break the loop (an output that follows the input after a step only)"
    )


def _same(before: VariableValues, now: VariableValues) -> bool:
    """Whether values agree up to the tolerance, texts and switches exactly."""
    if now.dtype.kind != "f":
        return bool(np.array_equal(before, now))
    return bool(np.all(np.abs(now - before) <= TOLERANCE * largest_size(now)))
