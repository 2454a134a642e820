"""A participant of preCICE from its file to its results: the part that it names, and its files."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lcmchain.coupling.filling_part import FillingPart
from lcmchain.coupling.forming_fields import forming_datasets
from lcmchain.coupling.infiltration.files import FILLING_FIELDS
from lcmchain.coupling.infiltration.flow.preform import FlowMesh
from lcmchain.coupling.infiltration.formed_part import FormedPart, part_of_case, read_formed_part
from lcmchain.coupling.infiltration.setup import FillingSetup, set_up
from lcmchain.coupling.infiltration.stage import FillingRun, FillOptions, Tell, write_filled
from lcmchain.coupling.iteration.consolidation import Column, FluidColumn, SolidColumn
from lcmchain.coupling.iteration.interface import CoupledPart
from lcmchain.coupling.mould import begin, closure_of, seen_across
from lcmchain.coupling.precice_adapter.adapter import Adapter, Steps, open_participant
from lcmchain.coupling.precice_adapter.case import (
    ColumnPart,
    CompactionPart,
    FormingPart,
    InfiltrationPart,
    PreciceCase,
)
from lcmchain.coupling.solids.explicit import ExplicitForming
from lcmchain.coupling.solids.local import LocalCompaction
from lcmchain.coupling.solids.stack_compaction import compaction_of
from lcmchain.errors import InputError
from lcmchain.fields import write_forming_netcdf
from lcmchain.fields.netcdf_file import write_netcdf
from lcmchain.fields.ugrid import TIME
from lcmchain.scene import read_infiltration, read_scene
from lcmchain.scene.infiltration.boundaries import Closure

#: Relative difference of thickness below which a textile begins as it was formed.
BEGINS_AS_FORMED = 1e-6


def run_participant(
    case: PreciceCase, directory: Path, out: Path, *, tell: Tell | None = None
) -> tuple[Steps, list[Path]]:
    """Run a participant to the end of the coupling; return its steps and the files of its results.

    Parameters
    ----------
    directory : folder to which the file names of the case are relative.
    out : folder of the results.
    tell : called with the finished share of the work and a text.

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


@dataclass(frozen=True)
class Simulated:
    """A part, what records after every window, and what writes the results into a folder."""

    part: CoupledPart
    on_window: Callable[[CoupledPart], None]
    write: Callable[[Path], list[Path]]


def build_part(case: PreciceCase, directory: Path, tell: Tell) -> Simulated:
    """Build the part of a participant; file names are relative to ``directory``.

    Raises
    ------
    InputError : as the readers of its files do.
    """
    part, name = case.part, case.participant.lower()
    if isinstance(part, InfiltrationPart):
        return _infiltration(part, directory, name, tell)
    if isinstance(part, CompactionPart):
        return _compaction(part, directory, name)
    if isinstance(part, FormingPart):
        return _forming(part, directory, tell)
    return _column(part)


def _infiltration(part: InfiltrationPart, directory: Path, name: str, tell: Tell) -> Simulated:
    formed = part_of_case(
        directory / part.source, read_infiltration(directory / part.case).preform,
        length_unit=part.length_unit, frame=part.frame,
    )  # fmt: skip
    setup, closure = _set_up(formed, directory / part.case)
    run = FillingRun(setup, None, {}, tell)
    fluid = FillingPart(run.filling)
    if closure is not None:
        begin(setup.part, fluid, closure)
    run.begin()

    def write(out: Path) -> list[Path]:
        full = run.filling.state.full.all()
        filled = run.found("filled" if full else "reached", f"{fluid.time:.6g} s are reached")
        report = write_filled(filled, name=name, out_dir=out, options=FillOptions(), tell=tell)
        return [out / file for file in report.files.values()]

    def on_window(_: CoupledPart) -> None:
        run.note(run.filling)

    return Simulated(fluid, on_window, write)


def _set_up(formed: FormedPart, path: Path) -> tuple[FillingSetup, Closure | None]:
    """Return the set-up of a case without its closure, and the closure."""
    case = read_infiltration(path)
    setup = set_up(formed, case.model_copy(update={"closure": None}), path.resolve().parent)
    return setup, case.closure


