"""What plies, tables and elements of a scene may not say together."""

from __future__ import annotations

from collections.abc import Iterable

from lcmchain.materials.laws import TABLES
from lcmchain.quantities.entry_types import no_such, share_a_stage, wrong
from lcmchain.scene.infiltration import Infiltration
from lcmchain.scene.output import MOST_SAMPLES, SHEET_NAME
from lcmchain.scene.plies import names_two_families
from lcmchain.scene.stack import PlySettings, Stack, lie_over_each_other, stack_of
from lcmchain.scene.stages import laid_later
from lcmchain.scene.tables import SceneTables

#: Gap between plies at the start that counts as none where resin flows, in parts of the thinner.
LARGEST_WET_GAP = 0.01
#: Why the formed sheet of several courses is not filled.
RESIN_AT_JOINTS = (
    "fills the formed sheet, whose courses have no common nodes: resin would not cross their "
    "joints; fill a mesh that it is mapped to ([mapping.infiltration])"
)
#: How deep two plies may lie in each other at the start, in parts of the thinner one's thickness.
DEEPEST_OVERLAP = 0.5


def check_scene(scene: SceneTables) -> None:
    """Refuse entries of several tables that contradict each other.

    Raises
    ------
    PydanticCustomError : names the key.
    """
    _check_laws(scene)
    _check_thickness(scene)
    if not scene.element.has_forces:
        _check_draping(scene)
    _check_courses(scene)
    _check_pressures(scene)
    if len(scene.stack) > 1:
        _check_what_knows_one_sheet(scene)
    _check_infiltrations(scene)
    _check_fibres(scene)
    if scene.process.time > MOST_SAMPLES * scene.history_interval:
        raise wrong(
            f"gives more than {MOST_SAMPLES:,} samples over process.time; use a longer one",
            field="output.history_interval",
        )
    for ply in scene.stack:
        if ply.thickness > min(ply.blank.extent):
            raise wrong(
                f"is {ply.thickness * 1e3:g} mm, larger than the blank; check its unit",
                field=f"{ply.material_key}.thickness",
            )


def _check_laws(scene: SceneTables) -> None:
    """Refuse materials that permeability, elements or the short form of a stack cannot take."""
    if scene.permeability is not None:
        _require_fibre_density(scene, "permeability", " or leave [permeability] out")
    for ply in scene.stack:
        if ply.element.type not in ply.material.families:
            raise wrong(_law_of_no_use(ply), field=f"{ply.material_key}.law")
    if scene.layup is not None and names_two_families(scene.layup):
        other = next((ply for ply in scene.stack if not ply.material.is_biaxial), None)
        if other is not None:
            raise wrong(
                f'is "{scene.layup}", which writes plies by two families at a right angle, but '
                f"those of {other.material.name} are others; write the angle of each ply from "
                'x to its first axis alone, as in "[0, 90]"',
                field="layup",
            )


def _law_of_no_use(ply: PlySettings) -> str:
    """Say that the elements of a ply do not know the law of its material, and what does."""
    element, law = ply.element.type, ply.material.law
    known = [f'"{table.law_name()}"' for table in TABLES if element in table.families]
    return (
        f'is "{law}", but element = "{element}" knows the law {" and ".join(known)} only; use '
        f'element = "{ply.material.families[0]}"'
    )


def _require_fibre_density(scene: SceneTables, asker: str, otherwise: str = "") -> None:
    for key, material in {p.material_key: p.material for p in scene.stack.preform}.items():
        if material.fibre_density is None:
            raise wrong(
                f"is missing, but {asker} needs the fibre volume fraction; give "
                f'fibre_density = "1810 kg/m^3"{otherwise}',
                field=f"{key}.fibre_density",
            )


def _flat_element(scene: SceneTables) -> str | None:
    """Return the name of an element of the scene that does not predict the thickness."""
    return next((ply.element.type for ply in scene.stack if not ply.element.has_thickness), None)


