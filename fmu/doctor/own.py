"""Whether the resources of a unit of this lcmchain are whole."""

from __future__ import annotations

import json
from pathlib import Path

from lcmchain import __version__
from lcmchain.errors import LcmchainError
from lcmchain.fmu.description import TOOL
from lcmchain.fmu.doctor.description import Description
from lcmchain.fmu.doctor.findings import Diagnosis, Level
from lcmchain.fmu.instances import UNIT_FILE, define


def examine_own(diagnosis: Diagnosis, description: Description, resources: Path) -> None:
    """Read what the unit would read at its start, if this lcmchain has built it."""
    if description.generation_tool != TOOL:
        return
    try:
        unit = json.loads((resources / UNIT_FILE).read_text(encoding="utf-8"))
        if unit["lcmchain_version"] != __version__:
            return
        definition, _ = define(unit, resources)
        if definition.guid != unit["guid"]:
            raise ValueError("its variables are not those of its identifier")
    except (LcmchainError, OSError, ValueError, KeyError, TypeError) as error:
        diagnosis.add(
            Level.MISSING, "resources", f"they are missing or damaged ({error})",
            "build the unit again",
        )  # fmt: skip