def _compaction(part: CompactionPart, directory: Path, name: str) -> Simulated:
    formed = read_formed_part(directory / part.source, frame=part.frame)
    solid = _textile(part, formed, directory)
    times, thicknesses = [0.0], [solid.thickness]

    def on_window(_: CoupledPart) -> None:
        times.append(solid.time)
        thicknesses.append(solid.thickness)

    def write(out: Path) -> list[Path]:
        field = FILLING_FIELDS["pressed_thickness"]
        saved = (TIME, np.array(times), {"units": "s", "long_name": "time"})
        dataset = formed.dataset.assign_coords({TIME: saved})
        about = {**field.attributes(field.name), "_FillValue": np.nan}
        dataset[field.name] = formed.mesh.on_cells(np.stack(thicknesses), about)
        write_netcdf(out / f"{name}.nc", {"/": dataset})
        return [out / f"{name}.nc"]

    return Simulated(solid, on_window, write)


def _textile(part: CompactionPart, formed: FormedPart, directory: Path) -> LocalCompaction:
    """Return the textile at its start: as in the case of the infiltration, or pressed dry."""
    if part.case is not None:
        setup, closure = _set_up(formed, directory / part.case)
        if closure is None:
            raise InputError(
                f"has no [closure], so that nothing presses the textile; give one in {part.case}",
                key="part.case",
            )
        return begin(setup.part, FillingPart(setup.filling()), closure).solid
    assert part.closure is not None
    law, mesh = compaction_of(formed), FlowMesh.from_target(formed.target)
    across = seen_across(mesh, getattr(part.closure, "direction", None))
    thickness = formed.cell("thickness")
    solid = LocalCompaction(
        law, closure_of(part.closure, thickness, across), mesh.areas,
        pore_pressure=part.pressure or 0.0, centres=mesh.centroids,
    )  # fmt: skip
    thinner = float(np.max(1.0 - solid.thickness / thickness))
    if thinner > BEGINS_AS_FORMED:
        warnings.warn(
            f"the textile is pressed dry and begins up to {100.0 * thinner:.3g} % thinner than it "
            "was formed; an infiltration begins as thick as formed unless its case has the same "
            "closure: give the closure there, and name that case with case in place of closure",
            stacklevel=2,
        )
    return solid


def _forming(part: FormingPart, directory: Path, tell: Tell) -> Simulated:
    scene = read_scene(directory / part.scene)
    forming = ExplicitForming.from_scene(scene, surroundings=part.surroundings, ramped=part.ramped)
    end = scene.process.time
    frames = [forming.simulation.snapshot()]

    def on_window(_: CoupledPart) -> None:
        share = forming.time / end
        if share * (scene.process.frames - 1) >= len(frames) * (1.0 - 1e-9):
            frames.append(forming.simulation.snapshot())
        tell(share, f"forming, {1e3 * forming.time:.4g} ms")

    def write(out: Path) -> list[Path]:
        if frames[-1].time < forming.time:
            frames.append(forming.simulation.snapshot())
        reached = forming.time >= end * (1.0 - 1e-9)
        state = "complete" if reached else f"stopped: the coupling ended at {forming.time:g} s"
        datasets = forming_datasets(scene, forming.simulation, frames, state=state)
        write_forming_netcdf(out / "forming.nc", datasets)
        return [out / "forming.nc"]

    return Simulated(forming, on_window, write)


def _column(part: ColumnPart) -> Simulated:
    column = Column(**part.model_dump(exclude={"type", "side"}))
    side: SolidColumn | FluidColumn
    side = SolidColumn(column) if part.side == "solid" else FluidColumn(column)
    field = "thickness" if part.side == "solid" else "pore_pressure"
    rows = [f"time [s],{field} [SI] from the base to the top"]

    def on_window(_: CoupledPart) -> None:
        values = side.get_fields([field])[field]
        rows.append(",".join(repr(float(v)) for v in (side.time, *values)))

    def write(out: Path) -> list[Path]:
        file = out / f"{part.side}.csv"
        file.write_text("\n".join(rows) + "\n", encoding="utf-8")
        return [file]

    return Simulated(side, on_window, write)