def _check_thickness(scene: SceneTables) -> None:
    """Refuse a permeability where no element predicts the thickness."""
    flat = _flat_element(scene)
    if flat is not None and scene.permeability is not None:
        raise wrong(
            f'needs the thickness, which element = "{flat}" does not predict; use '
            'element = "solid-shell", or leave the entry out (on the command line: '
            "--set permeability=none)",
            field="permeability",
        )


def _check_pressures(scene: SceneTables) -> None:
    """Refuse pressures on faces that a sheet does not have, or on plies that are not there."""
    flat = _flat_element(scene)
    if scene.pressure and flat is not None:
        raise wrong(
            f'acts on the faces of the sheet, but element = "{flat}" has one '
            'layer of nodes; use element = "solid-shell"',
            field="pressure",
        )
    names = [ply.name for ply in scene.stack]
    for index, entry in enumerate(scene.pressure):
        if entry.ply is not None and entry.ply not in names:
            raise wrong(
                f'is "{entry.ply}", but there is no such ply; there is {", ".join(names)}',
                field=f'pressure[{index}] "{entry.name}".ply',
            )


def _check_fibres(scene: SceneTables) -> None:
    """Refuse settings of fibres for materials without."""
    for ply in scene.stack:
        share = getattr(ply.element, "fibre_hourglass", None)
        if share not in (None, 1.0) and not ply.material.has_fibres:
            raise wrong(
                f'is {share:g}, but law = "{ply.material.law}" has no fibres; leave it out',
                field=f"{ply.element_key}.fibre_hourglass",
            )
    if scene.process.fibre_modulus_factor != 1.0 and not scene.stack.has_fibres:
        raise wrong(
            f'is {scene.process.fibre_modulus_factor:g}, but law = "{scene.stack[0].material.law}" '
            "has no fibres whose modulus could be lowered; leave it out",
            field="process.fibre_modulus_factor",
        )


def _check_what_knows_one_sheet(scene: SceneTables) -> None:
    """Refuse the loads and stages that a stack would need a rule of its own for."""
    for index, entry in enumerate(scene.pressure):
        if entry.ply is None and not scene.stack.has_one_outline:
            raise wrong(
                "acts on the outer faces of a stack, but its plies have unlike outlines: which "
                "faces lie bare beside a smaller ply changes as they slide; name the ply whose "
                "face is pressed (ply), give all plies one outline, or press with a tool",
                field=f'pressure[{index}] "{entry.name}"',
            )
    for key, case in _cases(scene):
        if case.with_forming is not None:
            _check_wet_stack(scene, key)


def _check_wet_stack(scene: SceneTables, key: str) -> None:
    """Refuse stacks in which it is not known what resin presses on, or where it is."""
    if scene.stack.films:
        raise wrong(
            f'lets resin flow through all plies while they are formed, but "'
            f'{scene.stack.films[0].name}" is a film, through which none flows; leave the entry '
            "out, and the formed stack is filled",
            field=f"{key}.with_forming",
        )
    if later := laid_later(scene):
        raise wrong(
            f"lets resin flow through all plies while they are formed, but "
            f'"{later[0].name}" is laid down later, dry; leave its stages out, or leave the '
            "entry out, and the formed stack is filled",
            field=f"{key}.with_forming",
        )
    for below, ply in scene.stack.lying_on_each_other():
        gap = ply.bottom - below.top
        if abs(gap) > LARGEST_WET_GAP * min(below.thickness, ply.thickness):
            what = f"leaves a gap of {1e3 * gap:.4g} mm to"
            if gap < 0.0:
                what = f"puts the ply {-1e3 * gap:.4g} mm deep into"
            raise wrong(
                f'{what} "{below.name}", but with '
                f"{key}.with_forming plies lie on each other at the start: whether resin is "
                "between them is not known; leave the height out",
                field=f"{ply.key}.height",
            )


def _check_draping(scene: SceneTables) -> None:
    """Refuse what a net without forces knows nothing of."""
    loads = "pressure" if scene.pressure else "grippers" if scene.grippers else None
    if scene.infiltration is not None and scene.infiltration.with_forming is not None:
        loads = "infiltration.with_forming"
    if loads is not None:
        raise wrong(
            f'acts on the sheet while it is formed, but element = "{scene.element.type}" has no '
            'forces; leave it out, or use element = "solid-shell"',
            field=loads,
        )
    if scene.draping.courses and scene.infiltration is not None:
        raise wrong(RESIN_AT_JOINTS, field="infiltration")


