"""The structural stage: mapped file and mesh in; deck, results and report out."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr

from lcmchain.atomic import replacing
from lcmchain.errors import InputError, shortened
from lcmchain.fields.netcdf_file import open_netcdf, write_netcdf
from lcmchain.mapping.files import SKIN, SOLID, file_groups
from lcmchain.mapping.sheet import UNREADABLE, file_sha256
from lcmchain.mapping.structure.deck import UNITS, mesh_lines, section_lines, step_lines
from lcmchain.mapping.structure.files import (
    require_same_nodes,
    results_dataset,
    write_results_vtu,
)
from lcmchain.mapping.structure.formed import formed_cells, mapped_state
from lcmchain.mapping.structure.materials import Materials, materials_of
from lcmchain.mapping.structure.mesh import DeckMesh, deck_mesh
from lcmchain.mapping.structure.picture import draw_results
from lcmchain.mapping.structure.report import StructureReport, deck_report
from lcmchain.mapping.structure.results import StructuralResults, read_results
from lcmchain.mapping.structure.sections import Sections, build_sections
from lcmchain.mapping.structure.solver import SolverError, SolverRun, find_solver, run_solver
from lcmchain.mapping.target import TargetMesh, read_target
from lcmchain.scene.structure import Structure

#: What the names of the stage's files end in, before their suffix.
ENDING = "_calculix"


@dataclass(frozen=True)
class SolverOptions:
    """How CalculiX is run.

    Parameters
    ----------
    run : whether it is run where it is installed. command : its name or path.
    threads : of the solver, by default its own choice. picture : draw what it finds.
    """

    run: bool = True
    command: str = "ccx"
    threads: int | None = None
    picture: bool = True


def analyse(
    mapped: Path | str | xr.Dataset,
    target_mesh: Path | str | TargetMesh,
    structure: Structure,
    *,
    name: str,
    out_dir: Path | str,
    length_unit: str = "m",
    options: SolverOptions | None = None,
) -> StructureReport:
    """Write the deck of a mapped part, solve it where CalculiX is installed, and read its results.

    Parameters
    ----------
    mapped : file of a mapping (``.nc``), or its dataset. target_mesh : that it was mapped onto.
    name : the files are ``NAME_calculix.inp``, ``.nc``, ``.vtu``, ``.png``, ``.json`` and others.
    length_unit : of the mesh file.

    Raises
    ------
    InputError : fields, sets or cells that are missing; nothing is written then.
    SolverError : CalculiX failed; the deck and its log are there.
    """
    options = options or SolverOptions()
    if isinstance(target_mesh, TargetMesh):
        target = target_mesh
    else:
        target = read_target(target_mesh, kind="structure", length_unit=length_unit)
    source = mapped if isinstance(mapped, xr.Dataset) else read_mapped(mapped)
    file = "dataset" if isinstance(mapped, xr.Dataset) else str(mapped)
    source = mapped_state(source)
    sections = build_sections(formed_cells(source, target, file), target, structure)
    materials = materials_of(sections, structure.material_tolerance)
    mesh = deck_mesh(target, quadratic=structure.elements == "quadratic")
    require_same_nodes(source, target, mesh, file)
    out = Path(out_dir) / f"{name}{ENDING}"
    texts = _deck_texts(out.name, mesh, sections, materials, structure)
    program = find_solver(options.command) if options.run else None
    report = deck_report(name, target, mesh, sections, materials, structure)
    for text_name, text in texts.items():
        with replacing(out.with_name(text_name)) as temporary:
            temporary.write_text(text, encoding="ascii")
    report.files = {"deck": f"{out.name}.inp"}

    results = None
    has_steps = bool(structure.loads or structure.frequencies)
    if program is not None and has_steps:
        run, results = _solve(program, out, mesh, sections, structure, options)
        report.add_results(run, results, mesh)
    elif has_steps:
        why = "CalculiX was not to be run" if not options.run else "CalculiX is not installed"
        report.warnings.append(
            f"{why}: the deck is written, not solved; `{options.command} -i {out.name}` in "
            f"{out.parent} solves it (Debian: apt install calculix-ccx)"
        )
    else:
        report.warnings.append(
            "neither loads nor frequencies are asked for: the deck has mesh, materials and "
            "sections without a step"
        )
    _write_results(out, source, target, mesh, sections, results, report, options)
    return report


def read_mapped(path: Path | str) -> xr.Dataset:
    """Read a mapped file.

    Raises
    ------
    InputError : it is absent or no mapped file.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError("there is no such mapped file", file=path)
    loaded = open_mapped(path)
    if not is_mapped(loaded):
        raise InputError("this is no mapped file: it has no mesh named target", file=path)
    return loaded


