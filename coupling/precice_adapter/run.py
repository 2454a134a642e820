"""A participant from its file to its results."""

from __future__ import annotations

from pathlib import Path

from lcmchain.coupling.infiltration.stage import Tell
from lcmchain.coupling.precice_adapter.adapter import Adapter, Steps
from lcmchain.coupling.precice_adapter.case import PreciceCase
from lcmchain.coupling.precice_adapter.library import open_participant
from lcmchain.coupling.precice_adapter.parts import build_part


def run_participant(
    case: PreciceCase, directory: Path, out: Path, *, tell: Tell | None = None
) -> tuple[Steps, list[Path]]:
    """Couple a participant to its end; return how far it came, and the files of its results.

    Parameters
    ----------
    directory : folder to which the file names of the case are relative. out : of the results.
    tell : called with a share of the work and a text.

    Raises
    ------
    InputError : the part, the fields or the configuration are wrong.
    SimulationError : a step that the part could not do.
    """
    simulated = build_part(case, directory, tell or (lambda share, text: None))
    participant = open_participant(case.participant, directory / case.config)
    adapter = Adapter(
        simulated.part, participant, case.reads, case.writes, substeps=case.substeps,
        name=case.participant,
    )  # fmt: skip
    steps = adapter.run(simulated.on_window)
    return steps, simulated.write(out)
