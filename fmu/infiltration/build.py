"""Build the unit of an infiltration, with the formed part inside."""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lcmchain.coupling.cosimulation.archive import read_member
from lcmchain.coupling.infiltration.formed_part import (
    FormedPart,
    part_of_case,
    write_part,
)
from lcmchain.coupling.infiltration.setup import FillingSetup, set_up
from lcmchain.coupling.wet_forming.sheet import blank_of_scene
from lcmchain.errors import InputError
from lcmchain.fmu.build import require_target, stage_scene, write_unit
from lcmchain.fmu.infiltration.part import PART_FOLDER
from lcmchain.fmu.infiltration.variables import FIELD_OUTPUTS, FIELDS_OF_FMI2, MOTIONS, Motion
from lcmchain.fmu.part import INTERFACE_FILE
from lcmchain.mapping.interface import Interface, Patches, read_interface
from lcmchain.mapping.structure.mapped_file import is_mapped
from lcmchain.scene import Scene, read_scene
from lcmchain.scene.infiltration import Infiltration
from lcmchain.scene.reading.read import directory_of, read_text
from lcmchain.scene.reading.single_tables import is_scene_file, read_infiltration


@dataclass(frozen=True)
class InfiltrationUnit:
    """What an infiltration unit is built for.

    Parameters
    ----------
    motion : how the master moves the preform: not at all, by its thickness and the rate of it, or
        by the rate of its volume with the terms of the fixed-stress split.
    interface : number of patches of cells at which fields are exchanged, 0 for the cells; or the
        forming unit whose interface it takes over, ``*.fmu`` (of the sheet's own faces only).
    fields : names of the fields, None for those of the version, ``["all"]`` for all.
    name : of the result file; of a scene the name of the infiltration, None for its only one.
    frame : saved state of a forming result, from 0; -1 is the last one.
    allow_incomplete : take fields of a forming run that was stopped.
    needs_tool : whether the unit says that it needs an installed tool (``needsExecutionTool``).
    length_unit : of the coordinates of a mesh that was not formed.
    """

    motion: Motion = "thickness"
    interface: int | Path = 0
    fields: Sequence[str] | None = None
    name: str | None = None
    frame: int = -1
    allow_incomplete: bool = False
    needs_tool: bool = True
    length_unit: str = "m"


def build_infiltration_fmu(
    source: Path | str | None,
    case: Path | str,
    out_path: Path | str,
    *,
    fmi: int = 2,
    overrides: Sequence[str] = (),
    options: InfiltrationUnit | None = None,
) -> Path:
    """Build the unit that fills a formed part as a case says, and return its path.

    The unit holds part and case: both may be gone later.

    Parameters
    ----------
    source : forming result, of which the sheet's own faces are filled, or mapped file; of a case
        with ``preform`` the mesh that was not formed; None for the blank of a scene whose
        infiltration goes on while the blank is formed.
    case : file with resin, gates and vents, or a scene with infiltrations.
    out_path : the unit, ``*.fmu``; replaced only once the new one is complete.
    fmi : version of the standard. overrides : ``key=value`` texts for the case or scene.

    Raises
    ------
    InputError : part or case are missing or wrong, the case presses on the part itself, or the
        unit cannot be written.
    """
    out_path, options = Path(out_path), options or InfiltrationUnit()
    require_target(out_path, fmi)
    _check(options)
    with tempfile.TemporaryDirectory(prefix="lcmchain-fmu-") as name:
        resources = Path(name)
        the_case, unit = _stage_case(Path(case), overrides, resources, options.name)
        _require_still(the_case)
        if source is None:
            part = blank_of_scene(read_scene(case, overrides))
        else:
            part = part_of_case(
                source, the_case.preform, length_unit=options.length_unit, frame=options.frame,
                allow_incomplete=options.allow_incomplete,
            )  # fmt: skip
        setup = set_up(part, the_case, directory_of(Path(case)))
        interface = _interface(setup, options.interface, resources)
        write_part(resources / PART_FOLDER, _without_path(part))
        title = f"interface of {unit['name']}"
        interface.write(resources / INTERFACE_FILE, {"title": title})
        fields = options.fields
        if fields is None and fmi == 2:
            fields = FIELDS_OF_FMI2 + (("pressure_at_rest",) if options.motion == "volume" else ())
        unit |= {
            "part": "infiltration",
            "motion": options.motion,
            "fields": None if fields is None or list(fields) == ["all"] else list(fields),
        }
        write_unit(out_path, fmi, unit, resources, needs_tool=options.needs_tool)
    return out_path


