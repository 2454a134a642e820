"""Filling cases of RTMsim and LCMsim, read as data and written as a case of this program.

RTMsim, and LCMsim in its first version, have an input file of fourteen lines: mesh, times, fluid,
pressures, the properties of the main preform and of four sets, and the types of the sets. LCMsim
from its second version on has a table of parts and one of parameters. All numbers are in SI units.

Sources: RTMsim 1.0.4, page on input parameters; LCMsim_v2 and _v3, pages on part description and
simulation parameters (Obertscheider, Fauster and others).
"""

from __future__ import annotations

import csv
import re
from dataclasses import dataclass, replace
from decimal import Decimal, InvalidOperation
from pathlib import Path

from lcmchain.coupling.infiltration.foreign_ports import (
    PORTS_FILE,
    PORTS_PART,
    Port,
    Ports,
    decimal_of,
    on_mesh,
    read_ports,
)
from lcmchain.errors import InputError
from lcmchain.mapping.target import TargetMesh, read_target

BASE, INLET, PATCH, OUTLET, IGNORED = "base", "inlet", "patch", "outlet", "ignored"
# Types of a set by their numbers in the input file.
_TYPES = {0: IGNORED, 1: INLET, 2: PATCH, 3: OUTLET}
_LINES = 14
_SETS = 4
#: Model of both programs in which the thickness follows the pressure.
_COMPACTED = 3
#: Part number of the main preform in LCMsim; sets of a mesh without parts count from the next.
_BASE_ID = 1


@dataclass(frozen=True)
class Textile:
    """Properties as the file writes them, in SI units; the ratio is that of k2 to k1."""

    thickness: Decimal
    porosity: Decimal
    permeability: Decimal
    ratio: Decimal
    axis: tuple[Decimal, Decimal, Decimal]


@dataclass(frozen=True)
class Layer:
    """A flow medium as the file writes it, in SI units.

    Parameters
    ----------
    part : of the mesh that it is on; None for the whole mesh.
    through : permeability of the preform through its thickness, the same in all parts.
    """

    part: str | None
    thickness: Decimal
    porosity: Decimal
    permeability: Decimal
    through: Decimal


@dataclass(frozen=True)
class Zone:
    """A set or part of the mesh.

    Parameters
    ----------
    kind : inlet, patch or outlet.
    number : in the file.
    textile : None where it is that of the main preform.
    place : name of the set or part in the mesh.
    port : in place of a set.
    """

    name: str
    kind: str
    number: int
    textile: Textile | None
    place: str = ""
    port: Port | None = None

    @property
    def in_words(self) -> str:
        """Its place, for the terminal."""
        return self.place if self.port is None else self.port.in_words


@dataclass(frozen=True)
class ForeignCase:
    """A filling case of another program.

    told : sentences on entries of the file that are not taken over.
    """

    program: str
    file: Path
    mesh: Path
    base: Textile
    zones: tuple[Zone, ...]
    viscosity: Decimal
    density: Decimal | None
    gate_pressure: Decimal
    cavity_pressure: Decimal
    time: Decimal
    frames: int | None
    told: tuple[str, ...]
    layer: Layer | None = None


