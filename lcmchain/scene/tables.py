"""The tables of a scene, for functions that go through several of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol, Self

from lcmchain.effects.contact import Contact
from lcmchain.effects.face_pressure import PressureOnFace
from lcmchain.effects.grippers import Gripper
from lcmchain.effects.switches import EffectSettings
from lcmchain.scene.draping import Draping
from lcmchain.scene.infiltration import Infiltration
from lcmchain.scene.infiltration.laws import Permeability
from lcmchain.scene.output import MappingTarget, Output
from lcmchain.scene.process import Stage
from lcmchain.scene.stack import PlyTables, Stack
from lcmchain.tools.tool import Tool


class SceneTables(PlyTables, Protocol):
    """What these functions ask of :class:`lcmchain.scene.Scene`, which is built on them."""

    @property
    def stack(self) -> Stack: ...
    @property
    def stages(self) -> tuple[Stage, ...]: ...
    @property
    def tools(self) -> tuple[Tool, ...]: ...
    @property
    def grippers(self) -> tuple[Gripper, ...]: ...
    @property
    def pressure(self) -> tuple[PressureOnFace, ...]: ...
    @property
    def contact(self) -> Contact: ...
    @property
    def effects(self) -> EffectSettings: ...
    @property
    def draping(self) -> Draping: ...
    @property
    def output(self) -> Output: ...
    @property
    def mapping(self) -> tuple[MappingTarget, ...]: ...
    @property
    def permeability(self) -> Permeability | None: ...
    @property
    def infiltration(self) -> Infiltration | None: ...
    @property
    def wet_forming(self) -> Infiltration | None: ...
    @property
    def time_is_found(self) -> bool: ...
    @property
    def history_interval(self) -> float: ...

    def model_copy(self, *, update: Mapping[str, Any] | None = None) -> Self: ...
