"""Connections between units: sizes, types and units fit, or are converted, or are refused."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from lcmchain.coupling.cosimulation.part import FmuPart
from lcmchain.coupling.cosimulation.physical_units import Conversion, UnitError, conversion
from lcmchain.coupling.cosimulation.system_file import ConnectionEntry
from lcmchain.coupling.cosimulation.variable import TRUTHS, Variable
from lcmchain.coupling.iteration import PartFailed
from lcmchain.errors import InputError


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
        """Whether it goes through the coupling as a field; else it is brought before steps."""
        is_signal = self.output.is_signal or (self.entry.continuous and self.output.is_real)
        return is_signal and self.input.is_real

    @property
    def could_be_signal(self) -> bool:
        """Whether it is none only because its output is declared to change in jumps."""
        return not self.is_signal and self.output.is_real and self.input.is_real

    def fetch(self) -> NDArray[Any]:
        """Return the present values of the source as the target takes them."""
        values = self.source.read(self.output)
        if self.input.is_text:
            return values
        if self.input.is_real:
            return self.conversion(values.astype(np.float64))
        return values.astype(self.input.dtype)

    def deliver(self, values: NDArray[Any]) -> None:
        """Set the target."""
        if not self.input.is_text and not np.all(np.isfinite(values)):
            raise PartFailed(f'"{self.output.name}" holds what is no number', part=self.source.name)
        self.target.write(self.input, values)


def resolve(entry: ConnectionEntry, parts: dict[str, FmuPart], remarks: list[str]) -> Link:
    """Return the link of a connection; what is taken on trust is added to the remarks.

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
        taken = target.description.find(input_name)
    except InputError as error:
        raise InputError(error.message, key=key) from None
    if output.causality not in ("output", "calculatedParameter", "parameter", "local"):
        raise InputError(f'"{output_name}" is no output but {output.causality}', key=key)
    if taken.causality != "input":
        hint = "; give it a start value" if taken.causality == "parameter" else ""
        raise InputError(f'"{input_name}" is no input but {taken.causality}{hint}', key=key)
    if output.size != taken.size:
        raise InputError(
            f"{source_name}.{output_name} has {output.size} values, {target_name}.{input_name} "
            f"takes {taken.size}",
            key=key,
        )
    _require_lossless(output, taken, key)
    if entry.continuous and not (output.is_real and taken.is_real):
        raise InputError(
            f"continuous is for reals; {output.name} is {output.type_name}, {taken.name} is "
            f"{taken.type_name}",
            key=key,
        )
    change = Conversion()
    if entry.convert_units:
        change = _unit_conversion(output, taken, key, remarks)
    change = change.then(Conversion(entry.factor, entry.offset))
    if not change.is_identity and not taken.is_real:
        raise InputError(f'factor and offset are for real inputs, "{input_name}" is none', key=key)
    return Link(source, output, target, taken, change, entry)


def _require_lossless(output: Variable, taken: Variable, key: str) -> None:
    """Refuse types that would change values on the way."""
    if output.is_text and taken.is_text:
        return
    both = f"{output.name} is {output.type_name}, {taken.name} is {taken.type_name}"
    if output.is_text or taken.is_text:
        raise InputError(f"{both}; only a text goes to a text", key=key)
    if output.kind in TRUTHS:
        return  # 0 and 1 are numbers of all kinds
    if taken.kind in TRUTHS:
        raise InputError(f"{both}; a number is no switch", key=key)
    given, wanted = _numeric(output), _numeric(taken)
    # numpy takes int64 to float64 for safe; above 2^53 it is not
    exact = np.can_cast(given, wanted, "safe") and not (
        given.kind in "iu" and given.itemsize == 8 and wanted.kind == "f"
    )
    if not exact:
        raise InputError(f"{both}; values could be changed on the way", key=key)


def _numeric(variable: Variable) -> np.dtype:
    """Return the type of a number; the items of an enumeration are few in either version."""
    return np.dtype("i4") if variable.type_name == "Enumeration" else variable.dtype


