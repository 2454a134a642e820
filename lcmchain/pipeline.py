"""The chain of stages: form the blank, write its fields, carry them over to other meshes."""

from __future__ import annotations

import functools
import math
import time
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lcmchain.check import require_frames_fit, require_no_initial_overlap, run_effects
from lcmchain.check.effect_cost import later_stages
from lcmchain.check.expected_cost import record_speed
from lcmchain.check.remarks import scene_warnings
from lcmchain.check.tool_strokes import Closing, closing_tools, tools_that_close
from lcmchain.compilation.threads import use_threads
from lcmchain.effects.effect import Effect
from lcmchain.errors import (
    InputError,
    LcmchainError,
    MappingError,
    OutputError,
    SimulationError,
    UnfinishedRun,
)
from lcmchain.forming_run import FormingRun, Progress, RunAccount, state_after
from lcmchain.provenance import provenance, run_fingerprint, written_values
from lcmchain.report.style import CAPTIONS, START_PICTURE
from lcmchain.results import COMPLETE, RUNNING, ResultsFolder, read_state, stopped
from lcmchain.results.folder import SUMMARY_FILE
from lcmchain.results.log import LOG_FILE
from lcmchain.scene import Infiltration, MappingTarget, Scene
from lcmchain.scene.draping import courses_to_lay
from lcmchain.scene.output import NO_FILM, SHEET_NAME
from lcmchain.scene.stages import number_of_stage
from lcmchain.solver.checkpoint import FILE_NAME as CHECKPOINT
from lcmchain.solver.checkpoint import Checkpoint, read_checkpoint, remove_checkpoint
from lcmchain.solver.compile_beside import Helper, compile_loops
from lcmchain.solver.simulation import Simulation, Snapshot
from lcmchain.solver.stage_start import FROM, require_border, started
from lcmchain.summary import run_head, run_summary, scene_head
from lcmchain.tools import ToolTable, ToolWarning

# What a run needs after forming, or not at all, is imported where it is used: datasets and their
# files, pictures, draping, and the chain of mapping, coupling and solving.

if TYPE_CHECKING:
    import xarray as xr

#: Options with which a sheet is mapped onto any mesh, however badly it fits.
ANY_MESH: dict[str, Any] = {
    "maximum_distance": 1e3,
    "thickness_limit": 1e9,
    "allow_unmapped": True,
    "allow_ambiguous": True,
}


#: Option that names the stage with which a run ends.
UNTIL = "--until-stage"


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
    until_stage: str | None = None,
    start_from: Path | str | None = None,
    progress: Progress | None = None,
) -> Result:
    """Run every stage that the scene names and write the results into ``out``.

    What an earlier run left there is set aside until this one is complete
    (:class:`lcmchain.results.ResultsFolder`).

    Parameters
    ----------
    scene : from :func:`lcmchain.read_scene`.
    out : folder of the results, made if it does not exist.
    threads : of the compiled loops, by default all cores, but one where the mesh is small; the
        fields do not depend on it.
    resume : go on from the checkpoint in ``out``; the result is that of an uninterrupted run.
    until_stage : end with this stage of the scene. The results are those of its end, nothing is
        mapped, and a checkpoint is left from which ``resume`` goes on.
    start_from : folder of a run that has ended with a stage, whose scene has other stages behind
        it: go on from there. Nothing in that folder is changed.
    progress : called with (completed, total, text).

    Raises
    ------
    InputError : wrong input; nothing was computed.
    MappingError : forming is complete and its files are whole, but a mesh could not be mapped
        onto; the checkpoint is left, so that ``resume`` maps without forming again.
    SimulationError : a guard stopped the run; ``forming.nc`` holds the frames up to then.
    SimulationInterrupted : the user stopped the run; a checkpoint was left, and ``forming.nc``
        holds the frames up to then.
    OutputError : a file could not be written; earlier checkpoints are whole.
    """
    if not isinstance(scene, Scene):
        raise InputError(
            f"run: needs a scene and got {type(scene).__name__}; read a file by "
            "lcmchain.read_scene first"
        )
    if threads is not None and threads < 0:
        raise InputError(f"is {threads}; give 1 or more, or None for all cores", key="threads")
    folder = Path(out)
    require_readable_targets(scene)
    require_free_names(scene)
    with ResultsFolder.locked(folder, input_files(scene)) as results:
        results.require_apart(expected_files(scene))
        account = RunAccount(folder, scene.process.time, progress)
        kind = _Job if scene.element.has_forces else _DrapingJob
        job = kind(scene, results, threads, account, resume=resume)
        checkpoint = job.checkpoint() if resume else None
        other = None if start_from is None else job.other_run(Path(start_from), resume=resume)
        if other is None:
            job.end_with(until_stage, checkpoint, folder)
        else:
            job.end_with(until_stage, other, job.other_folder)
        job.build()
        if other is not None:
            checkpoint = job.started_from(other)
        results.begin(resume=resume)
        with account.kept(on_failure=job.write_report), job.helper:
            job.form(checkpoint)
            job.draw()
            if job.ends_early:
                job.end_early()
                return job.result
            job.map_fields()
            job.complete()
        remove_checkpoint(folder)
        if job.wet is not None:
            job.wet.forget_checkpoints(folder, but=None)
        results.remove_previous()
    return job.result


