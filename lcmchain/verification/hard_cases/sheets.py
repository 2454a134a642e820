"""Simulations of small sheets for the hard cases: scene text, supports, distorted meshes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from lcmchain.effects.supports import Support
from lcmchain.elements.families import family_of
from lcmchain.fields.derived import derive_fields
from lcmchain.model import assemble_bodies, assemble_model, sheet_of
from lcmchain.scene import scene_from_text
from lcmchain.solver.simulation import Simulation
from lcmchain.tools import build_tool_table
from lcmchain.tools.motion import smooth_step

MD600 = 'preset = "MD600"'
# Where nothing else holds sheets, one support does that holds nothing: the loop of a sheet with
# tools is that of any scene, and all others share one.
HOLDS_NOTHING = (Support("nothing", np.array([0]), components=""),)


def simulation(
    text: str,
    *,
    supports: Callable[[np.ndarray], Sequence[Support]] | None = None,
    shape: Callable[[np.ndarray], np.ndarray] | None = None,
    perturbation: float = 0.0,
    seed: int = 0,
    step_safety: float | None = None,
    **environment: float,
) -> Simulation:
    """Return the simulation of a scene with what a scene file cannot say.

    Parameters
    ----------
    text : of the scene.
    supports : gives them for the reference positions (node_count, 3) [m].
    shape : maps the flat blank's node positions to other reference positions.
    perturbation, seed : of the nodes inside the blank, see :func:`lcmchain.mesh.blank.build_blank`.
    step_safety : replaces the scene's, which must not exceed 1.
    environment : entries of :class:`lcmchain.model.Environment` to replace.
    """
    scene = scene_from_text(text)
    ply = scene.only_ply("a hard case")
    material = ply.material.build()
    blank = ply.build_blank(perturbation=perturbation, seed=seed)
    if shape is not None:
        blank = replace(blank, node_positions=shape(blank.node_positions))
    mesh = family_of(scene.element).mesh_of(blank)
    held: Sequence[Support] = () if scene.tools else HOLDS_NOTHING
    if supports is not None:
        held = supports(mesh.node_positions)
    model = assemble_model(
        mesh,
        material,
        scene.element,
        tools=build_tool_table(
            scene.tools, scene.source.directory, scene.process.time, blank=mesh.node_positions
        ),
        tool_names=tuple(tool.name for tool in scene.tools),
        contact=scene.contact,
        process=scene.process,
        supports=held,
    )
    return Simulation(
        replace(
            model,
            environment=model.environment._replace(**environment),
            step_safety=model.step_safety if step_safety is None else step_safety,
        )
    )


def stack_simulation(
    text: str,
    *,
    supports: Callable[[str, np.ndarray], Sequence[Support]] = lambda name, X: (),
    shape: Callable[[str, np.ndarray], np.ndarray] = lambda name, X: X,
    **contact: Any,
) -> Simulation:
    """Return the simulation of a scene with several plies, with what a scene file cannot say.

    Parameters
    ----------
    text : of the scene.
    supports : gives those of a ply for its name and reference positions (node_count, 3) [m].
    shape : maps the node positions of a ply, by its name, to other reference positions.
    contact : entries of :class:`lcmchain.interfaces.surfaces.InterfaceData` to replace.
    """
    scene = scene_from_text(text)
    sheets, held, first_node = [], [], 0
    for sheet in map(sheet_of, scene.stack):
        X = shape(sheet.name, sheet.mesh.node_positions)
        sheets.append(sheet._replace(mesh=replace(sheet.mesh, node_positions=X)))
        held += [replace(s, nodes=s.nodes + first_node) for s in supports(sheet.name, X)]
        first_node += len(X)
    model = assemble_bodies(
        sheets,
        tools=build_tool_table(scene.tools, scene.source.directory, scene.process.time),
        tool_names=tuple(tool.name for tool in scene.tools),
        contact=scene.contact,
        process=scene.process,
        supports=held or HOLDS_NOTHING,
        interfaces=scene.stack.interfaces(scene.interfaces),
    )
    plies = model.ply_contact
    assert plies is not None
    plies = plies._replace(data=plies.data._replace(**contact))
    return Simulation(replace(model, ply_contact=plies))


def linear_fabric(thickness: float = 1.004, **moduli: float) -> str:
    """Return the entries of a fabric with constant moduli [MPa]; ``thickness`` in mm.

    Given are those of ``moduli``: C11, C12, C33, C13 of the membrane, B11, B12, B33, B13 of the
    bending; 22 equals 11 and 23 equals 13, and the bending equals the membrane where not given.
    Fibres kink freely within the plane: a stiffness against it would hide a shear so soft.
    """
    m = {"C11": 1000.0, "C12": 0.1, "C33": 0.1563, "C13": 0.1, **moduli}
    m = {**{f"B{key[1:]}": m[key] for key in ("C11", "C12", "C33", "C13")}, **m}
    return f"""
law = "fabric"
thickness = "{thickness} mm"
areal_mass = "{600.0 * thickness / 1.004} g/m^2"
fibre_density = "1810 kg/m^3"
membrane = {{ C11 = "{m["C11"]} MPa", C22 = "{m["C11"]} MPa", C23 = "{m["C13"]} MPa", \
C13 = "{m["C13"]} MPa", shear_polynomial = "{m["C12"]} 0 0 0 0 MPa" }}
compaction = {{ c0 = "{m["C33"]} MPa", c1 = 0.0, c2 = 2.0 }}
bending = {{ C11 = "{m["B11"]} MPa", C22 = "{m["B11"]} MPa", C33 = "{m["B33"]} MPa", \
C12 = "{m["B12"]} MPa", C23 = "{m["B13"]} MPa", C13 = "{m["B13"]} MPa", in_plane = 0.0 }}
"""


def smooth(time: float, duration: float) -> float:
    """Return the part of a smooth stroke that is done at ``time``."""
    return float(smooth_step(min(max(time / duration, 0.0), 1.0))[0])


def nodes_at(X: np.ndarray, axis: int, value: float) -> np.ndarray:
    """Return the nodes with this reference coordinate."""
    return np.flatnonzero(np.abs(X[:, axis] - value) < 1e-8)


def outline_nodes(X: np.ndarray) -> np.ndarray:
    """Return the nodes on the outline of a rectangle about the origin, both faces."""
    return np.flatnonzero((np.abs(X[:, :2]) > np.abs(X[:, :2]).max(axis=0) - 1e-8).any(axis=1))


def fields(sim: Simulation) -> dict[str, np.ndarray]:
    """Return the face fields of the present state, each (element_count,)."""
    (body,) = sim.model.bodies
    return derive_fields(body.mesh, body.material, sim.state.position.T)
