"""Scene files: text with units in, validated and frozen SI scenes out."""

from lcmchain.effects.contact import Contact
from lcmchain.mesh.blank import Blank
from lcmchain.scene.element_tables import Element, MembraneShellElement
from lcmchain.scene.json_schema import scene_json_schema
from lcmchain.scene.mapping_target import MappingTarget
from lcmchain.scene.material_tables import (
    FabricMaterial,
    IsotropicMaterial,
    Material,
    OrthotropicMaterial,
    StiffnessMaterial,
)
from lcmchain.scene.output import Output
from lcmchain.scene.permeability import Permeability
from lcmchain.scene.process import Process
from lcmchain.scene.read import read_scene, scene_from_text
from lcmchain.scene.scene import Scene, SceneSource
from lcmchain.tools.tool import Tool

__all__ = [
    "Blank",
    "Contact",
    "Element",
    "FabricMaterial",
    "IsotropicMaterial",
    "MappingTarget",
    "Material",
    "MembraneShellElement",
    "OrthotropicMaterial",
    "Output",
    "Permeability",
    "Process",
    "Scene",
    "SceneSource",
    "StiffnessMaterial",
    "Tool",
    "read_scene",
    "scene_from_text",
    "scene_json_schema",
]
