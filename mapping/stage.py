"""The mapping as a stage of the chain: forming result and mesh in, mapped files and report out."""

from __future__ import annotations

import shlex
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lcmchain.errors import InputError, first_few
from lcmchain.fields.netcdf_file import write_netcdf
from lcmchain.fields.vtu import without_middles
from lcmchain.mapping.fields import MappedFields, require_thickness, transfer_to_nodes, turned
from lcmchain.mapping.files import file_groups, mapped_dataset, write_frames, write_vtu
from lcmchain.mapping.formats import export_files, export_path, prepare_export
from lcmchain.mapping.frames import mapped_frames
from lcmchain.mapping.picture import draw_errors, draw_mapping
from lcmchain.mapping.registration import Registration, registered, registration_of
from lcmchain.mapping.report import MappingReport, mapping_report
from lcmchain.mapping.sheet import Sheet, frame_at, read_sheet
from lcmchain.mapping.target import TargetMesh, read_target
from lcmchain.mapping.transfer import compute_weights, transfer
from lcmchain.mapping.verify import Verification, verify
from lcmchain.mapping.weights import MappingWeights, Status
from lcmchain.mesh_files.length_unit import length_unit_hint
from lcmchain.results import require_complete

if TYPE_CHECKING:
    import xarray as xr

# Options that are given or not, in the order in which the history tells them.
FLAGS = (
    "all-frames", "register", "nodes", "verify",
    "allow-unmapped", "allow-ambiguous", "allow-incomplete",
)  # fmt: skip


@dataclass(frozen=True)
class MappingOptions:
    """How a forming result is mapped onto a mesh.

    Parameters
    ----------
    kind : ``"infiltration"`` (surface cells) or ``"structure"`` (solids, else shells).
    method : ``"overlap"`` or ``"closest"``.
    order : 1 takes a field as constant within each face of the sheet, 2 as linear.
    maximum_distance : how far [m] from the sheet a cell may lie, by default one edge length of
        the sheet, or the radius of a typical cell where that is larger.
    length_unit : unit of the target's coordinates; what is written is in metres.
    frame : saved frame to map, counted from 0, or backwards from -1, the last one.
    time : of the saved state [s], the nearest is taken; instead of ``frame``.
    all_frames : carry the target along with the material and write every saved state, with the
        weights of the one that is mapped.
    register : map as if the target lay where a small rigid motion brings it to the sheet; what is
        written keeps the target's own coordinates.
    nodes : write values at the nodes of the target too.
    verify : estimate the error that the mapping adds to every field; takes some ten times as long.
    thickness_limit : largest relative difference of the thickness of a solid from the formed one.
    allow_unmapped : write cells without a sheet nearby as not-a-number instead of failing.
    allow_ambiguous : take the nearer of two layers of the sheet that lie about as near instead of
        failing.
    allow_incomplete : map the fields of a run that did not come to its end, with a warning,
        instead of refusing them.
    weights_file : ``.npz`` with stored weights: used where it exists, else written.
    picture : draw source and target side by side.
    exports : formats of other programs to write beside the mapped file, by their names in
        :data:`lcmchain.mapping.formats.FORMATS`.
    """

    kind: str = "structure"
    method: str = "overlap"
    order: int = 2
    maximum_distance: float | None = None
    length_unit: str = "m"
    frame: int = -1
    time: float | None = None
    all_frames: bool = False
    register: bool = False
    nodes: bool = False
    verify: bool = False
    thickness_limit: float = 0.1
    allow_unmapped: bool = False
    allow_ambiguous: bool = False
    allow_incomplete: bool = False
    weights_file: Path | str | None = None
    picture: bool = True
    exports: tuple[str, ...] = ()


def map_forming(
    source: Path | str | xr.Dataset,
    target_mesh: Path | str,
    options: MappingOptions | None = None,
    *,
    name: str,
    out_dir: Path | str,
    **changes: Any,
) -> MappingReport:
    """Map a forming result onto a mesh; write ``NAME.nc``, ``.vtu``, ``.png`` and ``.json``.

    Arguments as in :func:`map_file`; ``name`` names the target and its files in ``out_dir``.
    """
    out = Path(out_dir) / f"{name}.nc"
    return map_file(source, target_mesh, out, options, name=name, **changes)


