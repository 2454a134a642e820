"""The file of a participant (TOML): what it simulates, and which fields it exchanges."""

from __future__ import annotations

import difflib
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, Self

from pydantic import Field, ValidationError, model_validator

from lcmchain.coupling.precice_adapter.adapter import Read, Write
from lcmchain.errors import InputError
from lcmchain.quantities.entry_types import FROM_FILE, LengthUnit, Pressure, SceneModel, wrong
from lcmchain.scene.infiltration.boundaries import Closure
from lcmchain.scene.reading.read import parse_toml, read_text

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails


class InfiltrationPart(SceneModel):
    """Resin in a formed part, whose volume the other side changes.

    ``source`` is the mesh, in ``length_unit``, where the case has a preform that was not formed. A
    closure of the case determines thickness and pressures at the start only; afterwards the other
    side presses.
    """

    type: Literal["infiltration"]
    source: str
    case: str
    frame: int = -1
    length_unit: Annotated[str, LengthUnit()] = "m"


class CompactionPart(SceneModel):
    """The textile of a formed part under a closure; the other side gives the pore pressure.

    The closure is ``closure``, or that of the infiltration's ``case``: then the textile begins with
    the resin and the pressures of this case, as the infiltration does.
    """

    type: Literal["compaction"]
    source: str
    closure: Closure | None = None
    case: str | None = None
    pressure: Pressure | None = None
    frame: int = -1

    @model_validator(mode="after")
    def _check_start(self) -> Self:
        if (self.closure is None) == (self.case is None):
            both = "both" if self.case is not None else "neither"
            raise wrong(
                "is needed, or in its place case, the file of an infiltration with a closure; "
                f"there is {both}",
                field="closure",
            )
        if self.case is not None and self.pressure is not None:
            raise wrong("is that of the case; leave it out", field="pressure")
        if self.closure is None:
            return self
        for name in ("window", "tolerance"):
            if name in self.closure.model_fields_set:
                raise wrong(
                    "is decided by the configuration of preCICE; leave it out",
                    field=f"closure.{name}",
                )
        if getattr(self.closure, "pressed", None) == "wet":
            raise wrong(
                'is "wet", but only the case of the infiltration knows where resin is: give the '
                "closure there, and name that case here with case in place of closure",
                field="closure.pressed",
            )
        return self


class FormingPart(SceneModel):
    """An explicit forming simulation with a pore pressure in its elements."""

    type: Literal["forming"]
    scene: str
    surroundings: Pressure = Field(default="0 MPa")  # type: ignore[assignment]
    ramped: bool = False


class ColumnPart(SceneModel):
    """One side of a consolidating column (Terzaghi), to try a coupling; SI units."""

    type: Literal["column"]
    side: Literal["solid", "fluid"]
    height: float = 0.01
    cell_count: int = 40
    modulus: float = 1e6
    permeability: float = 1e-12
    viscosity: float = 0.1
    load: float = 1e5


Part = Annotated[
    InfiltrationPart | CompactionPart | FormingPart | ColumnPart, Field(discriminator="type")
]


class ReadEntry(SceneModel):
    """Data that are an input of the part; see :class:`Read`."""

    data: str
    field: str
    mesh: str | None = None
    within: Literal["linear", "held"] = "linear"


class WriteEntry(SceneModel):
    """An output of the part; see :class:`Write`."""

    data: str
    field: str
    mesh: str | None = None
    of_window: Literal["end", "mean"] = "end"


class PreciceCase(SceneModel):
    """A participant: names in the configuration, part, and fields."""

    participant: str
    config: str
    mesh: str
    part: Part
    substeps: Annotated[int, Field(ge=1, le=100_000)] = 1
    read: tuple[ReadEntry, ...] = ()
    write: tuple[WriteEntry, ...] = ()

    @property
    def reads(self) -> list[Read]:
        """Inputs with their meshes."""
        return [Read(e.data, e.mesh or self.mesh, e.field, e.within) for e in self.read]

    @property
    def writes(self) -> list[Write]:
        """Outputs with their meshes."""
        return [Write(e.data, e.mesh or self.mesh, e.field, e.of_window) for e in self.write]


def read_case(path: Path) -> PreciceCase:
    """Read and validate the file of a participant.

    Raises
    ------
    InputError : it cannot be read, is not TOML, or an entry is wrong; names all of them.
    """
    if path.is_dir():
        raise InputError("is a folder; name the file of a participant in it", file=path)
    data = parse_toml(read_text(path), path)
    try:
        return PreciceCase.model_validate(data, context=FROM_FILE)
    except ValidationError as error:
        lines = [_line(details) for details in error.errors(include_url=False)[:20]]
        raise InputError("; ".join(lines), file=path) from None


def _line(details: ErrorDetails) -> str:
    """Return one wrong entry in words."""
    steps = [step for step in details["loc"] if step not in _tags()]
    if field := details.get("ctx", {}).get("field"):  # of a check of the whole table
        steps.append(field)
    key = "".join(f"[{s}]" if isinstance(s, int) else f".{s}" for s in steps).removeprefix(".")
    if details["type"] == "missing":
        return f"{key} is missing"
    if details["type"] == "extra_forbidden":
        known = sorted({name for model in _models() for name in model.model_fields})
        near = difflib.get_close_matches(str(steps[-1]), known, n=1)
        return f"{key} is unknown" + (f'; did you mean "{near[0]}"?' if near else "")
    return f"{key}: {details['msg']}"


def _models() -> tuple[type[SceneModel], ...]:
    return (PreciceCase, InfiltrationPart, CompactionPart, FormingPart, ColumnPart, ReadEntry,
            WriteEntry)  # fmt: skip


def _tags() -> set[str]:
    return {"infiltration", "compaction", "forming", "column", "bag", "gap", "press"}
