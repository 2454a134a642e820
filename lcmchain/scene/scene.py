"""The scene: all tables of a scene file, put together, with the checks between them.

Attribute names are the keys of the TOML file. All values are SI floats. Models built in Python
take SI numbers or texts with units; a scene file must give physical quantities with units. The
tables stand in the files that implement them.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Self, TypeVar

import numpy as np
from pydantic import Field, PrivateAttr, ValidationInfo, field_validator, model_validator
from pydantic_core import PydanticCustomError

from lcmchain.effects.contact import Contact
from lcmchain.effects.effect import Refusal
from lcmchain.effects.face_pressure import PressureOnFace
from lcmchain.effects.grippers import Gripper
from lcmchain.effects.switches import EffectSettings, Switched, changes, settings_of, switches
from lcmchain.elements.families import SheetElement
from lcmchain.elements.solid_shell.table import Element
from lcmchain.errors import InputError
from lcmchain.interfaces.table import Interface
from lcmchain.materials.laws import AnyMaterial
from lcmchain.mesh.blank import Blank
from lcmchain.quantities.entry_types import (
    MOST_STAGES,
    AbsentMeans,
    Name,
    Row,
    SceneModel,
    Text,
    with_own_names,
    wrong,
)
from lcmchain.scene.checks import check_scene, check_stack
from lcmchain.scene.completed_stages import completed_stages, require_no_stages
from lcmchain.scene.draping import Draping
from lcmchain.scene.infiltration import Infiltration
from lcmchain.scene.infiltration.laws import Permeability
from lcmchain.scene.output import DEFAULT_SAMPLES, SHEET_NAME, MappingTarget, Output, Unit
from lcmchain.scene.pace import why_time_is_needed
from lcmchain.scene.plies import EXAMPLE as LAYUP_EXAMPLE
from lcmchain.scene.plies import (
    MOST_PLIES,
    LayupError,
    Ply,
    angles_of,
    complete_element,
    named_plies,
)
from lcmchain.scene.presets import fill_preset
from lcmchain.scene.process import (
    AVERAGING_PART,
    DAMPING_TIMES_TIME,
    Process,
    Stage,
    found_time,
)
from lcmchain.scene.stack import PlySettings, Stack, stack_of
from lcmchain.scene.stages import StagePlan, frame_times, stage_plans
from lcmchain.tools.motion import PRESCRIBED
from lcmchain.tools.tool import Tool

#: Text that takes back an optional table, for overrides: TOML has no null.
NONE = "none"

#: Most tools and meshes to map onto, far above any use: each costs time in every step or file.
MOST_TOOLS = 200
MOST_MESHES = 100
MOST_PRESSURES = 100
MOST_GRIPPERS = 200


@dataclass(frozen=True)
class SceneSource:
    """Where a scene came from, and which of its values were given and which defaulted.

    Parameters
    ----------
    path : the scene file, or None for a text or a scene built in Python.
    directory : folder to which file names in the scene are relative.
    text : text of the scene file; overrides stand at its end as comments.
    sha256 : of that text; without overrides the same as of the file (less a byte-order mark).
    given, defaulted : dotted key and value as text, in the order of the tables.
    files : dotted key and value of every entry that names a file.
    left_out : dotted keys of what was given but dropped with a change of the model
        (:func:`lcmchain.scene.rungs.on_rung`).
    """

    path: Path | None
    directory: Path
    text: str
    sha256: str
    given: list[tuple[str, str]] = field(default_factory=list)
    defaulted: list[tuple[str, str]] = field(default_factory=list)
    files: list[tuple[str, str]] = field(default_factory=list)
    left_out: tuple[str, ...] = ()


#: A table with the edge length of elements.
WithEdges = TypeVar("WithEdges", Blank, Ply)


class Scene(SceneModel):
    """Everything that one forming simulation needs, in SI units."""

    title: Annotated[str, Text("Hemisphere with blank holder")] = Field(
        default="untitled", description="Title of pictures and files."
    )
    process: Process = Field(default_factory=Process)
    element: SheetElement = Field(
        default_factory=Element,
        description="Kind of element and its options; a name alone takes the defaults.",
    )
    plies: Annotated[
        tuple[Ply, ...],
        Row(
            "[[plies]] ... for each ply",
            entries="tables",
            units=False,
            maximum_count=MOST_PLIES,
        ),
        AbsentMeans(""),
    ] = Field(default=(), description="The plies of a stack, bottom first, in place of [blank].")
    layup: Annotated[Annotated[str, Text(LAYUP_EXAMPLE)] | None, AbsentMeans("")] = Field(
        default=None,
        description="Short form of plies that share [blank] and [material]: their angles in "
        "degrees, bottom first.",
    )
    blank: Annotated[Blank | None, AbsentMeans("")] = Field(
        default=None, description="The flat textile layer before forming; needed without [[plies]]."
    )
    material: Annotated[AnyMaterial | None, AbsentMeans("")] = Field(
        default=None,
        description="What the sheet is made of; needed unless all plies name an entry of "
        "[materials].",
    )
    materials: Annotated[dict[Annotated[str, Name("biaxial")], AnyMaterial], AbsentMeans("")] = (
        Field(
            default_factory=dict,
            description="Further materials by name, for the entry material of plies.",
        )
    )
    interfaces: Annotated[
        tuple[Interface, ...],
        Row(
            "[[interfaces]] ... for each kind of interface",
            entries="tables",
            units=False,
            maximum_count=MOST_PLIES,
        ),
        AbsentMeans(""),
    ] = Field(default=(), description="How plies press and slide on each other.")
    contact: Contact = Field(default_factory=Contact)
    effects: EffectSettings = Field(
        default_factory=EffectSettings,
        description="Effects that are switched on or off, whatever the scene calls for.",
    )
    tools: Annotated[
        tuple[Tool, ...],
        Row("[[tools]] ... for each tool", entries="tables", units=False, maximum_count=MOST_TOOLS),
    ] = ()
    pressure: Annotated[
        tuple[PressureOnFace, ...],
        Row(
            "[[pressure]] ... for each pressure",
            entries="tables",
            units=False,
            maximum_count=MOST_PRESSURES,
        ),
    ] = ()
    grippers: Annotated[
        tuple[Gripper, ...],
        Row(
            "[[grippers]] ... for each gripper",
            entries="tables",
            units=False,
            maximum_count=MOST_GRIPPERS,
        ),
    ] = ()
    stages: Annotated[
        tuple[Stage, ...],
        Row(
            "[[stages]] ... for each stage",
            entries="tables",
            units=False,
            maximum_count=MOST_STAGES,
        ),
        AbsentMeans(""),
    ] = Field(default=(), description="The stages of the process in their order.")
    draping: Draping = Field(default_factory=Draping)
    output: Output = Field(default_factory=Output)
    mapping: Annotated[
        tuple[MappingTarget, ...],
        Row(
            "[[mapping]] ... for each mesh",
            entries="tables",
            units=False,
            maximum_count=MOST_MESHES,
        ),
    ] = ()
    permeability: Annotated[Permeability | None, AbsentMeans(NONE)] = Field(
        default=None,
        description="Law that turns fibre volume fraction and directions into permeability.",
    )
    infiltration: Annotated[Infiltration | None, AbsentMeans(NONE)] = Field(
        default=None,
        description="Infiltration of the formed sheet itself; that of another mesh stands in its "
        "[[mapping]] entry.",
    )
    fmu: Annotated[Unit | None, AbsentMeans("contact.friction alone is a parameter")] = Field(
        default=None, description="What a master may set in the unit of lcmchain fmu build."
    )

    _source: SceneSource | None = PrivateAttr(default=None)
    _switched: tuple[Switched, ...] = PrivateAttr(default=())
    _before_switches: dict[str, Any] = PrivateAttr(default_factory=dict)
    _time_is_found: bool = PrivateAttr(default=False)
    _damping_is_found: bool = PrivateAttr(default=False)
    _as_written: dict[str, Any] = PrivateAttr(default_factory=dict)

    @property
    def source(self) -> SceneSource:
        """Where the scene came from; empty for a scene built in Python."""
        return self._source or SceneSource(None, Path.cwd(), "", "")

    @property
    def time_is_found(self) -> bool:
        """Whether the process has no time of its own: ``process.time`` is that at pace 1."""
        return self._time_is_found

    @property
    def damping_is_found(self) -> bool:
        """Whether ``process.mass_damping`` was left out, and found with the time."""
        return self._damping_is_found

    @property
    def as_written(self) -> dict[str, Any]:
        """The tables that stages have filled in, as they stood before; empty without stages."""
        return self._as_written

    @property
    def frame_times(self) -> np.ndarray:
        """Times of the saved frames [s], the start first; borders of stages are among them."""
        return frame_times(self)

    def stage_plans(self) -> tuple[StagePlan, ...]:
        """Return what a model needs to know of every stage; nothing without stages."""
        return stage_plans(self, self._as_written) if self.stages else ()

    @property
    def switched(self) -> tuple[Switched, ...]:
        """Effects that ``[effects]`` has switched against what the other entries call for."""
        return self._switched

    @property
    def before_switches(self) -> dict[str, Any]:
        """The entries that ``[effects]`` has changed, as they stood before, by their names."""
        return self._before_switches

    @property
    def stack(self) -> Stack:
        """The plies from the bottom up, with all that each is built from; one where it is alone."""
        return stack_of(self)

    def with_longer_edges(self, factor: float) -> Scene:
        """Return the scene with the edges of all elements longer by a factor."""

        def longer(blank: WithEdges) -> WithEdges:
            return blank.model_copy(update={"edge_length": factor * blank.edge_length})

        plies = tuple(longer(ply) for ply in self.plies)
        blank = None if self.blank is None else longer(self.blank)
        return self.model_copy(update={"blank": blank, "plies": plies})

    def alone(self, ply: PlySettings) -> Scene:
        """Return the scene with one of its plies and no other, as far as one sheet can be it."""
        blank = ply.blank
        if any(ply.center):
            blank = Blank.model_construct(
                **ply.shape, drawing=None, courses=ply.courses,
                edge_length=blank.edge_length, fibre_angle=blank.fibre_angle, height=blank.height,
            )  # fmt: skip
        return self.model_copy(
            update={
                "blank": blank, "material": ply.material, "element": ply.element, "plies": (),
                "layup": None, "interfaces": (),
            }
        )  # fmt: skip

    def only_ply(self, asker: str) -> PlySettings:
        """Return the one sheet of a scene, for what knows one.

        asker : who asks, in words that precede "takes one sheet", such as ``lcmchain coupon``.

        Raises
        ------
        InputError : the scene names several.
        """
        stack = self.stack
        if len(stack) > 1:
            names = ", ".join(ply.name for ply in stack[:3]) + (", ..." if len(stack) > 3 else "")
            raise InputError(
                f"names {len(stack)} plies ({names}), but {asker} takes one sheet; use a scene "
                "with [blank] and [material]",
                key="plies" if self.plies else "layup",
            )
        return stack[0]

    def shared_blank(self, asker: str) -> Blank:
        """Return ``[blank]``, from which all plies are cut, for what varies one edge length.

        asker : who asks, in words that precede "varies one edge length".

        Raises
        ------
        InputError : the plies are entries of ``[[plies]]`` with an edge length each.
        """
        if self.blank is None:
            raise InputError(
                f"names {len(self.plies)} plies with an edge_length each, but {asker} varies one "
                "edge length; write plies of one outline as layup, beside [blank]",
                key="plies",
            )
        return self.blank

    @property
    def history_interval(self) -> float:
        """Time between two samples of the histories [s]."""
        return self.output.history_interval or self.process.time / DEFAULT_SAMPLES

    @field_validator("plies")
    @classmethod
    def _name_plies(cls, plies: tuple[Ply, ...]) -> tuple[Ply, ...]:
        return named_plies(plies)

    @field_validator("layup")
    @classmethod
    def _check_layup(cls, code: str | None, info: ValidationInfo) -> str | None:
        if code is None:
            return None
        if info.data.get("plies"):
            raise wrong("stands beside [[plies]], which say the same; leave one of them out")
        try:
            angles_of(code)
        except LayupError as error:
            raise wrong(str(error)) from None
        return code

    @field_validator("blank")
    @classmethod
    def _check_blank(cls, blank: Blank | None, info: ValidationInfo) -> Blank | None:
        plies = info.data.get("plies")
        if plies and blank is not None:
            raise wrong(
                "stands beside [[plies]], which have size, edge_length and fibre_angle each; leave "
                "[blank] out"
            )
        if plies == () and blank is None:
            raise PydanticCustomError("missing", "is missing")
        angle_given = blank is not None and "fibre_angle" in blank.model_fields_set
        if angle_given and info.data.get("layup") is not None:
            raise wrong(
                "stands beside layup, which says the angle of every ply; leave one of them out",
                field="fibre_angle",
            )
        return blank

    @field_validator("material", mode="before")
    @classmethod
    def _fill_preset(cls, value: object) -> object:
        return fill_preset(value)

    @field_validator("material")
    @classmethod
    def _check_material(
        cls, material: AnyMaterial | None, info: ValidationInfo
    ) -> AnyMaterial | None:
        plies = info.data.get("plies")
        if material is None and plies is not None:
            without = [ply.name for ply in plies if ply.material is None]
            if not plies:
                raise PydanticCustomError("missing", "is missing")
            if without:
                raise wrong(
                    f'is missing, but the ply "{without[0]}" names no entry of [materials]; give '
                    'one of both, for example [material] with preset = "MD600"'
                )
        return material

    @field_validator("materials", mode="before")
    @classmethod
    def _fill_presets(cls, tables: object) -> object:
        if not isinstance(tables, dict):
            return tables
        filled = {}
        for name, table in tables.items():
            try:
                filled[name] = fill_preset(table)
            except PydanticCustomError as error:
                context = error.context or {}
                field = f"{name}.{context.get('field', '')}"
                raise wrong(context.get("message", str(error)), field=field) from None
        return filled

    @field_validator("element", mode="before")
    @classmethod
    def _complete_element(cls, value: object) -> object:
        return complete_element(value)

    @field_validator("permeability", "infiltration", mode="before")
    @classmethod
    def _allow_none(cls, value: object) -> object:
        return None if value == NONE else value

    @field_validator("tools", "mapping", "pressure", "grippers", "stages")
    @classmethod
    def _check_names(cls, items: tuple[Any, ...]) -> tuple[Any, ...]:
        return with_own_names(items)

    @field_validator("tools")
    @classmethod
    def _complete_tools(cls, tools: tuple[Tool, ...], info: ValidationInfo) -> tuple[Tool, ...]:
        """Fill the tool entries whose default is another entry of the scene."""
        contact, process = info.data.get("contact"), info.data.get("process")
        if contact is None or process is None:
            return tools  # their own errors are reported; nothing to fill from
        if process.time is None:
            return tools  # completed with the time that is found for the whole scene
        return tuple(
            tool.completed(contact.friction, process.time, key=f'[{index}] "{tool.name}"')
            for index, tool in enumerate(tools)
        )

    @field_validator("grippers")
    @classmethod
    def _complete_grippers(
        cls, grippers: tuple[Gripper, ...], info: ValidationInfo
    ) -> tuple[Gripper, ...]:
        """Fill the gripper entries whose default is another entry of the scene."""
        process = info.data.get("process")
        if process is None or process.time is None:
            return grippers  # as those of the tools
        return tuple(
            gripper.completed(process.time, key=f'[{index}] "{gripper.name}"')
            for index, gripper in enumerate(grippers)
        )

    @model_validator(mode="after")
    def _check_stack(self) -> Self:
        check_stack(self)
        return self

    @model_validator(mode="after")
    def _find_time(self) -> Self:
        """Fill in what a process without a time takes: its time, its damping, and its tools'."""
        process = self.process
        is_damping_given = "mass_damping" in process.model_fields_set
        if self.stages:
            filled = completed_stages(self)
            self._as_written = {name: self.__dict__[name] for name in filled}
            self._time_is_found = any(stage.time_is_found for stage in filled["stages"])
            self._damping_is_found = self._time_is_found and not is_damping_given
            self.__dict__.update(filled)  # the scene is frozen for everybody else
            return self
        require_no_stages(self)
        if process.time is not None:
            if process.quasi_static != 1.0:
                raise wrong(
                    f"is {process.quasi_static:g}, but process.time says how slow the process is; "
                    "leave one of them out",
                    field="process.quasi_static",
                )
            return self
        motions = [*(tool.motion for tool in self.tools), *(grip.motion for grip in self.grippers)]
        led = any(motion.kind == PRESCRIBED and not motion.turns for motion in motions)
        reason = why_time_is_needed(self, led)
        if reason is not None:
            raise wrong(f'is missing, and {reason}; give time = "200 ms"', field="process.time")
        stroke = max((getattr(motion, "distance", 0.0) for motion in motions), default=0.0)
        time = max(
            found_time(process, ply.blank.extent, ply.material.build(), stroke)
            for ply in self.stack
        )
        tools = []
        for index, tool in enumerate(self.tools):
            key = f'tools[{index}] "{tool.name}"'
            timed = tool.without_time(time, key=key)
            tools.append(timed.completed(self.contact.friction, time, key=key))
        grippers = []
        for index, gripper in enumerate(self.grippers):
            key = f'grippers[{index}] "{gripper.name}"'
            grippers.append(gripper.without_time(time, key=key).completed(time, key=key))
        filled_in = {"time": time}
        if not is_damping_given:
            filled_in["mass_damping"] = DAMPING_TIMES_TIME / time
        if process.damping_average is None:
            filled_in["damping_average"] = AVERAGING_PART * time
        # the scene is frozen for everybody else
        self.__dict__.update(
            process=process.model_copy(update=filled_in),
            tools=tuple(tools),
            grippers=tuple(grippers),
        )
        self._time_is_found = True
        self._damping_is_found = not is_damping_given
        return self

    @model_validator(mode="after")
    def _switch_effects(self) -> Self:
        """Take effects out of the scene, or into it, before anything reads what it calls for."""
        switched: list[Switched] = []
        before: dict[str, Any] = {}
        settings = settings_of(self)
        is_called = {key: switches()[key].called(self) for key in settings}
        for key, setting in settings.items():
            try:
                changed = changes(self, key, setting)
            except Refusal as refusal:
                reason = str(refusal)
                if setting == "on" and is_called[key]:  # it was there until another went
                    off = " and ".join(f'effects.{one.key} = "off"' for one in switched)
                    reason = f"{off} takes out what it needs; leave one of them out"
                raise wrong(f'is "{setting}", but {reason}', field=f"effects.{key}") from None
            if changed is not None:
                before = {name: self.__dict__[name] for name in changed} | before
                self.__dict__.update(changed)  # the scene is frozen for everybody else
                switched.append(Switched(key, setting))
        self._switched = tuple(switched)
        self._before_switches = before
        return self

    @model_validator(mode="after")
    def _check_scene(self) -> Self:
        check_scene(self)
        return self

    @property
    def wet_forming(self) -> Infiltration | None:
        """The infiltration that goes on while the blank is formed, if there is one."""
        case = self.infiltration
        return None if case is None or case.with_forming is None else case

    @property
    def infiltrations(self) -> dict[str, tuple[Infiltration, MappingTarget | None]]:
        """Infiltrations by the name of their files, each with its mesh, None for the sheet."""
        by_name: dict[str, tuple[Infiltration, MappingTarget | None]] = {}
        if self.infiltration is not None:
            by_name[SHEET_NAME] = self.infiltration, None
        for target in self.mapping:
            if target.infiltration is not None:
                by_name[target.name] = target.infiltration, target
        return by_name
