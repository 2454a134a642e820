"""The infiltration stage: from a formed part and its case to fields, pictures and report."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, is_dataclass, replace
from pathlib import Path

import numpy as np
from pydantic import BaseModel

from lcmchain.compilation.cache import source_hash
from lcmchain.coupling.infiltration.files import (
    filling_groups,
    read_checkpoint,
    write_checkpoint,
    write_series,
    write_vtu,
)
from lcmchain.coupling.infiltration.filling import Filling
from lcmchain.coupling.infiltration.formed_part import FormedPart, read_formed_part, unformed_part
from lcmchain.coupling.infiltration.picture import (
    draw_curves,
    draw_fill_time,
    draw_film,
    draw_medium_time,
    draw_pressure,
)
from lcmchain.coupling.infiltration.report import FillingReport, filling_report
from lcmchain.coupling.infiltration.results import FilledPart, FillingRecord
from lcmchain.coupling.infiltration.setup import FillingSetup, set_up
from lcmchain.coupling.measured_permeability import MeasuredPermeability
from lcmchain.coupling.mould import Mould
from lcmchain.coupling.solids.stack_compaction import compaction_tables
from lcmchain.errors import InputError, SimulationInterrupted
from lcmchain.fields.netcdf_file import write_netcdf
from lcmchain.forming_run import stop_requests
from lcmchain.mapping import MappingOptions, MappingReport, map_forming
from lcmchain.mapping.sheet import file_sha256
from lcmchain.mapping.structure.stage import is_mapped, mapped_onto, open_mapped
from lcmchain.scene.infiltration import Infiltration

#: Called with the filled share and a text.
Tell = Callable[[float, str], None]
#: End of the names of the stage's files, before the suffix.
ENDING = "_filling"

#: Endings of the files by their content; that of the film follows its kind.
FILES = {
    "netcdf": ".nc", "vtu": ".vtu", "series": ".pvd", "report": ".json",
    "fill_time": "_time.png", "pressure": "_pressure.png", "curves": "_curves.png",
    "medium_time": "_medium_time.png",
}  # fmt: skip
#: Text that a mapping adds to the title of a result.
_OF_MAPPING = ": forming fields on the"
#: Fibre volume fractions at which a measured permeability is compared with another.
SAMPLES = 257
PICTURES = ("fill_time", "pressure", "curves", "medium_time")


@dataclass(frozen=True)
class FillOptions:
    """Options of the stage, besides its case.

    Parameters
    ----------
    picture : draw pictures, and the film of the case.
    vtu : write files for ParaView.
    frame : saved state of a forming result, from 0; -1 is the last one.
    allow_incomplete : accept a forming run that was stopped.
    directory : folder to which file names in the case are relative; None is the current one.
    resume : go on from a checkpoint, which must exist; None: go on where one fits.
    """

    picture: bool = True
    vtu: bool = True
    frame: int = -1
    allow_incomplete: bool = False
    directory: Path | None = None
    resume: bool | None = False


def fill_part(
    source: Path | str | FormedPart,
    case: Infiltration,
    *,
    name: str,
    out_dir: Path | str,
    options: FillOptions | None = None,
    tell: Tell | None = None,
) -> FillingReport:
    """Fill a formed part with resin; write its fields, pictures and report.

    Parameters
    ----------
    source : mapped file, or forming result, whose sheet is filled on its own mesh.
    name : the files are ``NAME_filling.nc``, ``.vtu``, ``.pvd``, ``.json``, pictures, and a film.
    tell : called with the filled share and a text.

    Raises
    ------
    InputError : wrong fields, places or cells; nothing is written.
    SimulationInterrupted : the user stopped it; a checkpoint was left.
    """
    options = options or FillOptions()
    tell = tell or (lambda share, text: None)
    part = source
    if not isinstance(part, FormedPart):
        part = read_formed_part(
            part, frame=options.frame, allow_incomplete=options.allow_incomplete
        )
    tell(0.0, "preparing the filling")
    setup = set_up(part, case, options.directory)
    checkpoint = checkpoint_file(out_dir, name)
    fingerprint = fingerprint_of(setup)
    resume = options.resume
    if resume is None:
        resume = _fits(checkpoint, fingerprint)
    start = time.perf_counter()
    filled = FillingRun(setup, checkpoint, fingerprint, tell).complete(resume=resume)
    wall_s = time.perf_counter() - start
    try:
        report = write_filled(
            filled, name=name, out_dir=out_dir, options=options, tell=tell, wall_s=wall_s
        )
    except KeyboardInterrupt:
        raise SimulationInterrupted(
            "stopped while the results of the filling were written; the same command with "
            "--resume writes them"
        ) from None
    checkpoint.unlink(missing_ok=True)
    return report


def write_filled(
    filled: FilledPart,
    *,
    name: str,
    out_dir: Path | str,
    options: FillOptions,
    tell: Tell,
    wall_s: float = 0.0,
) -> FillingReport:
    """Write fields, pictures and report of a filled part, as :func:`fill_part` does."""
    report = filling_report(name, filled)
    report.wall_s = wall_s
    _write(Path(out_dir) / f"{name}{ENDING}", filled, report, options, tell)
    return report


def fill(part: FormedPart, case: Infiltration, tell: Tell | None = None) -> FilledPart:
    """Fill a part and write nothing; its dataset may come from elsewhere than from forming.

    Raises
    ------
    InputError : wrong fields, places or cells.
    SimulationInterrupted : the user stopped it.
    """
    return FillingRun(set_up(part, case), None, {}, tell or (lambda share, text: None)).complete()


def checkpoint_file(out_dir: Path | str, name: str) -> Path:
    """Return the file that an interrupted filling leaves."""
    return Path(out_dir) / f"{name}{ENDING}_checkpoint.npz"


def fingerprint_of(setup: FillingSetup) -> dict[str, str]:
    """Return hashes of all that the result of a filling depends on, by name."""
    mesh, preform, part = setup.mesh, setup.preform, setup.part
    through = preform.through_permeability if setup.flow_medium is not None else None
    arrays = (mesh.points, mesh.cells, preform.thickness, preform.porosity, preform.permeability)
    nodes = [gate.nodes for gate in setup.gates] + [vent.nodes for vent in setup.vents]
    hashes = {
        "part": _hash_of(*arrays, *(() if through is None else (through,)), *nodes),
        "case": _hash_of(setup.case.model_dump_json(exclude={"animation"})),
        "set of places": _hash_of(
            setup.gates, setup.vents, setup.race_tracks, setup.wetted, setup.film, setup.flow_medium
        ),
        "version of lcmchain": source_hash(),
    }
    law = getattr(preform.factor, "law", None)
    if law is not None:
        hashes["permeability law"] = _hash_of(law)
    if setup.case.closure is not None:
        hashes["compaction law"] = _hash_of(*compaction_tables(part))
    return hashes


def _hash_of(*content: object) -> str:
    digest = hashlib.sha256()
    for piece in _pieces(content):
        digest.update(piece)
    return digest.hexdigest()


def _pieces(content: object) -> Iterator[bytes]:
    """Yield the bytes of arrays, texts, numbers, tables and records of them."""
    if isinstance(content, np.ndarray):
        yield np.ascontiguousarray(content).tobytes()
    elif isinstance(content, BaseModel):
        yield content.model_dump_json().encode()
    elif isinstance(content, MeasuredPermeability):
        # its values over the fibre volume fraction, which may come from a file
        yield f"{content.law} {content.limits} {content.angle}".encode()
        yield content.values(np.linspace(*content.limits, SAMPLES), out_of_range="nan").tobytes()
    elif is_dataclass(content):
        for field in fields(content):
            yield from _pieces(getattr(content, field.name))
    elif isinstance(content, tuple):
        for entry in content:
            yield from _pieces(entry)
    else:
        yield str(content).encode()


def _fits(checkpoint: Path, fingerprint: dict[str, str]) -> bool:
    """Whether there is a checkpoint of this filling."""
    if not checkpoint.exists():
        return False
    try:
        read_checkpoint(checkpoint, fingerprint)
    except InputError:
        return False
    return True


def _title_of(filled: FilledPart, report: FillingReport) -> str:
    """Return the title of a result: that of the part, and the name of the filling."""
    of_part = str(filled.setup.part.dataset.attrs.get("title", ""))
    of_part = of_part.partition(_OF_MAPPING)[0]
    return f"{of_part}: {report.name}".lstrip(": ")


def write_filling(path: Path, filled: FilledPart, report: FillingReport) -> None:
    """Write the netCDF file of a filling, whole or not at all."""
    kind = "" if report.name == "infiltration" else ": infiltration"
    about = {
        "title": f"{_title_of(filled, report)}{kind}",
        "filling_warnings": "\n".join(report.warnings),
    }
    write_netcdf(path, filling_groups(filled, about))


def _write(
    out: Path, filled: FilledPart, report: FillingReport, options: FillOptions, tell: Tell
) -> None:
    endings = dict(FILES)
    if not options.picture:
        endings = {what: end for what, end in endings.items() if what not in PICTURES}
    if not options.vtu:
        endings = {what: end for what, end in endings.items() if what not in ("vtu", "series")}
    if filled.layer is None:
        endings.pop("medium_time", None)
    film = filled.setup.case.animation
    if options.picture and film != "none":
        endings["film"] = f".{film}"
    files = {what: out.with_name(out.name + ending) for what, ending in endings.items()}
    report.files = {what: path.name for what, path in files.items()}
    share = report.filled_share
    tell(share, "writing the filling")
    title = _title_of(filled, report)
    write_filling(files["netcdf"], filled, report)
    if options.vtu:
        write_vtu(files["vtu"], filled)
        write_series(files["series"], filled)
    if options.picture:
        tell(share, "drawing the filling")
        draw_fill_time(files["fill_time"], filled, title)
        draw_pressure(files["pressure"], filled, title)
        if "medium_time" in files:
            draw_medium_time(files["medium_time"], filled, title)
        draw_curves(files["curves"], filled, title)
        if "film" in files:
            draw_film(
                files["film"], filled, title,
                lambda done, total: tell(share, f"drawing the film, frame {done} of {total}"),
            )  # fmt: skip
    report.save(files["report"])


# --- mapping and filling of a forming result ------------------------------------------------------


def map_and_fill(
    source: Path | str,
    mesh: Path | str | None,
    case: Infiltration,
    *,
    name: str,
    out_dir: Path | str,
    mapping: MappingOptions | None = None,
    options: FillOptions | None = None,
    tell: Tell | None = None,
) -> tuple[MappingReport | None, FillingReport]:
    """Fill a forming result or a mapped file; map it onto a mesh first where one is named.

    Parameters
    ----------
    source : forming result, mapped file, or the mesh file of a case with a ``preform``.
    mesh : a source that is not on this mesh is mapped first, into ``NAME.nc`` and its companions;
        None: the mapped mesh, or the faces of the formed sheet, are filled.
    mapping : options of the mapping. Other arguments as of :func:`fill_part`.

    Raises
    ------
    InputError, SimulationInterrupted : as the mapping and :func:`fill_part` do.
    """
    path = Path(source)
    if not path.is_file():
        raise InputError("there is no such file", file=path)
    options, mapping = options or FillOptions(), mapping or MappingOptions()
    if case.preform is not None:
        if mesh is not None:
            raise InputError(
                "is the mesh of a mapping; with a preform SOURCE itself is the mesh", key="--mesh"
            )
        part = unformed_part(path, case.preform, length_unit=mapping.length_unit)
        return None, fill_part(part, case, name=name, out_dir=out_dir, options=options, tell=tell)
    report = None
    if mesh is not None:
        source_data = open_mapped(path)
        if not mapped_onto(source_data, mesh):
            report = map_forming(
                path, mesh, replace(mapping, kind="infiltration"), name=name, out_dir=out_dir,
                frame=options.frame, allow_incomplete=options.allow_incomplete,
            )  # fmt: skip
            if is_mapped(source_data):
                report.warnings.append(
                    f"{path.name} is mapped onto another mesh, or another state of this one: its "
                    "fields were mapped once more; start from the forming result to lose nothing"
                )
            path, options = Path(out_dir) / f"{name}.nc", replace(options, frame=-1)
    return report, fill_part(path, case, name=name, out_dir=out_dir, options=options, tell=tell)


def is_mapped_from(mapped: Path, forming: Path, mesh: Path) -> bool:
    """Whether a file holds the fields of this forming result on this mesh."""
    if not mapped.is_file():
        return False
    dataset = open_mapped(mapped)
    is_on_mesh = mapped_onto(dataset, mesh)
    return is_on_mesh and dataset.attrs.get("source_sha256") == file_sha256(forming)


# --- the run: saved states, histories and checkpoints ---------------------------------------------


#: Wall-clock time between two checkpoints [s].
CHECKPOINT_INTERVAL = 30.0


class FillingRun:
    """Advances a filling and records it.

    Parameters
    ----------
    checkpoint : file of the checkpoints, None for none.
    fingerprint : see :func:`fingerprint_of`.
    tell : called after every step with the filled share and a text.
    """

    def __init__(
        self, setup: FillingSetup, checkpoint: Path | None, fingerprint: dict[str, str], tell: Tell
    ) -> None:
        self.setup, self.checkpoint, self.fingerprint = setup, checkpoint, fingerprint
        self.tell = tell
        self.filling = setup.filling()
        self.mould = self._mould()
        #: Advances and saves: the filling, or the mould that closes on it.
        self.mover: Filling | Mould = self.mould or self.filling
        self.record = FillingRecord.empty()
        # resin in a flow medium does not cover the part
        area = node_areas(setup)
        layer = self.filling.mesh.node_count - len(area)
        self._node_area = np.concatenate([area, np.zeros(layer)])

    def complete(self, *, resume: bool = False) -> FilledPart:
        """Advance to the end and return the result.

        Raises
        ------
        InputError : ``resume`` without a checkpoint of this filling.
        SimulationInterrupted : the user stopped it; a checkpoint was left.
        """
        if resume and self.checkpoint is not None:
            state, self.record = read_checkpoint(self.checkpoint, self.fingerprint)
            self.mover.restore(state)
        else:
            self.begin()
        self._saved = time.perf_counter()
        with stop_requests() as self._stop:
            outcome, message = self._advance()
        self._save()  # nothing is lost where the results cannot be written
        return self.found(outcome, message)

    def begin(self) -> None:
        """Record the start."""
        self.record.add_frame(self.filling)
        self.record.add_step(self.filling, self._node_area, self._force())

    def note(self, filling: Filling) -> float:
        """Record a time step; return the filled share."""
        self.record.add_step(filling, self._node_area, self._force())
        share = filling.filled_share
        if self._is_frame(share):
            self.record.add_frame(filling)
        self.tell(share, f"filling, {filling.time:.4g} s")
        return share

    def found(self, outcome: str, message: str) -> FilledPart:
        """Return the result, with the present state as its last frame.

        A full part from whose vents resin bleeds up to the end counts as filled.
        """
        if outcome == "reached" and self.filling.state.full.all():
            outcome, message = "filled", f"all pores are full, and {message}"
        if self.record.frame_time[-1] < self.filling.time:
            self.record.add_frame(self.filling)
        history = None if self.mould is None else self.mould.history
        return FilledPart.of_record(
            self.setup, self.record, self.filling.save(), outcome, message, history
        )

    def _mould(self) -> Mould | None:
        """Return the mould that closes on the part, if the case has a closure."""
        setup = self.setup
        if setup.case.closure is None:
            return None
        return Mould(setup.part, self.filling, setup.case.closure, setup.case.time)

    def _force(self) -> tuple[float, ...]:
        return () if self.mould is None else self.mould.force

    def _advance(self) -> tuple[str, str]:
        case = self.setup.case
        interval = case.frame_interval
        if interval is None:
            return self.mover.advance(case.time, self._after_step)
        outcome, message = "reached", ""
        while self.filling.time < case.time:
            number = int(np.floor(self.filling.time / interval * (1.0 + 1e-12))) + 1
            until = min(number * interval, case.time)
            outcome, message = self.mover.advance(until, self._after_step)
            if outcome != "reached" and self.mould is None:
                break
        return outcome, message

    def _after_step(self, filling: Filling) -> None:
        share = self.note(filling)
        if self._stop.is_set():
            self._save()
            resume = "; the same command with --resume goes on from here"
            raise SimulationInterrupted(
                f"stopped at {filling.time:.4g} s with {share:.1%} filled"
                f"{'' if self.checkpoint is None else resume}"
            )
        if time.perf_counter() - self._saved > CHECKPOINT_INTERVAL:
            self._save()

    def _is_frame(self, share: float) -> bool:
        """Whether the filling has reached a share or a time at which its fields are saved."""
        return is_frame_due(
            self.setup.case,
            (self.filling.time, share),
            (self.record.frame_time[-1], self._saved_share()),
        )

    def _saved_share(self) -> float:
        """Filled share in the last saved state."""
        number = int(np.searchsorted(self.record.time, self.record.frame_time[-1]))
        return self.record.filled_share[min(number, len(self.record.time) - 1)]

    def _save(self) -> None:
        if self.checkpoint is None:
            return
        write_checkpoint(self.checkpoint, self.fingerprint, self.mover.save(), self.record)
        self._saved = time.perf_counter()


def is_frame_due(case: Infiltration, now: tuple[float, float], last: tuple[float, float]) -> bool:
    """Whether a filling has reached a time or a filled share at which its fields are saved.

    now, last : time [s] and filled share, at present and in the last saved state.
    """
    if case.frame_interval is not None:
        reached, saved = now[0], last[0]
        step, slack = case.frame_interval, 1e-12 * reached / case.frame_interval
    else:
        reached, saved = now[1], last[1]
        step, slack = 1.0 / (case.frames - 1), 1e-9
    return bool(np.floor(reached / step + slack) > np.floor(saved / step + slack))


def node_areas(setup: FillingSetup) -> np.ndarray:
    """Return the area of the mesh at each node (N,) [m²]: equal shares of its cells."""
    cells = setup.mesh.cells
    is_corner = cells >= 0
    share = np.where(is_corner, (setup.mesh.areas / is_corner.sum(axis=1))[:, None], 0.0)
    corners, shares = cells[is_corner], share[is_corner]
    return np.bincount(corners, weights=shares, minlength=setup.mesh.node_count)