def _check_courses(scene: SceneTables) -> None:
    """Refuse what asks a ply that is laid in courses for one piece."""
    laid = [ply for ply in scene.stack if ply.blank.courses is not None]
    if not laid:
        return
    if scene.draping.courses:
        raise wrong(
            f"lay the courses of a net, but {laid[0].key}.courses lays those of the ply, which "
            "the net follows too; leave one of them out",
            field="draping.courses",
        )
    if scene.draping.start_line is not None:
        raise wrong(
            f"is the line of one net, but {laid[0].key}.courses has several; leave one of them out",
            field="draping.start_line",
        )
    if scene.infiltration is not None:
        raise wrong(RESIN_AT_JOINTS, field="infiltration")
    for index, gripper in enumerate(scene.grippers):
        held = [ply for ply in laid if gripper.ply in (None, ply.name)]
        if gripper.rim and held:
            raise wrong(
                f"is true, but {held[0].key}.courses makes several pieces with a rim each; name a "
                "box, or a loop by a point next to the rim of a course",
                field=f'grippers[{index}] "{gripper.name}".rim',
            )


def _cases(scene: SceneTables) -> list[tuple[str, Infiltration]]:
    """Return every infiltration behind its key."""
    cases = [("infiltration", scene.infiltration)]
    cases += [
        (f'mapping[{index}] "{target.name}".infiltration', target.infiltration)
        for index, target in enumerate(scene.mapping)
    ]
    return [(key, case) for key, case in cases if case is not None]


def _check_infiltrations(scene: SceneTables) -> None:
    """Refuse an infiltration that the formed sheet has nothing for."""
    for key, case in _cases(scene):
        if not scene.stack.has_thickness:
            raise wrong(
                f'needs the thickness, which element = "{scene.element.type}" does not '
                'predict; use element = "solid-shell"',
                field=key,
            )
        _require_fibre_density(scene, "infiltration")
        if scene.permeability is None and case.permeability is None:
            raise wrong(
                "is missing, but infiltration needs it; give [permeability] with "
                'law = "gebart" and fibre_radius = "3.5 um", or a permeability in '
                f"[{key.partition('[')[0]}{'.infiltration' if '[' in key else ''}]",
                field="permeability",
            )
    for index, target in enumerate(scene.mapping):
        if target.infiltration is not None and target.infiltration.with_forming is not None:
            raise wrong(
                f"flows in a mesh of its own, {target.mesh}; with_forming stands in "
                "[infiltration], that of the sheet",
                field=f'mapping[{index}] "{target.name}".infiltration.with_forming',
            )
    for key, place in scene.infiltration.places() if scene.infiltration is not None else ():
        if place.set is not None:
            raise wrong(
                f'names the set "{place.set}", but the formed sheet has no sets: name a point, '
                "a box, a loop or the rim, or fill a mesh that has it ([mapping.infiltration])",
                field=f"infiltration.{key}.set",
            )
    if scene.infiltration is not None and SHEET_NAME in [t.name for t in scene.mapping]:
        raise wrong(
            f'has the name "{SHEET_NAME}", that of the files of [infiltration]; choose another',
            field="mapping",
        )


# --- plies of a stack -----------------------------------------------------------------------------


