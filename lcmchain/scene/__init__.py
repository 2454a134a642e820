"""Scene files: text with units in, validated and frozen SI scenes out.

::

    scene.toml ─▶ reading ─▶ scene: Scene, all tables put together
                               │
         process, plies, draping, output, structure    the tables named so
         infiltration                                  what flows, from where, through what
         presets                                       published materials, by name
                               │
         stack: the plies with all that each is built from
         stages: what the tables are in each stage; resin_stages: the same on the resin's clock
         completed_stages, checks: what is filled in, and what is refused
         pace: what sets it, and which entry slows it (tables: what such functions ask of a scene)
                               │
         rungs: the same scene on another model level
         cases: commented scenes that ``lcmchain new`` writes

Tables of tools, materials, elements, effects and interfaces stand beside what they configure.
"""

from lcmchain.effects.contact import Contact
from lcmchain.elements.families import KinematicElement
from lcmchain.elements.membrane_shell.table import MembraneShellElement
from lcmchain.elements.solid_shell.table import Element
from lcmchain.materials.fabric import FabricMaterial
from lcmchain.materials.fabric_with_set import FabricWithSetMaterial
from lcmchain.materials.laws import AnyMaterial
from lcmchain.materials.st_venant_kirchhoff import (
    IsotropicMaterial,
    OrthotropicMaterial,
    StiffnessMaterial,
)
from lcmchain.mesh.blank import Blank
from lcmchain.scene.draping import Draping
from lcmchain.scene.infiltration import Infiltration
from lcmchain.scene.infiltration.laws import Permeability
from lcmchain.scene.output import MappingTarget, Output
from lcmchain.scene.process import Process
from lcmchain.scene.reading.json_schema import scene_json_schema
from lcmchain.scene.reading.read import read_scene, scene_from_text
from lcmchain.scene.reading.single_tables import (
    infiltration_from_text,
    read_infiltration,
    read_structure,
    structure_from_text,
)
from lcmchain.scene.rungs import RUNGS, left_out_of, on_rung, rung_of
from lcmchain.scene.scene import Scene, SceneSource
from lcmchain.scene.structure import Structure
from lcmchain.tools.tool import Tool

__all__ = [
    "AnyMaterial",
    "Blank",
    "Contact",
    "Draping",
    "Element",
    "FabricMaterial",
    "FabricWithSetMaterial",
    "Infiltration",
    "IsotropicMaterial",
    "KinematicElement",
    "MappingTarget",
    "MembraneShellElement",
    "OrthotropicMaterial",
    "Output",
    "Permeability",
    "RUNGS",
    "Process",
    "Scene",
    "SceneSource",
    "StiffnessMaterial",
    "Structure",
    "Tool",
    "infiltration_from_text",
    "left_out_of",
    "on_rung",
    "read_infiltration",
    "read_scene",
    "read_structure",
    "rung_of",
    "scene_from_text",
    "scene_json_schema",
    "structure_from_text",
]