def read_rtmsim(
    path: Path | str, mesh: Path | None = None, ports: Path | None = None
) -> ForeignCase:
    """Read the input file of RTMsim, or of LCMsim in its first version.

    Parameters
    ----------
    mesh : mesh file in place of the one that it names, which is searched beside the input file and
        beside its folder.
    ports : file of the ports that were picked with the mouse (:mod:`.foreign_ports`), which RTMsim
        keeps apart.

    Raises
    ------
    InputError : another file, ports without need, an entry that is no number, a mesh that is
        missing, or an inlet or a preform whose set the mesh does not have; names the line.
    """
    path = Path(path)
    lines = _entries(path)
    model = _whole(lines, 0, 0, path)
    fluid, pressures = _row(lines, 3, 4, path), _row(lines, 4, 2, path)
    textiles = [_textile(_row(lines, 5 + k, 7, path), f"line {6 + k}", path) for k in range(5)]
    kinds = [_TYPES.get(_whole(lines, 10, k, path)) for k in range(_SETS)]
    if None in kinds:
        raise InputError(
            f"line 11: patch type {kinds.index(None) + 1} is none of 0 to 3", file=path
        )
    told = [
        f"p_ref, rho_ref, gamma = {', '.join(map(str, fluid[:3]))}: the air is not computed, the "
        "front moves into the cavity pressure",
    ]
    if model == _COMPACTED:
        told.append(
            "i_model = 3 (porosity_1, p_1): the preform keeps its thickness while it fills; form "
            "it here for a closure"
        )
    if _whole(lines, 11, 0, path):
        told.append(f"i_restart = 1 of {' '.join(lines[11][1:])}: the cavity begins empty")
    interactive = _whole(lines, 12, 0, path)
    given = None if ports is None else read_ports(ports)
    if given is None and interactive:
        told.append(
            f"i_interactive = {interactive}: ports that were picked with the mouse are not in the "
            "file; give them with --ports"
        )
    if given is not None and not interactive:
        raise InputError(
            "has i_interactive = 0, with which there are no ports; leave --ports out, or take 1 "
            "(ports alone) or 2 (ports and sets)",
            file=path,
        )
    if given is not None and _row(lines, 12, 2, path)[1] != given.radius:
        told.append(f"r_p = {lines[12][1]}: the radius of {given.file.name} counts, {given.radius}")
    if given is not None and interactive == 1:
        told.append(f"{' '.join(lines[10][:_SETS])} (patchtype): with i_interactive = 1 there are "
                    "no sets, but the ports alone")  # fmt: skip
        kinds = [IGNORED] * _SETS
    zones = [
        Zone(f"set{k + 1}", str(kind), k + 1, textiles[k + 1] if kind == PATCH else None)
        for k, kind in enumerate(kinds) if kind != IGNORED
    ]  # fmt: skip
    densities = lines[4][2:4]
    case = ForeignCase(
        "RTMsim", path, _mesh_of(path, " ".join(lines[1]), mesh), textiles[0], tuple(zones),
        fluid[3], decimal_of(densities[1], "line 5", path) if len(densities) == 2 else None,
        pressures[0], pressures[1], _row(lines, 2, 1, path)[0], _whole(lines, 13, 0, path) + 1,
        tuple(told),
    )  # fmt: skip
    return _on_mesh(case, first_set=1, ports=given)


def read_lcmsim(
    parts: Path | str,
    parameters: Path | str,
    mesh: Path | str,
    time: Decimal,
    ports: Path | None = None,
) -> ForeignCase:
    """Read the tables of LCMsim from its second version on.

    Parameters
    ----------
    parts : table of the parts.
    parameters : table of the simulation.
    time : end of the filling [s].
    ports : file of the ports that were picked with the mouse; by default that beside the mesh
        (``_pset.csv``), where the table has part 6, that of the ports.

    Raises
    ------
    InputError : a column that is missing, numbers that are none, no part of the type base, or a
        part that the mesh does not have.
    """
    path, file = Path(parts), Path(parameters)
    told: list[str] = []
    rows = [{"name": f"part{k}"} | row for k, row in enumerate(_table(path), start=2)]
    base, zones, names = None, [], list[str]()
    for number, row in enumerate(rows, start=2):
        where = f"line {number}"
        axis = [row.get(f"refdir{k}", row.get(f"refdir_{k}")) for k in (1, 2, 3)]
        values = [_cell(row, name, where, path) for name in
                  ("thickness", "porosity", "permeability", "alpha")]  # fmt: skip
        values += [decimal_of(text or "", f"{where}, refdir", path) for text in axis]
        textile = _textile(values, where, path)
        kind, name = row.get("type", ""), _plain_name(row["name"])
        told += _part_told(row)
        if name != row["name"]:
            told.append(f'name of {row["name"]}: the part is "{name}" in the case')
            row["name"] = name
        if name in names:
            raise InputError(
                f'{where}: the part has the name "{name}" of another one; give it its own',
                file=path,
            )
        names.append(name)
        if kind == BASE:
            base = textile
            continue
        if kind not in (INLET, PATCH, OUTLET):
            raise InputError(
                f'{where}: the type "{kind}" is none of base, inlet, outlet, patch', file=path
            )
        part = _whole_number(_cell(row, "part_id", where, path), f"{where}, part_id", path)
        zones.append(Zone(name, kind, part, textile))
    if base is None:
        raise InputError("has no part of the type base", file=path)
    layer, not_taken = _layer(rows, path)
    told += not_taken
    given, ignored = _ports_beside(Path(mesh), zones, ports)
    told += ignored
    (values_of,) = _table(file)[:1] or ({},)

    def value(name: str) -> Decimal:
        return _cell(values_of, name, "line 2", file)

    told.insert(0, "p_ref, rho_ref, gamma, rho_0_air: the air is not computed, the front moves "
                "into the cavity pressure")  # fmt: skip
    density = value("rho_0_oil") if "rho_0_oil" in values_of else None
    case = ForeignCase(
        "LCMsim", path, _existing(Path(mesh)), base, tuple(zones), value("mu_resin"), density,
        value("p_a"), value("p_init"), time, None, tuple(dict.fromkeys(told)), layer,
    )  # fmt: skip
    return _on_mesh(case, first_set=_BASE_ID + 1, ports=given)


