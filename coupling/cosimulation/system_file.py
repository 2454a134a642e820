"""The file of a system (TOML): units, connections, scheme, windows, recorder."""

from __future__ import annotations

import copy
import hashlib
import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, PrivateAttr, ValidationError, model_validator

from lcmchain.coupling.cosimulation.physical_units import PhysicalUnit
from lcmchain.errors import InputError, shortened
from lcmchain.quantities.entry_types import (
    FROM_FILE,
    NOT_NEGATIVE,
    POSITIVE,
    AbsentMeans,
    Name,
    Number,
    PositiveTime,
    Range,
    Row,
    SceneModel,
    Switch,
    Text,
    TimeOrZero,
    wrong,
)
from lcmchain.scene.reading.explain import MOST_PROBLEMS, documents_of, problems_of
from lcmchain.scene.reading.overrides import TomlTable, apply_overrides
from lcmchain.scene.reading.read import (
    directory_of,
    input_error,
    parse_toml,
    read_text,
    require_within_limits,
)

#: Group of the convergence in the record; no unit may have this name.
CONVERGENCE_GROUP = "coupling"

_LINK = re.compile(r"\s*([^\s.]+)\.(.+?)\s*->\s*([^\s.]+)\.(.+?)\s*")
_OF_TERMINALS = re.compile(r"\s*([^\s.]+)\.(.+?)\s*<->\s*([^\s.]+)\.(.+?)\s*")

Relative = Annotated[float, Number(1e-6, Range(0.0, 1.0, (0.0,)))]
Positive = Annotated[float, Number(1.0, POSITIVE)]
Factor = Annotated[float, Number(0.5, Range(0.0, 1.0, (0.0,)))]
Order = Annotated[int, Number(1, Range(0, 2), whole=True)]
Share = Annotated[float, Number(1e-3, Range(0.0, 1.0, (0.0,)))]
NotNegative = Annotated[float, Number(1e-6, NOT_NEGATIVE)]
Bound = Annotated[float, Number(0.0)]


class UnitEntry(SceneModel):
    """A unit of the system."""

    name: Annotated[str, Name("press")] = Field(description="Name of the unit in the system.")
    fmu: Annotated[str, Text("press.fmu")] = Field(
        description="Archive of the unit, relative to the file of the system."
    )
    start: dict[str, Any] = Field(
        default={}, description="Start values of parameters and inputs, quantities with units."
    )
    quantities: dict[str, str] = Field(
        default={}, description="Units of variables to which the unit itself gives none."
    )
    substeps: Annotated[int, Number(1, Range(1, 1_000_000), whole=True)] = Field(
        default=1, description="Steps of the unit within a window."
    )
    debug: Switch = Field(default=False, description="Ask the unit for all its messages.")
    process: Annotated[
        Literal["own", "shared"] | None, AbsentMeans("shared for units of lcmchain, else own")
    ] = Field(
        default=None,
        description="Own: in a process of its own, whose end or hanging does not take the run "
        "along. Shared: in that of the command, which costs least.",
    )
    step_limit: Annotated[PositiveTime | None, AbsentMeans("1 h; none in a shared process")] = (
        Field(
            default=None,
            description="Wall-clock time that a step of a unit in a process of its own may take; "
            "other calls have a minute at least.",
        )
    )

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.step_limit is not None and self.process == "shared":
            raise wrong('only a unit with process = "own" can be ended', field="step_limit")
        return self


