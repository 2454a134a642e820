"""The chain of stages: form the blank, write its fields, carry them over to other meshes."""

from __future__ import annotations

import json
import time
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr

from lcmchain.atomic import replacing
from lcmchain.check import require_no_initial_overlap
from lcmchain.errors import LcmchainError, MappingError, SimulationError
from lcmchain.fields import (
    FrameSeries,
    Histories,
    add_face_variables,
    model_datasets,
    write_forming_netcdf,
    write_pvd,
    write_vtu,
)
from lcmchain.fingerprint import run_fingerprint
from lcmchain.forming_run import FormingRun, Progress
from lcmchain.scene import Scene
from lcmchain.scene.permeability import Permeability
from lcmchain.solver.checkpoint import Checkpoint, read_checkpoint, remove_checkpoint
from lcmchain.solver.simulation import Simulation, Snapshot
from lcmchain.summary import run_summary
from lcmchain.threads import use_threads
from lcmchain.tools import ToolWarning

SUMMARY_FILE = "summary.json"


@dataclass(frozen=True)
class Result:
    """What a run leaves: the groups of ``forming.nc`` by name, the summary, and the folder."""

    datasets: dict[str, xr.Dataset]
    summary: dict
    folder: Path


def run(
    scene: Scene,
    out: Path | str,
    *,
    threads: int | None = None,
    resume: bool = False,
    progress: Progress | None = None,
) -> Result:
    """Run every stage that the scene names and write the results into ``out``.

    Parameters
    ----------
    scene : from :func:`lcmchain.read_scene`.
    out : folder of the results, made if it does not exist.
    threads : of the compiled loops, all cores by default; the fields do not depend on it.
    resume : go on from the checkpoint in ``out``; the result is that of an uninterrupted run.
    progress : called with (completed, total, text).

    Raises
    ------
    InputError : wrong input; nothing was computed.
    MappingError : forming is complete and its files are whole, but a mesh could not be mapped
        onto; the checkpoint is left, so that ``resume`` maps without forming again.
    SimulationError : a guard stopped the run; ``forming.nc`` holds the frames up to then.
    SimulationInterrupted : the user stopped the run; a checkpoint was left.
    """
    from lcmchain.report.run_pictures import draw_run, require_film

    folder = Path(out)
    report = progress or (lambda completed, total, text="": None)  # type: ignore[misc]
    thread_count = use_threads(threads)
    fingerprint = run_fingerprint(scene)
    checkpoint = read_checkpoint(folder, fingerprint) if resume else None
    _require_readable_targets(scene)

    report(0.0, scene.process.time, "building the model")
    simulation, tool_warnings = _build_simulation(scene)
    require_no_initial_overlap(scene, simulation.model.blank, simulation.model.tools)
    require_film(scene.output, simulation.model.blank, simulation.model.material)
    folder.mkdir(parents=True, exist_ok=True)

    report(0.0, scene.process.time, "compiling")
    start = time.perf_counter()
    simulation.compile()
    compile_s = time.perf_counter() - start

    forming = FormingRun(scene, fingerprint, simulation, folder, report)
    snapshots = _form(forming, checkpoint)

    report(scene.process.time, scene.process.time, "writing fields")
    datasets = _write_fields(scene, simulation, snapshots, folder)
    summary = run_summary(
        scene,
        simulation,
        snapshots,
        datasets,
        run_fingerprint=fingerprint.sha256,
        wall_s=forming.wall_s,
        compile_s=compile_s,
        threads=thread_count,
        warnings=[*tool_warnings, *simulation.warnings()],
    )
    result = Result(datasets, summary, folder)
    _write_summary(result)  # forming is complete: nothing that fails from here on may lose it
    draw_run(
        scene,
        simulation.model.tools,
        datasets,
        folder,
        lambda text: report(scene.process.time, scene.process.time, text),
    )
    report(scene.process.time, scene.process.time, "mapping")
    _map_fields(scene, result)
    remove_checkpoint(folder)
    return result