def open_mapped(path: Path) -> xr.Dataset:
    """Read the group of a file that has all cells of a mapping: ``/solid`` for solids, or the root.

    Raises
    ------
    InputError : it is no netCDF file.
    """
    try:
        with open_netcdf(path, mask_and_scale=False) as root:
            loaded = root.load()
        if not is_mapped(loaded) and SKIN.name in loaded:
            with open_netcdf(path, mask_and_scale=False, group=SOLID) as solid:
                loaded = solid.load()
    except UNREADABLE as error:
        reason = shortened(str(error), 300)
        raise InputError(f"this is no netCDF result ({reason})", file=path) from None
    return loaded


def is_mapped(dataset: xr.Dataset) -> bool:
    """Whether a dataset is that of a mapping, rather than of a forming run."""
    return "target" in dataset and dataset["target"].attrs.get("cf_role") == "mesh_topology"


def mapped_onto(dataset: xr.Dataset, target_mesh: Path | str) -> bool:
    """Whether a dataset is that of a mapping onto the mesh of a file."""
    stored = dataset.attrs.get("target_sha256")
    return is_mapped(dataset) and stored == file_sha256(target_mesh)


def _deck_texts(
    stem: str, mesh: DeckMesh, sections: Sections, materials: Materials, structure: Structure
) -> dict[str, str]:
    """Texts of the deck and of the two files that it includes, by their names."""
    parts = {
        f"{stem}_mesh.inp": mesh_lines(mesh, UNITS[structure.units]),
        f"{stem}_sections.inp": section_lines(mesh, sections, materials, structure),
    }
    includes = [f"*INCLUDE, INPUT={part}" for part in parts]
    steps = step_lines(mesh, structure)
    head = f"*HEADING\n{stem}, written by lcmchain; units {UNITS[structure.units].words}"
    return {part: _text(lines) for part, lines in parts.items()} | {
        f"{stem}.inp": _text([head, *includes, *steps])
    }


def _text(lines: Iterable[str]) -> str:
    return "\n".join(lines) + "\n"


def _solve(
    program: str,
    out: Path,
    mesh: DeckMesh,
    sections: Sections,
    structure: Structure,
    options: SolverOptions,
) -> tuple[SolverRun, StructuralResults]:
    """Solve the deck in a folder of its own, and bring back what belongs to the results."""
    with tempfile.TemporaryDirectory(prefix="lcmchain-") as folder:
        deck = Path(folder) / f"{out.name}.inp"
        for ending in (".inp", "_mesh.inp", "_sections.inp"):
            shutil.copy(out.with_name(out.name + ending), folder)
        log = out.with_name(f"{out.name}.log")
        try:
            run = run_solver(
                program, deck, time_limit=structure.time_limit, threads=options.threads,
                told_log=log,
            )  # fmt: skip
        finally:
            for ending in (".log", ".frd", ".dat"):
                if deck.with_suffix(ending).exists():
                    with replacing(out.with_name(out.name + ending)) as temporary:
                        shutil.copyfile(deck.with_suffix(ending), temporary)
        results = read_results(deck, mesh, sections, structure, UNITS[structure.units])
    _require_held(results, mesh)
    return run, results


def _require_held(results: StructuralResults, mesh: DeckMesh) -> None:
    """Refuse displacements as they come out where a singular matrix was solved all the same."""
    if results.displacement is None:
        return
    largest = float(np.linalg.norm(results.displacement[mesh.used], axis=1).max())
    if not largest < mesh.size:
        raise SolverError(
            f"the largest displacement is {1e3 * largest:.3g} mm, beyond the size of the part "
            f"({1e3 * mesh.size:.3g} mm), which no linear analysis means: the supports do not hold "
            "the part against every motion, or a load is in another unit"
        )


def _write_results(
    out: Path,
    source: xr.Dataset,
    target: TargetMesh,
    mesh: DeckMesh,
    sections: Sections,
    results: StructuralResults | None,
    report: StructureReport,
    options: SolverOptions,
) -> None:
    endings = {"netcdf": ".nc", "vtu": ".vtu", "report": ".json"}
    if options.picture and results is not None:
        endings["picture"] = ".png"
    if results is not None:
        endings |= {"frd": ".frd", "dat": ".dat", "log": ".log"}
    report.files |= {what: out.name + ending for what, ending in endings.items()}
    attributes = {
        "title": f"{source.attrs.get('title', '')}: structural analysis".lstrip(": "),
        "structure_solver": report.solver or "none: not solved",
        "structure_warnings": "\n".join(report.warnings),
    }
    dataset = results_dataset(source, target, mesh, sections, results, attributes)
    write_netcdf(out.with_name(f"{out.name}.nc"), file_groups(dataset, target))
    write_results_vtu(out.with_name(f"{out.name}.vtu"), mesh, sections, results)
    if options.picture and results is not None:
        draw_results(out.with_name(f"{out.name}.png"), target, results, report)
    report.save(out.with_name(f"{out.name}.json"))