class _Job:
    """The stages of one run."""

    def __init__(
        self,
        scene: Scene,
        results: ResultsFolder,
        threads: int | None,
        account: RunAccount,
        *,
        resume: bool,
    ) -> None:
        self.scene, self.folder, self.results = scene, results.path, results
        self.threads, self.resume = use_threads(threads), resume
        self._threads_wanted = threads
        self.account, self.tell, self.summary = account, account.tell, account.summary
        self.fingerprint = run_fingerprint(scene)
        self.helper = Helper(later=functools.partial(rehearse_stages, scene))
        self.result: Result
        self.until, self.last_stage = math.inf, ""

    def checkpoint(self) -> Checkpoint | None:
        """Return the state from which an interrupted run goes on.

        Raises
        ------
        InputError : there is none, as in the folder of a run that has come to its end.
        """
        if not (self.folder / CHECKPOINT).exists() and read_state(self.folder) == COMPLETE:
            raise InputError(
                "the run in this folder is complete, nothing of it is left to be done; to form "
                "anew run without --resume",
                file=self.folder,
            )
        return read_checkpoint(self.folder, self.fingerprint, values=written_values(self.scene))

    def end_with(self, stage: str | None, checkpoint: Checkpoint | None, folder: Path) -> None:
        """Let the run end with a stage; without one with the process.

        Parameters
        ----------
        checkpoint : from which the run goes on, of the run in ``folder``.

        Raises
        ------
        InputError : there is no such stage, or the run has come further already.
        """
        if stage is None:
            return
        number = number_of_stage(self.scene, stage, key=UNTIL)
        if number + 1 == len(self.scene.stages):
            return
        end = self.scene.stage_plans()[number].end
        if checkpoint is not None and checkpoint.state.time > end:
            raise InputError(
                f'"{stage}" ended at {1e3 * end:.4g} ms, but the run in {folder} has come to '
                f"{1e3 * checkpoint.state.time:.4g} ms already; name a later stage",
                key=UNTIL,
            )
        self.until, self.last_stage = end, stage

    def other_run(self, folder: Path, *, resume: bool) -> Checkpoint:
        """Return the state at the end of a stage of another run.

        Raises
        ------
        InputError : there is none that this scene may go on from; names the key that differs.
        """
        if resume:
            raise InputError(
                f"goes on from another run, and --resume from this one; leave {FROM} out", key=FROM
            )
        if folder.resolve() == self.folder.resolve():
            raise InputError("is the folder of this run; name another one with --out", key=FROM)
        if not (folder / CHECKPOINT).exists():
            raise InputError(
                f'names "{folder}", a folder without a run that ended with a stage; make one with '
                f'{UNTIL} NAME --out "{folder}"',
                key=FROM,
            )
        other = read_checkpoint(folder, self.fingerprint, of_other_scene=True)
        stages = require_border(other, self.scene, folder)
        name = self.scene.stages[stages - 1].name
        self.summary["started_from"] = {"folder": str(folder), "stage": name}
        self.other_folder = folder
        return other

    def started_from(self, other: Checkpoint) -> Checkpoint:
        """Return the state of another run as one of this one."""
        model, folders = self.simulation.model.whole, (self.other_folder, self.folder)
        return started(other, self.scene, model, self.fingerprint, folders)

    @property
    def ends_early(self) -> bool:
        """Whether the run ends before the process, as it was asked to."""
        return math.isfinite(self.until)

    @property
    def final_state(self) -> str:
        """State of the results when all is done."""
        if not self.ends_early:
            return COMPLETE
        return stopped(f"with the stage {self.last_stage}, as asked; --resume goes on from there")

    def end_early(self) -> None:
        """Write the report, and say that the run ends here for now."""
        self.helper.stop()
        self.write_report(self.final_state)
        self.account.set_state(self.final_state)

    @property
    def tools(self) -> ToolTable:
        """The tools as compiled code reads them."""
        return self.simulation.model.tools

    def effects(self) -> list[Effect]:
        """What is simulated, and why."""
        return run_effects(self.scene, self.simulation.model.whole)

    def build(self) -> None:
        """Build the model: what is wrong with the input is found here."""
        self.tell(0.0, "building the model")
        self.simulation, tool_warnings = _build_simulation(self.scene)
        model = self.simulation.model
        self.threads = use_threads(self._threads_wanted, model.element_count)
        require_frames_fit(self.scene.process.frames, model.element_count, model.node_count)
        # the tools meet the faces of the plies, whatever their elements
        blanks = [ply.build_blank() for ply in self.scene.stack]
        require_no_initial_overlap(self.scene, model.tools, blanks)
        self.wet = self._wet_forming()
        of_meshes = [
            text
            for ply, blank in zip(self.scene.stack, blanks, strict=True)
            for text in ply.remarks(blank)
        ]
        self.blanks = blanks
        self.warnings = [*scene_warnings(self.scene), *of_meshes, *tool_warnings]
        if self.scene.output.animation != NO_FILM:
            from lcmchain.report.run_pictures import require_film

            require_film(self.scene.output, [(b.mesh, b.material) for b in model.bodies])
        self.summary |= run_head(self.scene, self.simulation, self.fingerprint.sha256)
        self.summary["provenance"] = provenance(
            self.scene, run_fingerprint=self.fingerprint.sha256, threads=self.threads
        )

    def form(self, checkpoint: Checkpoint | None) -> None:
        """Form the blank and write its fields, also the frames of a run that ends before time."""
        self.tell(0.0, "compiling")
        start = time.perf_counter()
        compile_loops(self.simulation, lambda text: self.tell(0.0, text), self.helper)
        compile_s = time.perf_counter() - start
        forming = FormingRun(
            self.scene, self.fingerprint, self.simulation, self.folder, self.tell_forming,
            self.save, self.wet, self.until,
        )  # fmt: skip
        try:
            forming.complete(checkpoint)
        except UnfinishedRun as error:
            if isinstance(error, SimulationError):
                self._blame_tools(error)
            self._write_fields(forming, compile_s, state_after(error))
            error.result = self.result
            last = 1e3 * forming.snapshots[-1].time
            error.where = f"The frames up to {last:.4g} ms are in {self.folder / 'forming.nc'}"
            error.args = tuple(
                self.scene.stack.in_own_words(part) if isinstance(part, str) else part
                for part in error.args
            )
            raise
        self.tell(self.scene.process.time, "writing fields")
        self._write_fields(forming, compile_s, self.final_state)
        if not self.ends_early:
            self._write_filling(forming)
        step_count = self.simulation.state.step_count
        record_speed(self.simulation.model, self.threads, step_count, forming.wall_s)
        # forming is complete: nothing that fails from here may lose it
        self.account.set_state(RUNNING)

    def draw(self) -> None:
        """Draw what the scene asks for."""
        if self.scene.output.pictures or self.scene.output.animation != NO_FILM:
            from lcmchain.report.run_pictures import draw_run

            draw_run(
                self.scene,
                self.tools,
                self.result.datasets,
                self.folder,
                lambda text: self.tell(self.scene.process.time, text),
            )

    def map_fields(self) -> None:
        """Map onto every mesh of the scene, analyse and fill there; keep the summary up to date.

        Raises
        ------
        MappingError : after all have been tried.
        """
        self.helper.stop()
        failures: list[str] = []
        for target in self.scene.mapping:
            with self._noting(failures, "mapping", target.name):
                self._map(target)
                self._analyse(target)
        for name, (case, onto) in self.scene.infiltrations.items():
            if onto is not None and "error" in self.summary["mapping"][name]:
                continue
            if case.with_forming is not None:
                continue  # it went on while the blank was formed
            with self._noting(failures, "infiltration", name):
                self._fill("forming.nc" if onto is None else f"{name}.nc", name, case)
        if failures:
            raise MappingError(
                f"{'. '.join(failures)}. The forming results in {self.folder} are complete; mend "
                "the mesh or its [[mapping]] entry, and the same command with --resume maps "
                "without forming again",
                self.result,
            )

    @contextmanager
    def _noting(self, failures: list[str], stage: str, name: str) -> Iterator[None]:
        """Note what goes wrong with one mesh, so that the others are still tried."""
        try:
            yield
        except (OutputError, UnfinishedRun):
            raise  # a full disk, or Ctrl-C, is no fault of the mesh
        except LcmchainError as error:
            failures.append(f'{stage} "{name}" failed: {error}')
            self.summary.setdefault(stage, {}).setdefault(name, {"error": str(error)})
        self.account.set_state(RUNNING)

    def _map(self, target: MappingTarget) -> None:
        from lcmchain.mapping import MappingOptions, map_forming

        self.tell(self.scene.process.time, f"mapping {target.name}")
        report = map_forming(
            self.folder / "forming.nc",
            self.scene.source.directory / target.mesh,
            MappingOptions(**target.options(), picture=self.scene.output.pictures),
            name=target.name,
            out_dir=self.folder,
        )
        self.summary["mapping"][target.name] = report.as_dict()

    def _analyse(self, target: MappingTarget) -> None:
        """Analyse the structure of a mapped part where the scene asks for it."""
        if target.structure is None:
            return
        from lcmchain.mapping.structure import SolverOptions, analyse

        self.tell(self.scene.process.time, f"structural analysis of {target.name}")
        report = analyse(
            self.folder / f"{target.name}.nc",
            self.scene.source.directory / target.mesh,
            target.structure,
            name=target.name,
            out_dir=self.folder,
            length_unit=target.length_unit,
            options=SolverOptions(threads=self.threads, picture=self.scene.output.pictures),
        )
        self.summary.setdefault("structure", {})[target.name] = report.as_dict()

    def _fill(self, source: str, name: str, case: Infiltration) -> None:
        """Fill a part as the scene says; an interrupted filling goes on from its checkpoint."""
        from lcmchain.coupling.infiltration.stage import FillOptions, fill_part

        output = self.scene.output
        options = FillOptions(
            picture=output.pictures,
            vtu=output.vtu,
            directory=self.scene.source.directory,
            resume=None if self.resume else False,
        )
        try:
            report = fill_part(
                self.folder / source,
                case,
                name=name,
                out_dir=self.folder,
                options=options,
                tell=lambda share, text: self.account.tell(share, f"{name}: {text}", total=1.0),
            )
        except UnfinishedRun as error:
            error.result = self.result
            error.where = f"The forming results in {self.folder} are complete"
            raise
        self.summary.setdefault("infiltration", {})[name] = report.as_dict()

    def _wet_forming(self) -> Any | None:
        """The resin that flows while the blank is formed, if there is any."""
        if self.scene.wet_forming is None:
            return None
        from lcmchain.coupling.wet_forming.wet_forming import WetForming

        return WetForming(self.scene, self.simulation)

    def _write_filling(self, forming: FormingRun) -> None:
        """Write how the sheet has filled while it was formed."""
        if self.wet is None:
            return
        from lcmchain.coupling.infiltration.stage import FillOptions, write_filled

        output = self.scene.output
        report = write_filled(
            self.wet.filled(forming.snapshots),
            name=SHEET_NAME,
            out_dir=self.folder,
            options=FillOptions(picture=output.pictures, vtu=output.vtu),
            tell=lambda share, text: self.tell(self.scene.process.time, text),
            wall_s=forming.wall_s,
        )
        self.summary.setdefault("infiltration", {})[SHEET_NAME] = report.as_dict()

    def complete(self) -> None:
        """Write the report, and say that everything is there."""
        self.tell(self.scene.process.time, "writing the report")
        self.write_report(COMPLETE)
        self.account.complete()

    def save(self) -> None:
        """Note in the summary how far the run has come; called after every checkpoint."""
        state = self.simulation.state
        self.summary |= {"time_reached_s": state.time, "step_count": state.step_count}
        self.account.set_state(RUNNING)

    def tell_forming(self, completed: float, total: float, text: str) -> None:
        """Report how far the forming stage has come."""
        self.tell(completed, text)

    def _blame_tools(self, error: SimulationError) -> None:
        """Name tools that had left no space for the sheet first as the cause of what a guard saw.

        Where it is that, no contact stiffness, mesh or pace cures it.
        """
        time = self.simulation.time
        closed = tools_that_close(self.scene, self.simulation.model, self.closing, until=time)
        if closed:
            error.blame("; ".join(closed))

    @functools.cached_property
    def closing(self) -> list[Closing]:
        """Tools that close on each other; looked for at the end, so that no run begins later."""
        return closing_tools(self.scene, self.blanks, self.simulation.model)

    def _write_fields(self, forming: FormingRun, compile_s: float, state: str) -> None:
        snapshots = forming.snapshots
        datasets = _write_fields(self.scene, self.simulation, snapshots, self.folder, state)
        self.summary |= run_summary(
            self.scene,
            self.simulation,
            snapshots,
            datasets,
            wall_s=forming.wall_s,
            compile_s=compile_s,
            threads=self.threads,
            warnings=[
                *self.warnings,
                *tools_that_close(self.scene, self.simulation.model, self.closing),
                *self.simulation.warnings(),
            ],
        )
        self.summary["time_reached_s"] = self.simulation.time
        self.result = Result(datasets, self.summary, self.folder)

    def write_report(self, state: str) -> None:
        """Write ``report.html`` of what there is; a run that failed early has nothing to report."""
        result = getattr(self, "result", None)
        if not self.scene.output.report or result is None:
            return
        from lcmchain.report import write_report

        write_report(
            self.folder,
            self.scene,
            self.effects(),
            result.datasets,
            self.summary | {"state": state},
            pictures=[name for name in self.results.files if name.endswith(".png")],
        )