class ConnectionEntry(SceneModel):
    """An output that is led to an input; the numbers are in the unit of the input.

    Or two terminals of FMI 3.0, which stand for connections of all variables that they share.
    """

    link: Annotated[str, Text("press.force -> forming.punch.force_input")] = Field(
        description="From where to where: unit.output -> unit.input; of two terminals "
        "unit.terminal <-> unit.terminal."
    )
    factor: Bound = Field(default=1.0, description="The input is factor times the output ...")
    offset: Bound = Field(default=0.0, description="... plus this, after the unit conversion.")
    convert_units: Switch = Field(
        default=True, description="Convert between the units of measurement of both ends."
    )
    continuous: Switch = Field(
        default=False,
        description="Take a real output that is declared discrete for a continuous one, so that "
        "it is iterated and extrapolated.",
    )
    relative: Annotated[Relative | None, AbsentMeans("scheme.relative")] = Field(
        default=None, description="Tolerance, as a part of the field."
    )
    absolute: Annotated[Positive | None, AbsentMeans("none")] = Field(
        default=None, description="Change that is small enough whatever the field."
    )
    scale: Annotated[Positive | None, AbsentMeans("its largest size so far")] = Field(
        default=None, description="Size of the field, which weighs it against others."
    )
    relaxation: Factor = Field(default=1.0, description="Factor on top of the scheme's own.")
    bounds: Annotated[
        tuple[Bound, Bound] | None,
        Row("[0.0, 1e6]", count=2, entries="numbers", units=False),
        AbsentMeans("none"),
    ] = Field(default=None, description="Least and largest value that an iteration tries.")
    of_window: Literal["end", "mean"] = Field(
        default="end", description="What is sent of sub-steps: the last value or their mean."
    )
    within: Literal["linear", "held"] = Field(
        default="linear", description="What sub-steps of the target see between two windows."
    )

    @model_validator(mode="after")
    def _check(self) -> Self:
        if _LINK.fullmatch(self.link) is None:
            raise wrong(
                f'"{self.link}" is no connection; write "unit.output -> unit.input", or '
                '"unit.terminal <-> unit.terminal"',
                field="link",
            )
        if self.is_of_terminals and not (self.factor == 1.0 and self.offset == 0.0):
            raise wrong(
                "factor and offset are for a connection of two variables, this one is of terminals",
                field="factor" if self.factor != 1.0 else "offset",
            )
        return self

    @property
    def is_of_terminals(self) -> bool:
        """Whether it connects two terminals, and not two variables."""
        return _OF_TERMINALS.fullmatch(self.link) is not None

    @property
    def ends(self) -> tuple[str, str, str, str]:
        """Return source, its variable, target and its variable; or units and their terminals."""
        match = _OF_TERMINALS.fullmatch(self.link) or _LINK.fullmatch(self.link)
        assert match is not None
        source, output, target, name = match.groups()
        return source, output, target, name


class SchemeEntry(SceneModel):
    """How the units go through a window."""

    type: Literal["jacobi", "gauss-seidel", "fixed-point", "aitken", "iqn-ils", "iqn-mvj"] = Field(
        default="jacobi",
        description="jacobi and gauss-seidel go through each window once, the others iterate.",
    )
    order: Literal["serial", "parallel"] = Field(
        default="serial",
        description="Of the iterating schemes: one after the other or all at once.",
    )
    relative: Relative = Field(
        default=1e-6, description="Tolerance of every connection, as a part of the field."
    )
    relaxation: Annotated[Factor | None, AbsentMeans("as the scheme has it")] = Field(
        default=None, description="Factor of the first iteration."
    )
    most_iterations: Annotated[int, Number(50, Range(1, 100_000), whole=True)] = Field(
        default=50, description="A window that needs more has failed."
    )
    jumps: Literal["once", "iterated"] = Field(
        default="once",
        description="What changes in jumps and leads back is handed over once in a window, or the "
        "window is repeated until nothing of it changes.",
    )
    windows_reused: Annotated[int, Number(20, Range(0, 1000), whole=True)] = Field(
        default=20, description="IQN-ILS: windows whose differences are used again."
    )
    extrapolation: Annotated[
        Order | None, AbsentMeans("0 for jacobi and gauss-seidel, 1 for the others")
    ] = Field(default=None, description="Order of the extrapolation into a new window.")
    on_failure: Literal["stop", "go_on"] = Field(
        default="stop", description="What follows a window that does not converge."
    )

    @property
    def explicit(self) -> bool:
        return self.type in ("jacobi", "gauss-seidel")


