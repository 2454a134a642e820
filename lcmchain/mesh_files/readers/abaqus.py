"""Meshes of Abaqus and CalculiX decks (.inp), with the numbers, sets, sections and instances.

Source: Abaqus Keywords Guide (*NODE, *SYSTEM, *ELEMENT, *NSET, *ELSET, *SURFACE, *PART, *INSTANCE);
CalculiX CrunchiX user's manual, where parts and instances do not exist.
"""

from __future__ import annotations

from pathlib import Path

from lcmchain.errors import InputError
from lcmchain.mesh_files.file_mesh import FileMesh
from lcmchain.mesh_files.readers.abaqus_blocks import Block, keyword_blocks
from lcmchain.mesh_files.readers.abaqus_merge import Deck, merged
from lcmchain.mesh_files.readers.abaqus_numbers import motion
from lcmchain.mesh_files.readers.abaqus_scope import Scope

# Keywords that make nodes or elements out of others: a mesh read without them has holes.
GENERATING = ("NGEN", "NFILL", "NCOPY", "NMAP", "ELGEN", "ELCOPY")

SECTIONS = ("SHELLSECTION", "SHELLGENERALSECTION", "SOLIDSECTION", "MEMBRANESECTION")


def read_abaqus(path: Path) -> FileMesh:
    """Read the mesh of a deck.

    Raises
    ------
    InputError : wrong or incomplete data, a keyword that generates a mesh, or no mesh at all; names
        file and line.
    """
    deck = Deck()
    scope = deck.outside
    open_block: Block | None = None  # of the part or instance that is being read
    for block in keyword_blocks(path):
        if block.keyword in GENERATING:
            raise block.error(
                "is not followed here; export the deck with all its nodes and elements"
            )
        if block.keyword in ("PART", "INSTANCE"):
            if open_block is not None:
                raise block.error(f"begins before *END {open_block.keyword}")
            open_block = block
            scope = _opened(deck, block)
        elif block.keyword in ("ENDPART", "ENDINSTANCE"):
            open_block, scope = None, deck.outside
        else:
            _take(scope, deck, block)
    if open_block is not None:
        raise open_block.error(f"has no *END {open_block.keyword}; the file is cut off")
    mesh = merged(deck)
    if not mesh.blocks and not mesh.left_aside:
        raise InputError("the deck has no *ELEMENT of any kind", file=path)
    return mesh


def _opened(deck: Deck, block: Block) -> Scope:
    """Scope of a part or instance that begins."""
    name = block.name("NAME") if "NAME" in block.parameters else block.name(block.keyword)
    known = deck.parts if block.keyword == "PART" else deck.own
    if name.upper() in known:
        raise block.error(f"{name} exists already")
    if block.keyword == "INSTANCE":
        if "LIBRARY" in block.parameters or "PART" not in block.parameters:
            raise block.error("takes its mesh from another analysis; export the deck with it")
        part = block.name("PART")
        if part.upper() not in deck.parts:
            raise block.error(f"is of the part {part}, which the deck does not define before")
        deck.placed.append((name, part.upper(), *motion(block)))
    known[name.upper()] = scope = Scope(name)
    return scope


def _take(scope: Scope, deck: Deck, block: Block) -> None:
    """Take what belongs to the mesh from a block."""
    if block.keyword == "NODE":
        scope.read_nodes(block)
    elif block.keyword == "SYSTEM":
        scope.read_system(block)
    elif block.keyword == "ELEMENT":
        scope.read_elements(block)
    elif block.keyword in ("NSET", "ELSET"):
        scope.read_set(block)
    elif block.keyword == "SURFACE":
        scope.read_surface(block)
    elif block.keyword in SECTIONS and block.parameters.get("ELSET"):
        scope.sections.append(block.parameters["ELSET"])