def map_file(
    source: Path | str | xr.Dataset,
    target_mesh: Path | str,
    out: Path | str,
    options: MappingOptions | None = None,
    *,
    name: str | None = None,
    **changes: Any,
) -> MappingReport:
    """Map a forming result onto a mesh and write the fields, a picture and a report.

    Parameters
    ----------
    source : ``forming.nc``, or its root group as a dataset.
    target_mesh : any mesh file that meshio reads.
    out : ``.nc`` or ``.vtu``; the other of the two, ``.png`` and ``.json`` are written beside it.
    options : how to map, :class:`lcmchain.mapping.MappingOptions`.
    name : name of the target in the report, by default the stem of ``out``.
    changes : entries of the options by keyword, such as ``kind="infiltration"``.

    Raises
    ------
    InputError : unreadable input, unwritable output, unmapped cells that are not allowed, no cell
        with a sheet nearby, or an export that cannot take the result. Nothing is written then.
    """
    options = replace(options or MappingOptions(), **changes)
    if options.nodes and options.all_frames:
        raise InputError("values at nodes are of one saved state: leave out nodes or all_frames")
    if options.time is not None and options.frame != -1:
        raise InputError(
            f"the saved state is asked for by its number ({options.frame}) and by its time "
            f"({1e3 * options.time:.6g} ms): leave out frame or time"
        )
    out = Path(out)
    files = _output_files(out, options)
    exported = [file for format in options.exports for file in export_files(out, format)]
    _require_apart([*files.values(), *exported], source, target_mesh)
    frame = options.frame if options.time is None else frame_at(source, options.time)
    sheet = read_sheet(source, frame=frame)
    unfinished = require_complete(
        sheet.provenance.get("state"), file=sheet.name, allowed=options.allow_incomplete
    )
    target = read_target(target_mesh, kind=options.kind, length_unit=options.length_unit)
    registration = registration_of(sheet, target)
    motion = _motion(target, registration) if options.register else None
    placed = registered(target, motion) if motion is not None else target
    hint = length_unit_hint(target.size, sheet.surface.size, options.length_unit)
    near = None if options.register else registration
    weights, mapped, verification = _map(sheet, placed, options, hint, near)
    if motion is not None:
        mapped = turned(mapped, motion.matrix.T)
    report = mapping_report(
        sheet, target, weights, mapped, name=name if name is not None else Path(out).stem,
        kind=options.kind, registration=registration, registered=options.register,
    )  # fmt: skip
    report.verification = verification.as_dict() if verification else None
    report.warnings = [
        *unfinished, *([hint] if hint else []), *report.warnings, *without_middles(target.blocks)
    ]  # fmt: skip

    # Names only in the report: it stays right when the folder moves.
    report.files = {what: path.name for what, path in files.items()}
    command = _command(report, target, options)
    dataset = mapped_dataset(sheet, target, weights, mapped, report, command=command)
    exports = [
        prepare_export(dataset, target, format, export_path(out, format))
        for format in options.exports
    ]
    if options.weights_file is not None and not Path(options.weights_file).exists():
        weights.save(options.weights_file)
    if options.all_frames:
        frames = mapped_frames(source, sheet, placed, weights)
        dataset = write_frames(files["frames"], dataset, frames, target, motion)
    write_netcdf(files["netcdf"], file_groups(dataset, target))
    write_vtu(files["vtu"], sheet, target, weights, mapped)
    if options.picture:
        draw_mapping(files["picture"], sheet, target, weights, mapped, report)
        if options.verify:
            draw_errors(files["errors"], target, mapped, report)
    report.add_exports([write() for write in exports])
    report.save(files["report"])
    return report


def _map(
    sheet: Sheet,
    target: TargetMesh,
    options: MappingOptions,
    hint: str | None,
    near: Registration | None,
) -> tuple[MappingWeights, MappedFields, Verification | None]:
    """Map, and estimate the errors where that is asked for.

    hint : that the unit of length may be wrong, if it may.
    near : how the target lies to the sheet, unless it was moved there.

    Raises
    ------
    InputError : cells that must not be left without values or undecided, or are too thick.
    """
    weights = _weights(sheet, target, options)
    if not (options.allow_unmapped and weights.mapped.any()):
        _refuse_unmapped(target, weights, hint, near, options.allow_unmapped)
    if not options.allow_ambiguous:
        _refuse_ambiguous(target, weights)
    mapped = transfer(sheet, target, weights)
    require_thickness(target, mapped.scalars, options.thickness_limit)
    if options.nodes:
        mapped = replace(mapped, at_nodes=transfer_to_nodes(sheet, target, weights))
    if not options.verify:
        return weights, mapped, None
    within = replace(options, maximum_distance=weights.maximum_distance)
    found = verify(sheet, target, weights, mapped, partial(_computed, within))
    return weights, replace(mapped, errors=found.cells), found


def _output_files(out: Path, options: MappingOptions) -> dict[str, Path]:
    """Return the files that a mapping writes, by what they hold.

    Raises
    ------
    InputError : ``out`` is a folder, or does not end in .nc or .vtu.
    """
    if out.is_dir():
        raise InputError("this is a folder; name the mapped file, such as mapped.nc", file=out)
    if out.suffix not in (".nc", ".vtu"):
        raise InputError("the mapped file has to end in .nc or .vtu", file=out)
    endings = {"netcdf": ".nc", "vtu": ".vtu", "report": ".json"}
    if options.all_frames:
        endings["frames"] = ".pvd"
    if options.picture:
        endings["picture"] = ".png"
        if options.verify:
            endings["errors"] = "_errors.png"
    return {what: out.with_name(out.stem + ending) for what, ending in endings.items()}