class WindowEntry(SceneModel):
    """The communication steps."""

    size: PositiveTime = Field(description="Size of the first window, and of all by default.")
    smallest: Annotated[PositiveTime | None, AbsentMeans("size")] = Field(
        default=None, description="A window that fails is halved down to this size."
    )
    largest: Annotated[PositiveTime | None, AbsentMeans("size")] = Field(
        default=None, description="Windows that go easily grow up to this size."
    )
    residual: Annotated[Share | None, AbsentMeans("not looked at")] = Field(
        default=None,
        description="Wanted error of the extrapolation, as a part of the field; leads the size.",
    )

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.smallest is not None and self.smallest > self.size:
            raise wrong("must not be above size", field="smallest")
        if self.largest is not None and self.largest < self.size:
            raise wrong("must not be below size", field="largest")
        return self

    @property
    def varies(self) -> bool:
        return (self.smallest or self.size) < self.size or (self.largest or self.size) > self.size


class RecorderEntry(SceneModel):
    """What is recorded over time."""

    variables: Annotated[
        tuple[str, ...], Row('["press.force", "forming.*"]', entries="names", units=False)
    ] = Field(default=("*.*",), description='Names of variables; "*" stands for any text.')
    fields: Switch = Field(default=True, description="Record whole fields too.")
    every: Annotated[int, Number(1, Range(1, 1_000_000), whole=True)] = Field(
        default=1, description="Record every so many windows; the last one always."
    )


def _link_table(value: object) -> object:
    return {"link": value} if isinstance(value, str) else value


def _window_table(value: object) -> object:
    return {"size": value} if isinstance(value, (str, int, float)) else value


class System(SceneModel):
    """Units that are simulated together."""

    title: Annotated[str, Text("Press and part")] = Field(
        default="Co-simulation", description="Title of the results."
    )
    start_time: TimeOrZero = Field(default="0 s", description="Begin.")  # type: ignore[assignment]
    stop_time: PositiveTime = Field(description="End.")
    window: Annotated[WindowEntry, BeforeValidator(_window_table)] = Field(
        description='The communication steps: their size, such as "10 ms", or a table.'
    )
    units: tuple[UnitEntry, ...] = Field(
        min_length=1, description="The units; serial schemes advance them in this order."
    )
    connections: tuple[Annotated[ConnectionEntry, BeforeValidator(_link_table)], ...] = Field(
        default=(), description='Connections: "unit.output -> unit.input", or tables.'
    )
    scheme: SchemeEntry = Field(
        default=SchemeEntry(), description="How the units go through a window."
    )
    recorder: RecorderEntry = Field(default=RecorderEntry(), description="What is recorded.")
    unit_tolerance: Annotated[NotNegative | None, AbsentMeans("left to the units")] = Field(
        default=None, description="Relative tolerance that the units are told."
    )

    _directory: Path = PrivateAttr(default_factory=Path.cwd)
    _source: str = PrivateAttr(default="")
    _remarks: list[str] = PrivateAttr(default_factory=list)
    _measures: dict[str, PhysicalUnit] = PrivateAttr(default_factory=dict)

    @model_validator(mode="after")
    def _check(self) -> Self:
        if not self.stop_time > self.start_time:
            raise wrong("must lie after start_time", field="stop_time")
        names = [unit.name for unit in self.units]
        for number, name in enumerate(names):
            if name in names[:number]:
                raise wrong(f'two units are named "{name}"', field=f"units[{number}].name")
            if name == CONVERGENCE_GROUP:
                raise wrong(
                    "the record keeps the convergence under this name; choose another one",
                    field=f"units[{number}].name",
                )
        for number, connection in enumerate(self.connections):
            source, _, target, _ = connection.ends
            for name in (source, target):
                if name not in names:
                    raise wrong(
                        f'there is no unit "{name}"; there are {", ".join(names)}',
                        field=f"connections[{number}]",
                    )
        return self

    @property
    def directory(self) -> Path:
        """Return the folder to which paths of units are relative."""
        return self._directory

    @property
    def source(self) -> str:
        """Return the text that it was read from."""
        return self._source

    @property
    def remarks(self) -> tuple[str, ...]:
        """Return messages on what its archive leaves open."""
        return tuple(self._remarks)

    @property
    def measures(self) -> dict[str, PhysicalUnit]:
        """Return the units of measurement that the archive of the system defines, by name."""
        return self._measures

    def digest(self) -> str:
        """Return a hash of all that the results of a run depend on."""
        return hashlib.sha256(json.dumps(self.settings(), sort_keys=True).encode()).hexdigest()

    def settings(self) -> dict[str, Any]:
        """Return all that the results of a run depend on but its units, as JSON can hold it."""
        apart = {"units": {"__all__": {"process", "step_limit"}}}
        tables = self.model_dump(mode="json", exclude={"title": True, "recorder": True, **apart})
        # entries that came later count only where they are set: older checkpoints stay valid
        for connection in tables["connections"]:
            if not connection["continuous"]:
                del connection["continuous"]
        if tables["scheme"]["jumps"] == "once":
            del tables["scheme"]["jumps"]
        return tables


