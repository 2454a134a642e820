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
from lcmchain.fields.ugrid import ROOT, write_netcdf
from lcmchain.mapping.sheet import file_sha256
from lcmchain.mapping.source_checks import UNREADABLE
from lcmchain.mapping.structure.deck import UNITS, mesh_lines, section_lines, step_lines
from lcmchain.mapping.structure.files import results_dataset, write_results_vtu
from lcmchain.mapping.structure.formed import formed_cells
from lcmchain.mapping.structure.materials import Materials, materials_of
from lcmchain.mapping.structure.mesh import STIFF, DeckMesh, deck_mesh
from lcmchain.mapping.structure.picture import draw_results
from lcmchain.mapping.structure.report import StructureReport
from lcmchain.mapping.structure.results import StructuralResults, read_results
from lcmchain.mapping.structure.sections import Sections, build_sections
from lcmchain.mapping.structure.solver import SolverRun, find_solver, run_solver
from lcmchain.mapping.target import TargetMesh, read_target
from lcmchain.scene.structure import Structure

#: What the names of the stage's files end in, before their suffix.
ENDING = "_calculix"

#: A difference between thicknesses of cell and nodes that a user should know of.
NOTABLE = 0.05


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
    sections = build_sections(formed_cells(source, target, file), target, structure)
    materials = materials_of(sections, structure.material_tolerance)
    mesh = deck_mesh(target, quadratic=structure.elements == "quadratic")
    out = Path(out_dir) / f"{name}{ENDING}"
    texts = _deck_texts(out.name, mesh, sections, materials, structure)
    program = find_solver(options.command) if options.run else None
    report = _report(name, target, mesh, sections, materials, structure)
    for text_name, text in texts.items():
        with replacing(out.with_name(text_name)) as temporary:
            temporary.write_text(text, encoding="ascii")
    report.files = {"deck": f"{out.name}.inp"}

    results = None
    has_steps = bool(structure.loads or structure.frequencies)
    if program is not None and has_steps:
        run, results = _solve(program, out, mesh, sections, structure, options)
        _tell_results(report, run, results, mesh)
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
    try:
        with xr.open_dataset(path, engine="netcdf4", mask_and_scale=False) as dataset:
            loaded = dataset.load()
    except UNREADABLE as error:
        raise InputError(
            f"this is no mapped file ({shortened(str(error), 300)})", file=path
        ) from None
    if not is_mapped(loaded):
        raise InputError("this is no mapped file: it has no mesh named target", file=path)
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
        return run, read_results(deck, mesh, sections, structure, UNITS[structure.units])


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
    write_netcdf(out.with_name(f"{out.name}.nc"), {ROOT: dataset})
    write_results_vtu(out.with_name(f"{out.name}.vtu"), mesh, sections, results)
    if options.picture and results is not None:
        draw_results(out.with_name(f"{out.name}.png"), target, results, report)
    report.save(out.with_name(f"{out.name}.json"))


def _report(
    name: str,
    target: TargetMesh,
    mesh: DeckMesh,
    sections: Sections,
    materials: Materials,
    structure: Structure,
) -> StructureReport:
    v, error = sections.fibre_volume_fraction, sections.thickness_error
    mass = None
    if sections.thickness is not None:
        mass = float((sections.density * sections.thickness * target.surface.areas).sum())
    report = StructureReport(
        name=name,
        target=str(target.file) if target.file else "mesh",
        elements=mesh.elements,
        cell_count=mesh.cell_count,
        node_count=int(mesh.used.sum()),
        material_count=len(materials.density),
        material_error_max=materials.error,
        thickness_error_max=None if error is None else error[0],
        thickness_error_cell=None if error is None else int(target.cell_ids[error[1]]),
        fibre_volume_fraction_min=float(v.min()),
        fibre_volume_fraction_max=float(v.max()),
        second_family_error_max=float(np.abs(0.5 * np.pi - np.abs(sections.angle)).max()),
        mass=mass,
        warnings=list(sections.warnings),
    )
    stiff = [element for element in mesh.elements if element in STIFF]
    if stiff:
        report.warnings.append(
            f"{' and '.join(stiff)} elements are much too stiff in bending unless the mesh is very "
            'fine; elements = "quadratic" adds nodes in the middle of the edges'
        )
    if error is not None and error[0] > NOTABLE:
        report.warnings.append(
            f"the thickness varies by up to {100 * error[0]:.0f} % between neighbouring cells (cell "
            f"{report.thickness_error_cell}); shells take it as the mean at their nodes"
        )
    if structure.lay_up != "interleaved":
        report.warnings.append(
            "layers give every element a thickness of its own, and CalculiX makes the joints "
            "between elements of different thickness rigid: displacements come out too small "
            "(by 3 to 8 % on a plate whose thickness varies by 10 %)"
        )
    return report


def _tell_results(
    report: StructureReport, run: SolverRun, results: StructuralResults, mesh: DeckMesh
) -> None:
    report.solved, report.solver = True, f"CalculiX {run.version}"
    report.warnings += [f"CalculiX warns: {warning}" for warning in run.warnings]
    if results.displacement is not None and results.fibre_strain is not None:
        size = np.linalg.norm(results.displacement, axis=1)
        node = int(np.nanargmax(size))
        report.displacement_max, report.displacement_max_node = (
            float(size[node]),
            int(mesh.node_ids[node]),
        )
        strain = np.abs(results.fibre_strain).max(axis=1)
        cell = int(np.argmax(strain))
        report.fibre_strain_max, report.fibre_strain_max_cell = (
            float(strain[cell]),
            int(mesh.cell_ids[cell]),
        )
    report.eigenfrequencies = [
        float(value) if np.isfinite(value) else None for value in results.frequencies
    ]