def _ports_beside(
    mesh: Path, zones: list[Zone], given: Path | None
) -> tuple[Ports | None, list[str]]:
    """Return the ports of a case of LCMsim, or why those beside its mesh are left out."""
    if given is not None:
        return read_ports(given), []
    beside = mesh.parent / PORTS_FILE
    if not beside.is_file():
        return None, []
    if all(zone.number != PORTS_PART for zone in zones):
        return None, [f"{PORTS_FILE} beside the mesh: the table has no part {PORTS_PART}, which "
                      "its ports are; give it with --ports to take them for inlets"]  # fmt: skip
    return read_ports(beside), []


def case_text(case: ForeignCase) -> str:
    """Return the file of ``lcmchain fill MESH --case FILE`` that says the same."""
    lines = [f"# {case.program}: {case.file.name}, on the mesh {case.mesh.name}. Pressures are "
             "absolute."]  # fmt: skip
    lines += [f"# Not taken over: {text}." for text in case.told]
    density = "" if case.density is None else f', density = "{case.density} kg/m^3"'
    lines += [
        f'time = "{case.time} s"',
        f'resin = {{ law = "constant", viscosity = "{case.viscosity} Pa*s"{density} }}',
        f'vent_pressure = "{case.cavity_pressure} Pa"',
    ]
    if case.frames is not None:
        lines.append(f"frames = {max(case.frames, 2)}")
    base = case.base
    lines += [
        "", "[preform]", *_textile_lines(base, "permeability", case.layer), 'sets_hold = "cells"',
    ]  # fmt: skip
    if case.layer is not None:
        lines += ["", "[flow_medium]", *_layer_lines(case.layer, case.zones)]
    own = {zone.textile for zone in case.zones} - {base, None}
    for zone in case.zones:
        name, port = f'name = "{zone.name}"', zone.port
        of_set = [f'set = "{zone.place}"']
        opening = of_set if port is None else port.gate_lines
        if zone.kind == INLET:
            lines += ["", "[[gates]]", name, *opening, f'pressure = "{case.gate_pressure} Pa"']
        elif zone.kind == OUTLET:
            lines += ["", "[[vents]]", name, *opening, "except_gates = true"]
        # the cells of a port are no more those of the region around it
        if zone.textile in own or (port is not None and zone.textile is not None and own):
            assert zone.textile is not None
            lines += ["", "[[regions]]", name, *(of_set if port is None else port.cell_lines),
                      *_textile_lines(zone.textile, "own_permeability")]  # fmt: skip
    if not any(zone.kind == OUTLET for zone in case.zones):
        lines += ["", "[[vents]]", 'name = "rim"', "rim = true", "except_gates = true"]
    return "\n".join(lines) + "\n"


def _layer_lines(layer: Layer, zones: tuple[Zone, ...]) -> list[str]:
    lines = [
        f'thickness = "{layer.thickness} m"',
        f"porosity = {layer.porosity}",
        f'permeability = {{ k1 = "{layer.permeability} m^2" }}',
    ]
    places = [zone.place for zone in zones if zone.name == layer.part]
    return lines + [f'over = {{ set = "{place}" }}' for place in places]


def _textile_lines(textile: Textile, key: str, layer: Layer | None = None) -> list[str]:
    axis = ", ".join(map(str, textile.axis))
    through = "" if layer is None else f', k3 = "{layer.through} m^2"'
    return [
        f'thickness = "{textile.thickness} m"',
        f"fibre_volume_fraction = {1 - textile.porosity}",
        f'{key} = {{ k1 = "{textile.permeability} m^2", ratio = {textile.ratio}, '
        f"axis = [{axis}]{through} }}",
    ]


