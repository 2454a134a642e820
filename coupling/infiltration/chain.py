"""From a forming result to a filled part: maps where the source is not on the mesh yet."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from lcmchain.coupling.infiltration.report import FillingReport
from lcmchain.coupling.infiltration.stage import FillOptions, Tell, fill_part
from lcmchain.coupling.infiltration.unformed_part import unformed_part
from lcmchain.errors import InputError
from lcmchain.mapping import MappingOptions, MappingReport, map_forming
from lcmchain.mapping.sheet import file_sha256
from lcmchain.mapping.structure.mapped_file import is_mapped, mapped_onto, open_mapped
from lcmchain.scene.infiltration import Infiltration


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
    """Fill a forming result or a mapped file, after mapping it onto a mesh where one is named.

    Parameters
    ----------
    source : forming result, mapped file, or the mesh file of a case with a ``preform``.
    mesh : what is not mapped onto it yet is mapped first, into ``NAME.nc`` and its companions;
        None fills the mapped mesh, or the faces of the formed sheet.
    mapping : how it is mapped. Other arguments as of :func:`fill_part`.

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
        found = open_mapped(path)
        if not mapped_onto(found, mesh):
            report = map_forming(
                path, mesh, replace(mapping, kind="infiltration"), name=name, out_dir=out_dir,
                frame=options.frame, allow_incomplete=options.allow_incomplete,
            )  # fmt: skip
            if is_mapped(found):
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
    found = open_mapped(mapped)
    return mapped_onto(found, mesh) and found.attrs.get("source_sha256") == file_sha256(forming)
