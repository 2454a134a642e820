"""The structural stage: mapped file and mesh in; deck, results and report out."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import xarray as xr

from lcmchain.atomic import replacing
from lcmchain.errors import InputError
from lcmchain.fields.netcdf_file import write_netcdf
from lcmchain.mapping.files import file_groups
from lcmchain.mapping.report import MappingReport
from lcmchain.mapping.stage import MappingOptions, map_forming
from lcmchain.mapping.structure.calculix import SolverError, SolverRun, find_solver, run_solver
from lcmchain.mapping.structure.deck import (
    UNITS,
    Materials,
    materials_of,
    mesh_lines,
    require_places,
    section_lines,
    step_lines,
)
from lcmchain.mapping.structure.mapped_file import (
    formed_cells,
    is_mapped,
    mapped_onto,
    mapped_state,
    open_mapped,
    read_mapped,
)
from lcmchain.mapping.structure.mesh import DeckMesh, deck_mesh
from lcmchain.mapping.structure.report import StructureReport, deck_report, draw_results
from lcmchain.mapping.structure.results import (
    StructuralResults,
    read_results,
    require_same_nodes,
    results_dataset,
    write_results_vtu,
)
from lcmchain.mapping.structure.sections import Sections, build_sections
from lcmchain.mapping.target import TargetMesh, read_target
from lcmchain.scene.structure import Structure

#: What the names of the stage's files end in, before their suffix.
ENDING = "_calculix"

#: CalculiX reserves room for every number up to the largest, a kilobyte and more for an element; it
#: solves meshes with larger numbers counted from 1.
LARGEST_NUMBER = 1_000_000


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


def map_and_analyse(
    source: Path | str,
    target_mesh: Path | str,
    structure: Structure,
    *,
    name: str,
    out_dir: Path | str,
    mapping: MappingOptions | None = None,
    options: SolverOptions | None = None,
) -> tuple[MappingReport | None, StructureReport]:
    """Analyse a part from a forming result, or from a file that is mapped onto its mesh already.

    Parameters
    ----------
    source : ``forming.nc``, or the file of a mapping. What is not mapped onto ``target_mesh`` is
        mapped first, into ``NAME.nc`` and its companions.
    mapping : how it is mapped. Other arguments as of :func:`analyse`.

    Raises
    ------
    InputError, SolverError : as the mapping and :func:`analyse` do.
    """
    mapping = mapping or MappingOptions()
    path = Path(source)
    if not path.is_file():
        raise InputError("there is no such file", file=path)
    attributes = open_mapped(path)
    target = read_target(target_mesh, kind="structure", length_unit=mapping.length_unit)
    require_places(target, structure)  # what the deck cannot hold is refused before the mapping
    report = None
    mapped = path
    if mapped_onto(attributes, target_mesh):
        _require_no_choice_of_state(mapping, path)
    else:
        report = map_forming(
            source, target_mesh, replace(mapping, kind="structure"), name=name, out_dir=out_dir
        )
        mapped = Path(out_dir) / f"{name}.nc"
        if is_mapped(attributes):
            report.warnings.append(
                f"{Path(source).name} is mapped onto another mesh, or another state of this one: "
                "its fields were mapped once more; start from the forming result to lose nothing"
            )
    return report, analyse(mapped, target, structure, name=name, out_dir=out_dir, options=options)


def _require_no_choice_of_state(mapping: MappingOptions, file: Path) -> None:
    """Refuse to choose a saved state of a file that is mapped already, in one state."""
    for key, value, default in (("frame", mapping.frame, -1), ("time", mapping.time, None)):
        if value != default:
            raise InputError(
                "is of no effect: the file is mapped onto this mesh already, in the state that its "
                "mapping_time_s tells; start from the forming result to choose another one",
                key=key,
                file=file,
            )


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
        counted = _counted_for_solver(mesh, report)
        if counted is not mesh:
            texts = _deck_texts(out.name, counted, sections, materials, structure)
        run, results = _solve(program, out, texts, counted, sections, structure, options)
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


def _counted_for_solver(mesh: DeckMesh, report: StructureReport) -> DeckMesh:
    """Return the mesh with numbers that CalculiX has room for; a warning says where they differ."""
    largest = max(int(mesh.node_ids[mesh.used].max()), int(mesh.cell_ids.max()))
    if largest <= LARGEST_NUMBER:
        return mesh
    report.warnings.append(
        f"the mesh has numbers up to {largest}, and CalculiX reserves memory for every number up "
        "to the largest: it solved the deck with nodes and elements counted from 1, in the order "
        "of the written deck, and its own .frd, .dat and .log have these numbers; renumber the "
        "mesh to have its own there"
    )
    return mesh.counted()


def _solve(
    program: str,
    out: Path,
    texts: dict[str, str],
    mesh: DeckMesh,
    sections: Sections,
    structure: Structure,
    options: SolverOptions,
) -> tuple[SolverRun, StructuralResults]:
    """Solve the deck in a folder of its own, and bring back what belongs to the results.

    texts : of the deck and of what it includes, by their names. mesh : with the numbers in them.
    """
    with tempfile.TemporaryDirectory(prefix="lcmchain-") as folder:
        deck = Path(folder) / f"{out.name}.inp"
        for text_name, text in texts.items():
            deck.with_name(text_name).write_text(text, encoding="ascii")
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
