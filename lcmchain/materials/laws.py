"""The material laws that a scene can choose, by ``law``: one table each, in the law's own file."""

from __future__ import annotations

from functools import reduce
from operator import or_
from typing import Annotated

from pydantic import Field

from lcmchain.materials.fabric import FabricMaterial
from lcmchain.materials.fabric_with_set import FabricWithSetMaterial
from lcmchain.materials.st_venant_kirchhoff import (
    IsotropicMaterial,
    OrthotropicMaterial,
    StiffnessMaterial,
)

TABLES = (
    FabricMaterial,
    FabricWithSetMaterial,
    IsotropicMaterial,
    OrthotropicMaterial,
    StiffnessMaterial,
)

#: The table ``[material]``.
AnyMaterial = Annotated[reduce(or_, TABLES), Field(discriminator="law")]