def _interface(setup: FillingSetup, wanted: int | Path, scratch: Path) -> Interface:
    """Return the interface of a part; on the sheet's own faces its values are in their order."""
    mesh, target = setup.mesh, setup.part.target
    is_sheet = not is_mapped(setup.part.dataset)
    if isinstance(wanted, Path):
        path = scratch / "of_unit.nc"
        path.write_bytes(read_member(wanted, f"resources/{INTERFACE_FILE}"))
        other = read_interface(path)
        path.unlink()
        face = target.cell_ids - 1
        corners = np.where(target.corners >= 0, target.node_ids[target.corners] - 1, -1)
        fits = is_sheet and len(face) == len(other.cells)
        if not fits or not np.array_equal(other.cells[face], corners):
            raise InputError(
                "is the unit of another sheet, or the source is mapped onto another mesh; give "
                "the number of patches instead, and map between the two interfaces",
                key="--interface", file=wanted,
            )  # fmt: skip
        return Interface(mesh.points, mesh.cells, Patches(other.patches.of_cell[face], other.size))
    if wanted == 0 and is_sheet:
        return Interface(mesh.points, mesh.cells, Patches(target.cell_ids - 1, mesh.cell_count))
    return Interface.of_mesh(mesh.points, mesh.cells, wanted)


def _check(options: InfiltrationUnit) -> None:
    if options.motion not in MOTIONS:
        raise InputError(
            f'no motion "{options.motion}"; there is {", ".join(MOTIONS)}', key="--motion"
        )
    known = [entry[0] for entry in FIELD_OUTPUTS]
    for name in options.fields or ():
        if name not in (*known, "all"):
            raise InputError(f'no field "{name}"; there are {", ".join(known)}', key="--fields")
    if options.name is not None and (not options.name or Path(options.name).name != options.name):
        raise InputError(f'"{options.name}" is no name for files', key="--name")


def _stage_case(
    case: Path, overrides: Sequence[str], resources: Path, name: str | None
) -> tuple[Infiltration, dict[str, Any]]:
    """Copy a case or scene and the files that it names; return it and how a unit finds it."""
    scene = _scene(case, overrides)
    if scene is not None:
        infiltrations = scene.infiltrations
        name = next(iter(infiltrations)) if name is None and len(infiltrations) == 1 else name
        if name not in infiltrations:
            known = ", ".join(infiltrations) or "none"
            told = "say which one" if name is None else f'there is no infiltration "{name}"'
            raise InputError(f"{told} (--name); the scene has {known}", file=case)
        moved = stage_scene(scene, resources / "scene")
        entry = {"case": "scene/scene.toml", "entry": name, "overrides": [*overrides, *moved]}
        return infiltrations[name][0], {"name": name, **entry}
    the_case = read_infiltration(case, overrides)
    folder = resources / "case"
    folder.mkdir()
    moved = []
    try:
        (folder / "case.toml").write_bytes(read_text(case).encode("utf-8"))
        law = getattr(the_case.permeability, "file", None)
        if law is not None:
            place = f"law_{Path(law).name}"
            shutil.copyfile(directory_of(case) / law, folder / place)
            moved.append(f"permeability.file={json.dumps(place)}")
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", file=error.filename) from None
    return the_case, {
        "name": name or "infiltration", "case": "case/case.toml", "entry": None,
        "overrides": [*overrides, *moved],
    }  # fmt: skip


def _scene(path: Path, overrides: Sequence[str]) -> Scene | None:
    """Read a scene; None for a file that is the case of an infiltration."""
    return read_scene(path, overrides) if is_scene_file(path) else None


def _require_still(case: Infiltration) -> None:
    if case.closure is not None:
        raise InputError(
            "presses on the part inside of the filling; in a unit the master moves the preform: "
            "leave closure out, and couple the unit with one that forms (lcmchain docs fmu)",
            key="closure",
        )
    if case.flow_medium is not None:
        raise InputError(
            "cannot be part of a unit: a master moves the preform, and knows of no layer on it; "
            "fill with it by lcmchain fill, or leave it out",
            key="flow_medium",
        )


def _without_path(part: FormedPart) -> FormedPart:
    """The part without the folder that its file lay in, which is nobody's business elsewhere."""
    return FormedPart(part.target, part.dataset, Path(part.file).name, part.warnings)
