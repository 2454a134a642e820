"""One call that writes a mapped result in the format of another program."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from lcmchain.errors import InputError
from lcmchain.mapping.fields import MappedFields
from lcmchain.mapping.formats import drape, lcmsim, openradioss, rtmsim, vmap
from lcmchain.mapping.formats.format import ExportReport, Loss, MappedCells, Saver, mapped_cells
from lcmchain.mapping.target import TargetMesh

if TYPE_CHECKING:
    import xarray as xr


class Format(NamedTuple):
    """A format by its name.

    ending : what is put behind the name of the mapped file.
    beside : endings of further files that are written.
    """

    prepare: Callable[[Path, MappedCells], Saver]
    ending: str
    beside: tuple[str, ...] = ()


FORMATS = {
    vmap.NAME: Format(vmap.prepare, ".vmap"),
    drape.NAME: Format(drape.prepare, ".drape.fem"),
    rtmsim.NAME: Format(rtmsim.prepare, ".rtmsim.txt", (".rtmsim.bdf",)),
    lcmsim.NAME: Format(lcmsim.prepare, ".lcmsim.csv", (".lcmsim.bdf",)),
    openradioss.NAME: Format(openradioss.prepare, ".openradioss.inc"),
}


def export(
    mapped: xr.Dataset | MappedFields, target: TargetMesh, format: str, path: Path | str
) -> ExportReport:
    """Write mapped fields in a format of :data:`FORMATS`; every file whole or not at all.

    Parameters
    ----------
    mapped : what :func:`~lcmchain.mapping.files.mapped_dataset` made, or the fields themselves.
    target : the mesh that they lie on, with the numbers and sets of its file.
    path : the file to write; a mesh of its own is written beside it where the format needs one.

    Returns
    -------
    ExportReport : what was written, what the format cannot hold, and the worst error of that.

    Raises
    ------
    InputError : an unknown format, fields that it needs and the result lacks, cells that it does
        not know, or a place that cannot be written.
    """
    return prepare_export(mapped, target, format, path)()


def prepare_export(
    mapped: xr.Dataset | MappedFields, target: TargetMesh, format: str, path: Path | str
) -> Saver:
    """Check that a format can take the result, and return what writes it.

    Parameters and errors as of :func:`export`; nothing is written before the call of what it
    returns.
    """
    prepare = _format(format).prepare
    cells = mapped_cells(mapped, target)
    save = prepare(Path(path), cells)
    if not cells.left_out:
        return save

    def save_and_tell() -> ExportReport:
        report = save()
        names = ", ".join(cells.left_out)
        report.losses.append(
            Loss(f"fields with more than one value per cell are left out: {names}")
        )
        return report

    return save_and_tell


def export_path(mapped_file: Path, format: str) -> Path:
    """Where the export of a mapped file goes: beside it, with its stem and the format's ending."""
    return mapped_file.with_name(mapped_file.stem + _format(format).ending)


def export_files(mapped_file: Path, format: str) -> list[Path]:
    """Every file that the export of a mapped file writes."""
    endings = (_format(format).ending, *_format(format).beside)
    return [mapped_file.with_name(mapped_file.stem + ending) for ending in endings]


def _format(name: str) -> Format:
    if name not in FORMATS:
        raise InputError(f'no export has the name "{name}"; write one of {", ".join(FORMATS)}')
    return FORMATS[name]
