"""Open the unit whose resources lie in a folder."""

from __future__ import annotations

import copy
import json
import re
import sys
from pathlib import Path
from typing import Any

from lcmchain import __version__
from lcmchain.errors import InputError, LcmchainError
from lcmchain.fmu.conduct import Report, encodable, say_on_stderr
from lcmchain.fmu.part import Part, SavedState, UnitDefinition, Unreadable
from lcmchain.fmu.unit import Unit

#: File in the resources of a unit that says what it holds; written by ``fmu/build.py``.
UNIT_FILE = "unit.json"

# Units that were opened last, by folder: a reset must not need the folder again, and a reset that
# fails ends the host.
_opened: dict[str, tuple[UnitDefinition, Part]] = {}
_MOST_OPENED = 8


def define(unit: dict[str, Any], resources: Path) -> tuple[UnitDefinition, Part]:
    """Return what a unit is and its physics, from its :data:`UNIT_FILE` and its resources.

    Raises
    ------
    InputError : the resources are not those of a unit that this lcmchain knows.
    """
    # A process that runs units of one part does not load the physics of the other.
    if unit["part"] == "forming":
        from lcmchain.fmu.forming.part import define_forming

        return define_forming(unit, resources)
    if unit["part"] == "infiltration":
        from lcmchain.fmu.infiltration.part import define_infiltration

        return define_infiltration(unit, resources)
    raise InputError(f'this lcmchain {__version__} knows no unit of the part "{unit["part"]}"')


def open_unit(resources: str, name: str, report: Report, *, arrays: bool) -> Unit:
    """Return a new instance of the unit; whatever stops that is told on stderr as well.

    Raises
    ------
    LcmchainError : there is no unit, or it was built with another lcmchain.
    """
    # The exporters put the folder into the search path at every instantiation.
    here = resources.rstrip("/\\")
    sys.path[:] = [path for path in sys.path if path.rstrip("/\\") != here]
    try:
        definition, part = _definition(Path(resources))
        _remember(resources, definition, part)
    except Exception as error:  # of a file that is damaged, whatever reading it ends with
        if resources in _opened:
            definition, part = _opened[resources]
            return Unit(definition, copy.copy(part), name, report, arrays=arrays)
        message = f"{name}: {error}" if isinstance(error, LcmchainError) else _no_unit(name, error)
        message = encodable(message)
        say_on_stderr(message)
        raise InputError(message) from None
    return Unit(definition, part, name, report, arrays=arrays)


def read_state(content: bytes) -> SavedState | Unreadable:
    """Return the state that bytes hold, or why they hold none; never raises."""
    try:
        return SavedState.from_bytes(content)
    except Unreadable as error:
        return error
    except BaseException as error:  # no memory: the host must not end here
        return Unreadable(f"the saved state cannot be read ({error})")


def _remember(resources: str, definition: UnitDefinition, part: Part) -> None:
    _opened.pop(resources, None)
    _opened[resources] = definition, copy.copy(part)
    if len(_opened) > _MOST_OPENED:
        _opened.pop(next(iter(_opened)))


def _definition(resources: Path) -> tuple[UnitDefinition, Part]:
    unit = json.loads((resources / UNIT_FILE).read_text(encoding="utf-8"))
    definition, part = define(unit, resources)
    if definition.guid != unit["guid"]:
        raise InputError(
            f"the unit was built with lcmchain {unit['lcmchain_version']}; the lcmchain "
            f"{__version__} of this environment gives it other variables: build it again",
            file=definition.model_name,
        )
    require_own_description(resources.parent / "modelDescription.xml", definition)
    return definition, part


def require_own_description(path: Path, definition: UnitDefinition) -> None:
    """Check the model description beside the resources: masters take the identifier from there.

    pythonfmu does not hand on the identifier that a master instantiates with.

    Raises
    ------
    InputError : the description is that of another unit.
    """
    try:
        head = path.read_text(encoding="utf-8", errors="replace")[:4000]
    except OSError:
        return  # a master may unpack the resources alone
    match = re.search(r'(?:guid|instantiationToken)="([^"]*)"', head)
    if match is not None and match[1].strip("{}") != definition.guid:
        raise InputError(
            f"modelDescription.xml is that of another unit ({match[1]} instead of "
            f"{definition.guid}); unpack the unit again",
            file=path,
        )


def _no_unit(name: str, error: Exception) -> str:
    return (
        f"{name}: the resources of the unit are missing or damaged ({error}); unpack the unit again"
    )