class _DrapingJob(_Job):
    """The stages of a run whose blank is draped: no steps, no forces, no checkpoints."""

    wet = None

    def checkpoint(self) -> Checkpoint | None:
        return None  # draping takes less time than reading one

    def end_with(self, stage: str | None, checkpoint: Checkpoint | None, folder: Path) -> None:
        if stage is not None:
            raise InputError("names a stage, but draping makes one step; leave it out", key=UNTIL)

    def other_run(self, folder: Path, *, resume: bool) -> Checkpoint:
        raise InputError("names a run, but draping has no stages; leave it out", key=FROM)

    @property
    def tools(self) -> ToolTable:
        return self.draped.tools

    def effects(self) -> list[Effect]:
        from lcmchain.draping.result import draping_effect

        return [draping_effect(self.draped), *later_stages(self.scene)]

    def build(self) -> None:
        """Drape the blank: what is wrong with the input is found here."""
        from lcmchain.draping import drape

        self.tell(0.0, "compiling")
        start = time.perf_counter()
        with _noted_warnings() as noted:
            first = drape(self.scene)
        self.compile_s = time.perf_counter() - start
        self.draped = drape(self.scene, tools=first.tools)
        mesh = self.draped.mesh
        if self.scene.output.animation != NO_FILM:
            from lcmchain.report.run_pictures import require_film

            material = self.scene.only_ply("kinematic draping").material.build()
            require_film(self.scene.output, [(mesh, material)])
        self.warnings = [*scene_warnings(self.scene), *noted]
        fingerprint = self.fingerprint.sha256
        self.summary |= scene_head(self.scene, fingerprint, mesh.element_count, mesh.node_count)
        self.summary["provenance"] = provenance(
            self.scene, run_fingerprint=fingerprint, threads=self.threads
        )

    def form(self, checkpoint: Checkpoint | None) -> None:
        """Write the fields of the draped blank."""
        from lcmchain.coupling.forming_fields import with_permeability
        from lcmchain.draping.result import draped_datasets, draping_summary, locking_warnings
        from lcmchain.pattern.draped import write_draped_files

        datasets = with_permeability(self.scene, draped_datasets(self.scene, self.draped))
        _write_datasets(self.scene, datasets, self.folder)
        write_draped_files(self.folder, self.draped)
        found = draping_summary(self.scene, self.draped, datasets)
        warnings = [*self.warnings, *locking_warnings(self.draped), *found["warnings"]]
        self.summary |= found | {
            "warnings": list(dict.fromkeys(warnings)),
            "compile_s": self.compile_s,
            "threads": self.threads,
            "effects": [effect.name for effect in self.effects() if effect.active],
            "time_reached_s": self.scene.process.time,
        }
        self.result = Result(datasets, self.summary, self.folder)
        self.account.set_state(RUNNING)


