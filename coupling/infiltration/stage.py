"""The infiltration stage: a formed part and its case in; fields, pictures and report out."""

from __future__ import annotations

import hashlib
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lcmchain.compilation.cache import source_hash
from lcmchain.coupling.infiltration.checkpoint import read_checkpoint
from lcmchain.coupling.infiltration.curves import draw_curves
from lcmchain.coupling.infiltration.files import filling_groups, write_series, write_vtu
from lcmchain.coupling.infiltration.filling_run import FillingRun, Tell
from lcmchain.coupling.infiltration.film_of_front import draw_film
from lcmchain.coupling.infiltration.formed_part import FormedPart, read_formed_part
from lcmchain.coupling.infiltration.picture import draw_fill_time, draw_medium_time, draw_pressure
from lcmchain.coupling.infiltration.report import FillingReport, filling_report
from lcmchain.coupling.infiltration.results import FilledPart
from lcmchain.coupling.infiltration.setup import FillingSetup, set_up
from lcmchain.errors import InputError
from lcmchain.fields.netcdf_file import write_netcdf
from lcmchain.scene.infiltration import Infiltration

#: What the names of the stage's files end in, before their suffix.
ENDING = "_filling"

#: Endings of the files by what they hold; the film's follows its kind.
FILES = {
    "netcdf": ".nc", "vtu": ".vtu", "series": ".pvd", "report": ".json",
    "fill_time": "_time.png", "pressure": "_pressure.png", "curves": "_curves.png",
    "medium_time": "_medium_time.png",
}  # fmt: skip
#: What a mapping adds to the title of a result.
OF_MAPPING = ": forming fields on the"
PICTURES = ("fill_time", "pressure", "curves", "medium_time")


@dataclass(frozen=True)
class FillOptions:
    """How the stage runs, beside its case.

    Parameters
    ----------
    picture : draw pictures, and the film that the case asks for. vtu : write files for ParaView.
    frame : saved state of a forming result, from 0; -1 is the last one.
    allow_incomplete : take fields of a forming run that was stopped.
    directory : folder to which file names in the case are relative; None is the current one.
    resume : go on from a checkpoint, which has to be there; None goes on where one fits.
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
    source : mapped file, or forming result, of which the sheet's own faces are filled.
    name : the files are ``NAME_filling.nc``, ``.vtu``, ``.pvd``, ``.json``, pictures, and a film.
    tell : called with the filled share and a text.

    Raises
    ------
    InputError : fields, places or cells that are wrong; nothing is written then.
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
    report = write_filled(
        filled, name=name, out_dir=out_dir, options=options, tell=tell, wall_s=wall_s
    )
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
    """Fill a formed part, whose dataset may hold any fields in place of the formed; write nothing.

    Raises
    ------
    InputError : fields, places or cells that are wrong.
    SimulationInterrupted : the user stopped it.
    """
    return FillingRun(set_up(part, case), None, {}, tell or (lambda share, text: None)).complete()


def checkpoint_file(out_dir: Path | str, name: str) -> Path:
    """Return the file that an interrupted filling leaves."""
    return Path(out_dir) / f"{name}{ENDING}_checkpoint.npz"


def fingerprint_of(setup: FillingSetup) -> dict[str, str]:
    """Return hashes of what decides the numbers of a filling, by what they are of."""
    digest = hashlib.sha256()
    mesh, preform = setup.mesh, setup.preform
    for array in (mesh.points, mesh.cells, preform.thickness, preform.porosity,
                  preform.permeability):  # fmt: skip
        digest.update(np.ascontiguousarray(array).tobytes())
    if setup.flow_medium is not None and preform.through_permeability is not None:
        digest.update(preform.through_permeability.tobytes())
    for nodes in [place.nodes for place in setup.gates] + [place.nodes for place in setup.vents]:
        digest.update(nodes.tobytes())
    case = setup.case.model_dump_json(exclude={"animation"})
    return {
        "part": digest.hexdigest(),
        "case": hashlib.sha256(case.encode()).hexdigest(),
        "version of lcmchain": source_hash(),
    }


def _fits(checkpoint: Path, fingerprint: dict[str, str]) -> bool:
    """Whether there is a checkpoint of this filling."""
    if not checkpoint.exists():
        return False
    try:
        read_checkpoint(checkpoint, fingerprint)
    except InputError:
        return False
    return True


def title_of(filled: FilledPart, report: FillingReport) -> str:
    """Return what was filled, in words."""
    of_part = str(filled.setup.part.dataset.attrs.get("title", ""))
    of_part = of_part.partition(OF_MAPPING)[0]
    return f"{of_part}: {report.name}".lstrip(": ")


def write_filling(path: Path, filled: FilledPart, report: FillingReport) -> None:
    """Write the netCDF file of a filling, whole or not at all."""
    about = {
        "title": f"{title_of(filled, report)}: infiltration",
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
    title = title_of(filled, report)
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