# --- the mesh -------------------------------------------------------------------------------------


def _on_mesh(case: ForeignCase, *, first_set: int, ports: Ports | None) -> ForeignCase:
    """Name the sets or parts of the mesh that the zones are, and find its ports.

    first_set : number in the file of the first set of a mesh without parts of these numbers.
    """
    target = read_target(case.mesh, kind="infiltration")
    sets, zones = list(target.cell_sets), []
    for zone in case.zones:
        named = f"property {zone.number}"
        at = zone.number - first_set
        if case.program == "LCMsim" and named in target.parts:
            place = named
        elif 0 <= at < len(sets):
            place = sets[at]
        elif ports is not None and zone.number == PORTS_PART:
            continue  # the ports alone
        else:
            there = ", ".join([*target.parts, *sets]) or "none"
            raise InputError(
                f'has no cells of "{zone.name}", number {zone.number} of {case.file.name}; its '
                f"sets and parts are {there}",
                file=case.mesh,
            )
        zones.append(replace(zone, place=place))
    if ports is not None:  # last, since their cells are part 6 whatever they were before
        zones += _port_zones(case, ports, target)
    if not any(zone.kind == INLET for zone in zones):
        raise InputError(
            "names no inlet, so that no resin would flow; give a set or part that type",
            file=case.file,
        )
    return replace(case, zones=tuple(zones))


def _port_zones(case: ForeignCase, ports: Ports, target: TargetMesh) -> list[Zone]:
    """Return a zone for each port: of part 6 of a table, else an inlet in the textile of all."""
    of_table = [z for z in case.zones if case.program == "LCMsim" and z.number == PORTS_PART]
    like = of_table[0] if of_table else Zone("port", INLET, PORTS_PART, None)
    found = on_mesh(ports, target, widens=case.program == "RTMsim")
    return [
        replace(like, name=f"{like.name}_{k}", port=port) for k, port in enumerate(found, start=1)
    ]


def _mesh_of(path: Path, name: str, mesh: Path | None) -> Path:
    """Find the mesh that an input file names; such files are run from the folder above theirs."""
    if mesh is not None:
        return _existing(mesh)
    relative = Path(name.replace("\\", "/"))
    for folder in (path.parent, path.parent.parent):
        if (folder / relative).is_file():
            return folder / relative
    raise InputError(
        f'names the mesh "{relative}", which is neither beside it nor in the folder above; name it '
        "with --mesh",
        file=path,
    )


def _existing(mesh: Path) -> Path:
    if not mesh.is_file():
        raise InputError("there is no such mesh file", file=mesh)
    return mesh


# --- what is left out -----------------------------------------------------------------------------


def _layer(rows: list[dict[str, str]], path: Path) -> tuple[Layer | None, list[str]]:
    """Return the flow medium of a table, or why it is not taken over."""
    columns = ("thickness_DM", "porosity_DM", "permeability_DM")
    have = [row for row in rows if _differs(row.get(columns[0]), "0")]
    if not have:
        return None, []
    names = ", ".join(row.get("name", "") for row in have)
    what = f"thickness_DM, porosity_DM, permeability_DM of {names}"
    slower = "the front will be slower than with the flow medium"
    through = {row.get("permeability_Z") for row in rows}
    if any(not row.get(name) for row in have for name in columns) or None in through:
        return None, [f"{what}: all three and permeability_Z are needed of every part; {slower}"]
    values = {tuple(_cell(row, name, row["name"], path) for name in columns) for row in have}
    of_preform = {decimal_of(text or "", "permeability_Z", path) for text in through}
    everywhere = len(have) == len(rows)
    if len(values) > 1 or len(of_preform) > 1:
        return None, [f"{what}: they differ from part to part, and a case has one layer; {slower}"]
    if not everywhere and (len(have) > 1 or have[0].get("type") == BASE):
        return None, [
            f"{what}: it is on several parts but not on all; give the case a [flow_medium] over a "
            f"set of all of them, or {slower}"
        ]
    (thickness, porosity, permeability), (third,) = values.pop(), of_preform
    if min(thickness, permeability, third) <= 0 or not 0 < porosity < 1:
        raise InputError(
            f"{what}: thickness and permeabilities (permeability_Z too) are above 0, a porosity "
            "lies between 0 and 1",
            file=path,
        )
    told = []
    if any(_differs(row.get("permeability_DM_Z"), "0") for row in have):
        told.append(f"permeability_DM_Z of {names}: resin crosses the layer without resistance")
    part = None if everywhere else have[0]["name"]
    return Layer(part, thickness, porosity, permeability, third), told