def _write_fields(
    scene: Scene,
    simulation: Simulation,
    snapshots: Sequence[Snapshot],
    folder: Path,
    state: str,
) -> dict[str, xr.Dataset]:
    from lcmchain.coupling.forming_fields import forming_datasets

    datasets = forming_datasets(scene, simulation, snapshots, state=state)
    _write_datasets(scene, datasets, folder)
    return datasets


def _write_datasets(scene: Scene, datasets: dict[str, xr.Dataset], folder: Path) -> None:
    from lcmchain.fields import write_forming_netcdf, write_pvd, write_vtu

    write_forming_netcdf(folder / "forming.nc", datasets)
    if scene.output.vtu:
        write_vtu(folder / "forming.vtu", datasets)
        write_pvd(folder / "forming.pvd", datasets)


def rehearse_stages(scene: Scene, simulation: Simulation, folder: Path) -> None:
    """Write and map the fields of the start, so that what these stages call is compiled.

    Parameters
    ----------
    folder : for files that nobody needs.
    """
    from lcmchain.coupling.forming_fields import forming_datasets
    from lcmchain.fields import write_forming_netcdf
    from lcmchain.mapping import MappingOptions, map_forming

    source = folder / "forming.nc"
    write_forming_netcdf(source, forming_datasets(scene, simulation, [simulation.snapshot()] * 2))
    for target in scene.mapping:
        # a flat sheet is far from the mesh of a formed part
        options = {**target.options(), **ANY_MESH, "picture": False}
        mesh = scene.source.directory / target.mesh
        map_forming(source, mesh, MappingOptions(**options), name=target.name, out_dir=folder)


