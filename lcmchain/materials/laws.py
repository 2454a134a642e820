"""The material laws that a scene can choose, by ``law``: one table each, in the law's own file."""

from __future__ import annotations

from typing import Annotated, get_args

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
