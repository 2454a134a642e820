"""Scene files: text with units in, validated and frozen SI scenes out."""

from lcmchain.scene.json_schema import scene_json_schema
from lcmchain.scene.read import read_scene, scene_from_text
from lcmchain.scene.scene import (
    Blank,
    Contact,
    Element,
    FabricMaterial,
    IsotropicMaterial,
    MappingTarget,
    Material,
    MembraneShellElement,
    OrthotropicMaterial,
    Output,
    Permeability,
    Process,
    Scene,
    SceneSource,
    StiffnessMaterial,
    Tool,
)

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