def require_readable_targets(scene: Scene) -> None:
    """Read once what is needed after forming: what is wrong is told before anything is computed."""
    laws = [scene.permeability, *(case.permeability for case, _ in scene.infiltrations.values())]
    for law in laws:
        if law is not None:
            from lcmchain.coupling.permeability import law_of

            law_of(law, scene.source.directory)
    if not scene.mapping:
        return
    from lcmchain.mapping import read_target

    for target in scene.mapping:
        path = scene.source.directory / target.mesh
        mesh = read_target(path, kind=target.kind, length_unit=target.length_unit)
        if target.structure is not None:
            from lcmchain.mapping.structure import require_places

            require_places(mesh, target.structure)
        if target.infiltration is not None:
            from lcmchain.coupling.infiltration.setup import require_places as require_flow_places

            require_flow_places(mesh, target.infiltration)


def _build_simulation(scene: Scene) -> tuple[Simulation, list[str]]:
    """Build the simulation; what its tools warn of is said at once and kept for the summary."""
    with _noted_warnings() as noted:
        simulation = Simulation.from_scene(scene)
    return simulation, noted


@contextmanager
def _noted_warnings() -> Iterator[list[str]]:
    """Note what tools warn of while they are built; all warnings are given at the end, once."""
    noted: list[str] = []
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        yield noted
    for warning in {str(warning.message): warning for warning in caught}.values():
        warnings.warn_explicit(warning.message, warning.category, warning.filename, warning.lineno)
    noted += [str(w.message) for w in caught if issubclass(w.category, ToolWarning)]