def _unit_conversion(output: Variable, taken: Variable, key: str, remarks: list[str]) -> Conversion:
    if not (output.is_real and taken.is_real):
        return Conversion()
    if output.unit is None or taken.unit is None:
        known = output.unit or taken.unit
        if known is not None and not known.is_plain:
            bare = output.name if output.unit is None else taken.name
            remarks.append(
                f'{key}: "{bare}" has no unit of measurement and is taken to be in {known.name}'
            )
        return Conversion()
    try:
        return conversion(output.unit, taken.unit, relative=output.relative or taken.relative)
    except UnitError as error:
        raise InputError(f"{output.name} -> {taken.name}: {error}", key=key) from None


def loops_of(links: Sequence[Link]) -> list[list[Link]]:
    """Return the connections between units that answer to each other, loop by loop."""
    names = sorted({part.name for link in links for part in (link.source, link.target)})
    place = {name: number for number, name in enumerate(names)}
    rows = [place[link.source.name] for link in links]
    columns = [place[link.target.name] for link in links]
    graph = coo_matrix((np.ones(len(links)), (rows, columns)), shape=(len(names), len(names)))
    count, group_of = connected_components(graph, directed=True, connection="strong")
    inner = [(group_of[i], link) for i, j, link in zip(rows, columns, links)
             if group_of[i] == group_of[j]]  # fmt: skip
    return [found for group in range(count) if (found := [link for g, link in inner if g == group])]


class Lines:
    """What changes in jumps: switches, whole numbers, texts and discrete reals.

    In a serial order a unit gets what those before it have just found, and from those after it what
    they had at the begin of the window. In a parallel order all get what was there at its begin.

    Iterated, what was there at the begin is a first guess: :meth:`begin` and :meth:`follow` make
    this the ``jumps`` of a coupled system, which repeats the window until all get what they find.

    Parameters
    ----------
    order : names of the units in which a serial scheme advances them; None if all go at once.
    relative : change of real numbers that counts for none, as a part of their size.
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
        place = {name: number for number, name in enumerate(order or ())}
        self.backward = [
            link
            for link in self._links
            if order is None or place[link.source.name] >= place[link.target.name]
        ]
        self._kept = self.backward if iterated or not self._serial else []
        self._frozen: dict[Link, NDArray[Any]] = {}
        self._given: dict[Link, NDArray[Any]] = {}

    def refresh(self) -> None:
        """Note what the sources have now: a window begins."""
        self._frozen = {link: link.fetch() for link in self._kept}
        self._given = dict(self._frozen)

    def begin(self) -> None:
        """Give what there was at the begin of the window."""
        self._given = dict(self._frozen)

    def follow(self) -> list[str]:
        """Give what the sources have found from now on; return in words what that changes."""
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
            part.bring = self._bringer(part)

    def _bringer(self, part: FmuPart) -> Any:
        return lambda: self.bring(part)


def _agree(before: NDArray[Any], now: NDArray[Any], relative: float) -> bool:
    """Whether values are the same, reals up to a part of their size."""
    if now.dtype.kind != "f":
        return bool(np.array_equal(before, now))
    size = float(np.abs(now).max(initial=0.0))
    return bool(np.all(np.abs(now - before) <= relative * size))


def _change(link: Link, before: NDArray[Any], now: NDArray[Any]) -> str:
    """Return in words what a connection carries now instead; of a field its first new value."""
    place = int(np.flatnonzero(before.reshape(-1) != now.reshape(-1))[0])
    one, other = (_shown(link, values.reshape(-1)[place]) for values in (before, now))
    where = f", value {place}," if now.size > 1 else ""
    return f"{link.name}{where} from {one} to {other}"


def _shown(link: Link, value: Any) -> str:
    if link.input.kind in TRUTHS:
        return "true" if value else "false"
    return f'"{value}"' if link.input.is_text else str(value)