def check_stack(scene: SceneTables) -> None:
    """Refuse plies that cannot lie as a scene says, and names of what is not there.

    Raises
    ------
    PydanticCustomError : names the key.
    """
    for index, ply in enumerate(scene.plies):
        if ply.material is not None and ply.material not in scene.materials:
            key = f'plies[{index}] "{ply.name}".material'
            raise wrong(
                _not_there(ply.material, scene.materials, "entry of [materials]"), field=key
            )
    stack = stack_of(scene)
    for film in stack.films:
        if film.material.has_fibres:
            raise wrong(
                f'is true, but law = "{film.material.law}" has fibres; a film is of a law without, '
                'as "neo-hooke"',
                field=f"{film.key}.film",
            )
    if stack.films and not stack.preform:
        raise wrong(
            "are films alone, which are taken off after forming: nothing would be left; leave film "
            "out of one of them",
            field="plies",
        )
    for entry, ply_element in stack.elements.items():
        if len(stack) > 1 and not ply_element.has_forces:
            raise wrong(
                f'is "{ply_element.type}", which lays one sheet without forces and knows nothing '
                'of plies that touch; use element = "solid-shell"',
                field=entry,
            )
    for index, upper in enumerate(stack):
        for under in stack[:index]:
            # one that is laid down on what is formed by then is looked at when it comes
            if _come_together(under, upper, scene):
                _check_overlap(under, upper)
    _check_interfaces(scene, stack)


def _come_together(one: PlySettings, other: PlySettings, scene: SceneTables) -> bool:
    """Tell whether two plies are there from the same stage on."""
    every = {stage.name for stage in scene.stages}
    first, second = (every if ply.stages is None else set(ply.stages) for ply in (one, other))
    return first == second


def _check_overlap(under: PlySettings, ply: PlySettings) -> None:
    """Refuse a ply that lies in or below one that stands before it."""
    depth = under.top - ply.bottom
    if depth <= DEEPEST_OVERLAP * min(under.thickness, ply.thickness) * (1.0 + 1e-9):
        return
    if lie_over_each_other(under, ply):
        raise wrong(
            f'puts the ply {1e3 * depth:.4g} mm deep into "{under.name}", which stands before it '
            f"and so lies below; leave height out, or give {1e3 * (ply.blank.height + depth):.6g} "
            "mm or more",
            field=f"{ply.key}.height",
        )


def _check_interfaces(scene: SceneTables, stack: Stack) -> None:
    """Refuse an interface of a ply with itself, or with one that is not there."""
    alone = len(stack) < 2
    if alone and any(entry.between or not entry.itself for entry in scene.interfaces):
        raise wrong(
            "lie between plies, but the scene has one sheet; leave them out, give [[plies]], or "
            "let the sheet touch itself with itself = true and no between",
            field="interfaces",
        )
    plies = [ply.name for ply in stack]
    given: list[tuple[frozenset[str] | None, tuple[str, ...] | None]] = []
    for index, entry in enumerate(scene.interfaces):
        key = f"interfaces[{index}].between"
        pair = None if entry.between is None else frozenset(entry.between)
        for name in entry.between or ():
            if name not in plies and name not in scene.materials:
                raise wrong(
                    _not_there(name, [*plies, *scene.materials], "ply or material"), field=key
                )
        if pair is not None and len(pair) == 1 and pair <= set(plies):
            raise wrong(
                f'names the ply "{entry.between[0]}" twice; '  # type: ignore[index]
                "an interface lies between two plies, and itself = true lets them touch themselves",
                field=key,
            )
        same = [
            number
            for number, (other, stages) in enumerate(given)
            if other == pair and share_a_stage(stages, entry.stages)
        ]
        if same:
            together = _together(entry.stages, given[same[0]][1], scene)
            raise wrong(
                f"says the same two as interfaces[{same[0]}]{together}; leave one of them out"
                if pair is not None
                else f"is left out, and so it is in interfaces[{same[0]}]{together}; one entry "
                "holds for all that no other one names",
                field=key,
            )
        given.append((pair, entry.stages))


def _together(
    one: tuple[str, ...] | None, other: tuple[str, ...] | None, scene: SceneTables
) -> str:
    """Name the first stage that two entries share, in words; nothing without stages."""
    for stage in scene.stages:
        if all(stages is None or stage.name in stages for stages in (one, other)):
            return f', which is at work in the stage "{stage.name}" too'
    return ""


def _not_there(name: str, known: Iterable[str], what: str) -> str:
    """Say that there is no ply or material of a name, and what is meant instead."""
    return f'is "{name}", {no_such(name, list(known), what)}'