def _form(forming: FormingRun, checkpoint: Checkpoint | None) -> list[Snapshot]:
    """Complete the forming run; where a guard stops it, write the frames up to then."""
    try:
        return forming.complete(checkpoint)
    except SimulationError as error:
        folder = forming.folder
        _write_fields(forming.scene, forming.simulation, forming.snapshots, folder)
        (folder / SUMMARY_FILE).unlink(missing_ok=True)  # of an earlier run
        last = 1e3 * forming.snapshots[-1].time
        raise SimulationError(
            f"{error}. The frames up to {last:.4g} ms are in {folder / 'forming.nc'}"
        ) from None


def _write_fields(
    scene: Scene, simulation: Simulation, snapshots: list[Snapshot], folder: Path
) -> dict[str, xr.Dataset]:
    model = simulation.model
    frames = FrameSeries.from_snapshots(snapshots, model.tool_names)
    histories = Histories.from_state(model, simulation.state)
    datasets = model_datasets(scene, model, frames, histories)
    if scene.permeability is not None and model.material.fibre_density is not None:
        datasets = add_face_variables(datasets, _permeabilities(scene.permeability, datasets["/"]))
    write_forming_netcdf(folder / "forming.nc", datasets)
    if scene.output.vtu:
        write_vtu(folder / "forming.vtu", datasets)
        write_pvd(folder / "forming.pvd", datasets)
    return datasets


def _permeabilities(
    law: Permeability, sheet: xr.Dataset
) -> dict[str, tuple[np.ndarray, dict[str, str]]]:
    from lcmchain.coupling.permeability import principal_permeabilities

    def vectors(name):
        return np.stack([sheet[f"{name}_{axis}"].values for axis in "xyz"], axis=-1)

    fraction = sheet["fibre_volume_fraction"].values
    result = principal_permeabilities(
        law,
        fraction.ravel(),
        vectors("fibre_direction_1").reshape(-1, 3),
        vectors("fibre_direction_2").reshape(-1, 3),
        out_of_range="nan",
    )
    return {
        f"permeability_{i}": (
            getattr(result, f"k{i}").reshape(fraction.shape),
            {"units": "m2", "long_name": f"principal permeability {i} ({law.law})"},
        )
        for i in (1, 2, 3)
    }


def _require_readable_targets(scene: Scene) -> None:
    """Read every mesh to map onto once: a wrong one is told before anything is computed."""
    if not scene.mapping:
        return
    from lcmchain.mapping import read_target

    for target in scene.mapping:
        path = scene.source.directory / target.mesh
        read_target(path, kind=target.kind, length_unit=target.length_unit)


def _map_fields(scene: Scene, result: Result) -> None:
    """Map onto every mesh of the scene, and keep the summary up to date.

    Raises
    ------
    MappingError : after all have been tried.
    """
    if not scene.mapping:
        return
    from lcmchain.mapping import map_forming

    failures = []
    for target in scene.mapping:
        try:
            report = map_forming(
                result.datasets["/"],
                scene.source.directory / target.mesh,
                name=target.name,
                kind=target.kind,
                method=target.method,
                maximum_distance=target.maximum_distance,
                length_unit=target.length_unit,
                out_dir=result.folder,
                picture=scene.output.pictures,
            )
            result.summary["mapping"][target.name] = report.as_dict()
        except LcmchainError as error:
            failures.append(f'mapping "{target.name}" failed: {error}')
            result.summary["mapping"][target.name] = {"error": str(error)}
        _write_summary(result)
    if failures:
        raise MappingError(
            f"{'. '.join(failures)}. The forming results in {result.folder} are complete; mend the "
            "mesh or its [[mapping]] entry, and the same command with --resume maps without "
            "forming again",
            result,
        )


def _build_simulation(scene: Scene) -> tuple[Simulation, list[str]]:
    """Build the simulation; what its tools warn of is said at once and kept for the summary."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        simulation = Simulation.from_scene(scene)
    for warning in caught:
        warnings.warn_explicit(warning.message, warning.category, warning.filename, warning.lineno)
    return simulation, [str(w.message) for w in caught if issubclass(w.category, ToolWarning)]


def _write_summary(result: Result) -> None:
    with replacing(result.folder / SUMMARY_FILE) as path:
        path.write_text(json.dumps(result.summary, indent=2) + "\n", encoding="utf-8")