# --- the files of a run: which it reads, and which it will write ----------------------------------

#: Files that a run writes under names of its own; each mapping adds files of its name.
OWN_FILES = ("forming.nc", "forming.vtu", "forming.pvd", "report.html", SUMMARY_FILE, LOG_FILE)
#: Tables of a draped ply and of the joints of its courses, and what a course's pattern begins with.
PLY_TABLE, JOINT_TABLE, COURSE_FILE = "draping.csv", "joints.csv", "course_"
MAPPED_SUFFIXES = (".nc", ".vtu", ".png", ".json")
STRUCTURAL_ENDINGS = tuple(
    f"_calculix{ending}"
    for ending in (".inp", "_mesh.inp", "_sections.inp", ".nc", ".vtu", ".png", ".json", ".frd",
                   ".dat", ".log")
)  # fmt: skip
FILLING_ENDINGS = tuple(
    f"_filling{ending}"
    for ending in (".nc", ".vtu", ".pvd", ".json", "_time.png", "_pressure.png", "_curves.png",
                   "_checkpoint.npz")
)  # fmt: skip


def input_files(scene: Scene) -> list[Path]:
    """Return the files that a run reads."""
    directory = Path(scene.source.directory)
    scene_file = [scene.source.path] if scene.source.path is not None else []
    return [*scene_file, *(directory / name for _, name in scene.source.files)]