def changed_settings(then: dict[str, Any], now: dict[str, Any]) -> list[str]:
    """Return in words the entries in which two settings of a system differ, units by their names.

    then, now : of :meth:`System.settings`.
    """
    earlier, later = _entries(then), _entries(now)
    return [
        f"{key} ({_entry_text(earlier, key)} then, {_entry_text(later, key)} now)"
        for key in {**later, **earlier}
        if earlier.get(key) != later.get(key)
    ]


def _entries(table: object, key: str = "") -> dict[str, object]:
    """Return the entries of nested tables by dotted keys."""
    if isinstance(table, list) and any(isinstance(entry, dict) for entry in table):
        names = [entry.get("name") or entry.get("link") or k for k, entry in enumerate(table)]
        # their order matters too
        found: dict[str, object] = {key: [str(name) for name in names]}
        rows = {f'{key}."{name}"' if " " in str(name) else f"{key}.{name}": entry
                for name, entry in zip(names, table)}  # fmt: skip
    elif isinstance(table, dict) and table:
        found = {}
        rows = {f"{key}.{name}" if key else name: entry for name, entry in table.items()}
    else:
        return {key: table}
    for name, entry in rows.items():
        found |= _entries(entry, name)
    return found


def _entry_text(entries: dict[str, object], key: str) -> str:
    value = entries.get(key)
    return "absent" if value is None else shortened(json.dumps(value))


def read_system(path: Path | str, overrides: Sequence[str] = ()) -> System:
    """Read the file of a system.

    Parameters
    ----------
    overrides : ``key=value`` texts, as for a scene; a unit is addressed by its name.

    Raises
    ------
    InputError : it cannot be read, is no TOML, or has wrong entries; one message names them all.
    """
    path = Path(path)
    if path.is_dir():
        raise InputError("is a folder; name the file of the system in it", file=path)
    text = read_text(path)
    return system_from(parse_toml(text, path), path, overrides, text=text)


def system_from(
    data: TomlTable,
    path: Path | None,
    overrides: Sequence[str] = (),
    *,
    directory: Path | None = None,
    text: str = "",
) -> System:
    """Validate a parsed document.

    Parameters
    ----------
    path : for messages; its folder is the default of ``directory``.
    directory : to which paths of units are relative.
    text : that it was read from.

    Raises
    ------
    InputError : entries are wrong.
    """
    if overrides:
        apply_overrides(data, overrides)
    require_within_limits(data, path)
    try:
        system = System.model_validate(copy.deepcopy(data), context=FROM_FILE)
    except ValidationError as error:
        with documents_of(System):
            problems = problems_of(error, data)
        unexplained = max(error.error_count() - MOST_PROBLEMS, 0)
        raise input_error(problems, path, unexplained=unexplained) from None
    if directory is None:
        directory = directory_of(path)
    system._directory, system._source = directory, text
    return system
