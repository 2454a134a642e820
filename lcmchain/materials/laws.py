"""The material laws that a scene can choose, by ``law``: one table each, in the law's own file.

The module also offers the twins of laws that are made on demand: a process that takes a compiled
kernel from disk looks their classes up here, by name (:data:`lcmchain.materials.twins.HOME`).
"""

from __future__ import annotations

from typing import Annotated, Any, get_args

from pydantic import Field

from lcmchain.materials.fabric import FabricMaterial
from lcmchain.materials.fabric_with_set import FabricWithSetMaterial
from lcmchain.materials.fibre_families import FibreFamiliesMaterial
from lcmchain.materials.neo_hooke import NeoHookeMaterial
from lcmchain.materials.ogden import OgdenMaterial
from lcmchain.materials.st_venant_kirchhoff import (
    IsotropicMaterial,
    OrthotropicMaterial,
    StiffnessMaterial,
)
from lcmchain.materials.table import MaterialTable
from lcmchain.materials.twins import twin_named

#: The table ``[material]``.
AnyMaterial = Annotated[
    FabricMaterial
    | FabricWithSetMaterial
    | FibreFamiliesMaterial
    | IsotropicMaterial
    | OrthotropicMaterial
    | StiffnessMaterial
    | NeoHookeMaterial
    | OgdenMaterial,
    Field(discriminator="law"),
]

TABLES: tuple[type[MaterialTable], ...] = get_args(get_args(AnyMaterial)[0])


def __getattr__(name: str) -> Any:
    """Return a twin by its name."""
    return twin_named(name)
