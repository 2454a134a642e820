"""From a forming result to a solved part: maps where the source is not mapped onto the mesh yet."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from lcmchain.errors import InputError
from lcmchain.mapping.report import MappingReport
from lcmchain.mapping.stage import MappingOptions, map_forming
from lcmchain.mapping.structure.deck import require_places
from lcmchain.mapping.structure.report import StructureReport
from lcmchain.mapping.structure.stage import (
    SolverOptions,
    analyse,
    is_mapped,
    mapped_onto,
    open_mapped,
)
from lcmchain.mapping.target import read_target
from lcmchain.scene.structure import Structure


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
    if not mapped_onto(attributes, target_mesh):
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