def _part_told(row: dict[str, str]) -> list[str]:
    """Say what of a part is not taken over, where it says anything."""
    told, name = [], row["name"]
    for column in ("porosity_noise", "permeability_noise"):
        if _differs(row.get(column), "0"):
            told.append(f"{column} of {name}: properties have no scatter")
    if any(_differs(row.get(column), row.get("porosity")) for column in
           ("porosity_1", "porosity_2")):  # fmt: skip
        told.append(f"porosity_1, p_1, porosity_2, p_2, n_CK of {name}: the preform keeps its "
                    "thickness and porosity while it fills")  # fmt: skip
    return told


def _differs(text: str | None, other: str | None) -> bool:
    if not text or not other:
        return False
    try:
        return Decimal(text) != Decimal(other)
    except InvalidOperation:
        return True


# --- text -----------------------------------------------------------------------------------------


def _entries(path: Path) -> list[list[str]]:
    """Return the entries of the lines of an input file, without its comments."""
    try:
        text = path.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror})", file=path) from None
    lines = [line.split("#")[0].split() for line in text.splitlines()]
    lines = [line for line in lines if line]
    if len(lines) != _LINES:
        raise InputError(
            f"has {len(lines)} lines with entries; an input file of RTMsim has {_LINES}, from "
            "i_model to n_pics",
            file=path,
        )
    return lines


def _row(lines: list[list[str]], line: int, count: int, path: Path) -> list[Decimal]:
    if len(lines[line]) < count:
        raise InputError(
            f"line {line + 1} has {len(lines[line])} entries; {count} are needed", file=path
        )
    return [decimal_of(text, f"line {line + 1}", path) for text in lines[line][:count]]


def _whole(lines: list[list[str]], line: int, place: int, path: Path) -> int:
    return _whole_number(_row(lines, line, place + 1, path)[place], f"line {line + 1}", path)


def _whole_number(value: Decimal, where: str, path: Path) -> int:
    if value != value.to_integral_value():
        raise InputError(f"{where}: {value} is no whole number", file=path)
    return int(value)


def _plain_name(name: str) -> str:
    """Return the name of a part as one that a case may have, of letters, digits, _ and -."""
    plain = re.sub(r"[^A-Za-z0-9_-]+", "_", name).strip("_-")
    return plain if plain[:1].isalpha() else f"part_{plain}".rstrip("_")


def _textile(values: list[Decimal], where: str, path: Path) -> Textile:
    thickness, porosity, permeability, ratio, *axis = values
    if min(thickness, permeability, ratio) <= 0 or not 0 < porosity < 1 or not any(axis):
        raise InputError(
            f"{where}: thickness, permeability and alpha are above 0, a porosity lies between 0 "
            "and 1, and one refdir is not 0",
            file=path,
        )
    x, y, z = axis
    return Textile(thickness, porosity, permeability, ratio, (x, y, z))


def _table(path: Path) -> list[dict[str, str]]:
    try:
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror})", file=path) from None
    except UnicodeDecodeError:
        raise InputError("is no CSV text", file=path) from None
    reader = csv.DictReader(text.splitlines(), skipinitialspace=True)
    rows = []
    for row in reader:
        surplus = row.pop(None, [])
        if any(cell.strip() for cell in surplus):
            raise InputError(
                f"line {reader.line_num} has more cells than the header has columns; a comma "
                "stands between cells, so numbers need a decimal point",
                file=path,
            )
        if any(row.values()):
            rows.append({str(name).strip(): (cell or "").strip() for name, cell in row.items()})
    return rows


def _cell(row: dict[str, str], name: str, where: str, path: Path) -> Decimal:
    if name not in row:
        there = ", ".join(row) or "none"
        raise InputError(
            f"has no column {name}; a comma stands between columns, and those found are {there}",
            file=path,
        )
    return decimal_of(row[name], f"{where}, {name}", path)
