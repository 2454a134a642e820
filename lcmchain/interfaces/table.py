"""The scene's entry ``[[interfaces]]``: how two plies act on each other where they touch."""

from __future__ import annotations

from typing import Annotated, Any, Self

from pydantic import Field, model_validator

from lcmchain.interfaces.law import InterfaceLawTable
from lcmchain.interfaces.laws.adhesion import AdhesionTable
from lcmchain.interfaces.laws.coulomb import FrictionTable
from lcmchain.interfaces.laws.friction_map import FrictionMapTable
from lcmchain.interfaces.laws.hersey import HerseyTable
from lcmchain.interfaces.laws.shear_by_points import ShearByPointsTable
from lcmchain.interfaces.laws.viscous_film import ViscousFilmTable
from lcmchain.quantities.entry_types import (
    AT_WORK,
    AbsentMeans,
    AtWork,
    FrictionCoefficient,
    Name,
    Number,
    Penalty,
    Range,
    Row,
    SceneModel,
    wrong,
)

#: One entry of ``interfaces.laws``.
AnyInterfaceLaw = Annotated[
    FrictionTable
    | FrictionMapTable
    | HerseyTable
    | ViscousFilmTable
    | AdhesionTable
    | ShearByPointsTable,
    Field(discriminator="type"),
]


class Interface(SceneModel):
    """How two plies press and slide on each other where they touch."""

    between: Annotated[
        tuple[Annotated[str, Name("ply_1")], Annotated[str, Name("ply_2")]] | None,
        Row('["ply_1", "ply_2"]', count=2, entries="names", units=False),
        AbsentMeans("all plies that touch"),
    ] = Field(
        default=None,
        description="Two plies, or two materials of [materials] for all plies of theirs.",
    )
    stages: AtWork = Field(default=None, description=AT_WORK)
    itself: bool = Field(
        default=False,
        description="Whether each of these plies also touches itself, where it folds.",
    )
    friction: FrictionCoefficient = Field(
        default=0.0, description="Coulomb friction coefficient; short for a law."
    )
    laws: tuple[AnyInterfaceLaw, ...] = Field(
        default=(), description="What the plies do to each other beside that, added up."
    )
    penalty: Annotated[Penalty | None, AbsentMeans("automatic")] = Field(
        default=None, description="Contact stiffness per area."
    )
    tangential_ratio: Annotated[float, Number(0.5, Range(0.0, 1.0, (0.0,)))] = Field(
        default=0.5, description="Tangential over normal contact stiffness."
    )

    @model_validator(mode="after")
    def _check_laws(self) -> Self:
        kinds = [law.type for law in self.laws]
        for number, law in enumerate(self.laws):
            if kinds.index(law.type) != number:
                raise wrong(f'has "{law.type}" twice; give it once', field="laws")
            problem = law.conflicts()
            if problem is not None:
                raise wrong(f'[{number}] "{law.type}": {problem}', field="laws")
        if self.friction > 0.0 and "coulomb" in kinds:
            raise wrong(
                'is given beside a law "coulomb"; give the coefficient in one place',
                field="friction",
            )
        return self

    def all_laws(self) -> tuple[Any, ...]:
        """Return the tables of all laws, that of ``friction`` among them."""
        if self.friction == 0.0:
            return self.laws
        friction = FrictionTable(friction=self.friction, tangential_ratio=self.tangential_ratio)
        return (friction, *self.laws)

    def with_laws(self, *laws: InterfaceLawTable) -> Interface:
        """Return the interface with further laws, also such of which this package does not know."""
        return self.model_copy(update={"laws": (*self.laws, *laws)})

    def in_words(self) -> str:
        """Say what plies do to each other, for tables."""
        return ", ".join(law.in_words() for law in self.all_laws()) or "frictionless"