def _command(report: MappingReport, target: TargetMesh, options: MappingOptions) -> str:
    """Return the command line that maps as this mapping did, with the names of files alone."""
    words = [
        "lcmchain", "map", Path(report.source).name, target.file.name if target.file else "TARGET",
        "--out", report.files["netcdf"], "--kind", report.kind, "--method", report.method,
        "--order", str(options.order),
        "--maximum-distance", f"{1e3 * report.maximum_distance:.10g} mm",
        "--length-unit", options.length_unit,
    ]  # fmt: skip
    if options.time is not None:
        words += ["--time", f"{options.time:.10g} s"]
    elif options.frame != -1:
        words += ["--frame", str(options.frame)]
    if options.thickness_limit != MappingOptions.thickness_limit:
        words += ["--thickness-limit", f"{options.thickness_limit:.10g}"]
    for format in options.exports:
        words += ["--export", format]
    words += [f"--{flag}" for flag in FLAGS if getattr(options, flag.replace("-", "_"))]
    return shlex.join(words)


def _require_apart(files: Iterable[Path], *inputs: Path | str | xr.Dataset) -> None:
    """Refuse to write over what is read."""
    read = {Path(file).resolve() for file in inputs if isinstance(file, (str, Path))}
    for file in files:
        if file.resolve() in read:
            raise InputError(
                "the mapping reads this file and would write over it; choose another name",
                file=file,
            )


def _computed(options: MappingOptions, sheet: Sheet, target: TargetMesh) -> MappingWeights:
    return compute_weights(
        sheet,
        target,
        method=options.method,
        order=options.order,
        maximum_distance=options.maximum_distance,
    )


def _weights(sheet: Sheet, target: TargetMesh, options: MappingOptions) -> MappingWeights:
    """Compute the weights, or take the stored ones where they are those that are asked for."""
    if options.weights_file is None or not Path(options.weights_file).exists():
        return _computed(options, sheet, target)
    weights = MappingWeights.load(options.weights_file)
    weights.check_meshes(sheet, target, file=options.weights_file)
    same_distance = options.maximum_distance in (None, weights.maximum_distance)
    same = (weights.method, weights.order) == (options.method, options.order)
    if not same or not same_distance:
        raise InputError(
            f"the stored weights are {weights.method} weights of order {weights.order} within "
            f"{weights.maximum_distance:g} m; ask for the same or delete the file",
            file=options.weights_file,
        )
    return weights


def _refuse_ambiguous(target: TargetMesh, weights: MappingWeights) -> None:
    ambiguous = np.flatnonzero(weights.status == Status.AMBIGUOUS)
    if len(ambiguous):
        raise InputError(
            f"{len(ambiguous)} of {target.cell_count} cells lie about as near to one layer of the "
            f"sheet as to another ({first_few(ambiguous)}; the first has its centroid at "
            f"{_place(target.centroids[ambiguous[0]])} mm): two walls, or folds, that are closer "
            "to each other than the mesh is to either. Move the mesh onto the mid-surface of the "
            "sheet (--register shows how far it is off), lower maximum_distance, or allow "
            "ambiguous cells, which then take the nearer layer",
            file=target.file,
        )


def _motion(target: TargetMesh, registration: Registration | None) -> Registration:
    """Return the motion that brings the target to the sheet.

    Raises
    ------
    InputError : no small motion does.
    """
    if registration is None:
        reason = "it does not lie over the sheet: move it there, or check length_unit"
    elif registration.is_off and not registration.helps:
        reason = "; ".join(registration.warnings())
    else:
        return registration
    raise InputError(f"the mesh cannot be registered: {reason}", file=target.file)


def _refuse_unmapped(
    target: TargetMesh,
    weights: MappingWeights,
    hint: str | None,
    registration: Registration | None,
    allow_unmapped: bool,
) -> None:
    unmapped = np.flatnonzero(~weights.mapped)
    if len(unmapped) == 0:
        return
    message = (
        f"{len(unmapped)} of {target.cell_count} cells have no sheet within "
        f"{1e3 * weights.maximum_distance:.3g} mm ({first_few(unmapped)}; the first has its "
        f"centroid at {_place(target.centroids[unmapped[0]])} mm). "
    )
    if allow_unmapped:
        message += "Move the mesh to the sheet, or raise maximum_distance"
    else:
        message += "Trim the mesh to the sheet, raise maximum_distance, or allow unmapped cells"
    if registration is not None and registration.is_off and registration.helps:
        found = registration.warnings()[0]
        message = f"{message}. {found[0].upper()}{found[1:]}"
    raise InputError(f"{hint}. {message}" if hint else message, file=target.file)


def _place(point: np.ndarray) -> str:
    return "(" + ", ".join(f"{1e3 * x:.1f}" for x in point) + ")"