def expected_files(scene: Scene) -> list[str]:
    """Return the names that a run writes, as far as the scene tells them."""
    mapped = [
        f"{target.name}{end}"
        for target in scene.mapping
        for end in (
            *MAPPED_SUFFIXES,
            *([".pvd"] if target.all_frames else []),
            *(["_errors.png"] if target.verify else []),
        )
    ]
    analysed = [
        f"{target.name}{end}"
        for target in scene.mapping
        if target.structure is not None
        for end in STRUCTURAL_ENDINGS
    ]
    filled = [
        f"{name}{end}"
        for name, (case, _) in scene.infiltrations.items()
        for end in (
            *FILLING_ENDINGS,
            *([f"_filling.{case.animation}"] if case.animation != "none" else []),
        )
    ]
    return [*OWN_FILES, *_draped_files(scene), *mapped, *analysed, *filled]


def _draped_files(scene: Scene) -> list[str]:
    """Return what a run writes beside the fields where the blank is draped."""
    if scene.element.has_forces:
        return []
    patterns = [
        f"{COURSE_FILE}{course.name}.{end}"
        for course in courses_to_lay(scene.draping, scene.stack)
        for end in ("csv", "dxf")
    ]
    return [PLY_TABLE, *([JOINT_TABLE] if patterns else []), *patterns]


def require_free_names(scene: Scene) -> None:
    """Refuse a mapping whose files would take the names of the run's own.

    Raises
    ------
    InputError : names the mapping.
    """
    taken = {Path(name).stem for name in (*OWN_FILES, *CAPTIONS, START_PICTURE)}
    for index, target in enumerate(scene.mapping):
        if target.name in taken:
            raise InputError(
                f'files of the run itself are named "{target.name}"; choose another name',
                key=f"mapping[{index}].name",
            )
