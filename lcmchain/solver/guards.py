"""Guards of a run: what stops it, and in which words."""

from __future__ import annotations

import numpy as np

from lcmchain.errors import SimulationError
from lcmchain.model import Model
from lcmchain.state import EXTERNAL, KINETIC, WORK_COLUMNS, State

# Below this fraction of its initial thickness an element counts as collapsed; a textile does so
# where it would hold more fibre than space (MD600: 0.33).
COLLAPSED_STRETCH = 0.05
# Deeper in a tool than this part of its thickness, the sheet is not where the tools hold it.
DEEPEST_PENETRATION = 0.15

# Below this fraction of its initial area a triangle counts as collapsed: the fibres are sheared to
# within 3 degrees of each other.
COLLAPSED_AREA = 0.05

# Energy that may appear from nowhere, relative to the external work, before a run is called
# unstable; the floor is the strain energy of a strain of 1e-4 over the whole sheet.
RUNAWAY_FRACTION = 0.1
# Hourglass energy over strain energy: sound runs stay below 0.04 (examples); where 10 mm elements
# jam on a fillet of 10 mm it passes 0.25 and the punch force is five times too high.
LARGEST_HOURGLASS_PART = 0.15
# A sheet counts as loaded where its strain energy is that of a strain of 5e-4 over all of it.
LOADED = 25.0
FLOOR_STRAIN = 1e-4


def require_finite(model: Model, state: State) -> None:
    """Stop where a node has no finite position or velocity."""
    finite = np.isfinite(state.position).all(axis=0) & np.isfinite(state.velocity).all(axis=0)
    if finite.all():
        return
    node = int(np.flatnonzero(~finite)[0])
    element = int(np.flatnonzero((model.blank.elements == node).any(axis=1))[0])
    raise SimulationError(
        f"a position or velocity is not a number at node {node} (element {element}, initially at "
        f"{_millimetres(model.blank.node_positions[node])}) at {_when(state)}. Likely cause: the "
        "step is too large for the contact stiffness or for the material; lower "
        "process.step_safety or contact.penalty"
    )


def require_upright(model: Model, state: State, stretch: np.ndarray) -> None:
    """Stop where an element is inverted or collapsed through the thickness."""
    worst = int(np.argmin(stretch))
    if stretch[worst] > collapsed_stretch(model.material):
        return
    centre = state.position[:, model.blank.elements[worst]].mean(axis=1)
    what = "inverted" if stretch[worst] <= 0.0 else "collapsed"
    if model.elements.director is not None:
        cause = (
            'compaction_strain = "director" measures the length of the director: under a pressure '
            "above the transverse shear stiffness the director tilts instead of shortening and the "
            'element folds over; use element.compaction_strain = "normal"'
        )
    else:
        tools = [
            name
            for name, near in zip(model.tool_names, state.near, strict=True)
            if near[model.blank.elements[worst]].any()
        ]
        cause = (
            f"it is squeezed between tools ({', '.join(tools)}); check their gap and stroke"
            if len(tools) > 1
            else "the sheet folds on itself or the mesh cannot resolve the tool; use a smaller "
            "blank.edge_length or a larger radius"
        )
    raise SimulationError(
        f"element {worst} is {what} (thickness {stretch[worst]:.3f} of the initial one) at "
        f"{_millimetres(centre)} at {_when(state)}. Likely cause: {cause}"
    )


def collapsed_stretch(material) -> float:
    """Return the thickness over its initial value at which an element counts as collapsed."""
    if material.fibre_density is None:
        return COLLAPSED_STRETCH
    fraction = material.areal_mass / (material.fibre_density * material.thickness)
    return max(COLLAPSED_STRETCH, fraction)


def require_outside(model: Model, state: State) -> None:
    """Stop where the sheet has sunk into a tool: more pressure than the contact can carry."""
    limit = DEEPEST_PENETRATION * model.material.thickness
    if not (state.penetration_max > limit).any():
        return
    tool = int(np.argmax(state.penetration_max))
    depth = 1e3 * state.penetration_max[tool]
    raise SimulationError(
        f"nodes are {depth:.3f} mm inside {model.tool_names[tool]} at {_when(state)}, more than "
        f"{DEEPEST_PENETRATION:g} of the thickness of the sheet. Likely cause: too much pressure "
        f"for a contact stiffness of {1e-9 * model.environment.penalty:.3g} N/mm^3; check gap and "
        "stroke of the tools, or raise contact.penalty"
    )


def require_area(model: Model, state: State, area_ratio: np.ndarray) -> None:
    """Stop where a triangle has lost its area."""
    worst = int(np.argmin(area_ratio))
    if area_ratio[worst] > COLLAPSED_AREA:
        return
    centre = state.position[:, model.blank.elements[worst]].mean(axis=1)
    raise SimulationError(
        f"triangle {worst} is collapsed (area {area_ratio[worst]:.3f} of the initial one) at "
        f"{_millimetres(centre)} at {_when(state)}. Likely cause: the sheet is sheared beyond 87 "
        "degrees, or the mesh cannot resolve the tool; use a smaller blank.edge_length or a larger "
        "radius"
    )


def require_passive(model: Model, state: State) -> None:
    """Stop where motion and dissipation have taken more energy than was put in."""
    taken = float(np.sum(state.work[:WORK_COLUMNS]) - state.work[EXTERNAL])
    surplus = taken - float(state.work[EXTERNAL])
    limit = RUNAWAY_FRACTION * abs(float(state.work[EXTERNAL])) + energy_floor(model)
    if surplus <= limit:
        return
    fastest = int(np.argmax(np.sum(state.velocity**2, axis=0)))
    element = int(np.flatnonzero((model.blank.elements == fastest).any(axis=1))[0])
    raise SimulationError(
        f"the energy balance runs away at {_when(state)}: kinetic energy "
        f"{state.work[KINETIC]:.3g} J and dissipation exceed the external work "
        f"{state.work[EXTERNAL]:.3g} J by {surplus:.3g} J. The fastest node is {fastest} (element "
        f"{element}) at {_millimetres(state.position[:, fastest])}. Likely cause: an unstable time "
        "step; lower process.step_safety or contact.penalty"
    )


def require_resolved(model: Model, state: State, energy: dict[str, float]) -> None:
    """Stop where the hourglass terms carry the sheet: its elements cannot follow the tools.

    At the first touch of a tool, while the sheet is hardly strained or moves more than it is
    strained, the ratio says nothing; nor does it for directors that tilt, which
    :func:`require_upright` names.
    """
    if energy["internal"] <= max(energy["kinetic"], LOADED * energy_floor(model)):
        return
    part = energy["hourglass"] / energy["internal"]
    if part <= LARGEST_HOURGLASS_PART or model.elements.director is not None:
        return
    edge = 1e3 * float(np.sqrt(np.median(model.blank.element_areas)))
    raise SimulationError(
        f"the hourglass energy is {part:.0%} of the strain energy at {_when(state)}, more than "
        f"{LARGEST_HOURGLASS_PART:.0%}: forces and shape cannot be trusted. Likely cause: elements "
        f"of {edge:.3g} mm are too coarse for the radii of the tools; use a smaller "
        "blank.edge_length"
    )


def energy_floor(model: Model) -> float:
    """Return the energy [J] below which a balance says nothing."""
    C = model.material.stress_and_tangent(np.zeros(6))[1]
    stiffness = max(C[0, 0], C[1, 1])
    return 0.5 * stiffness * FLOOR_STRAIN**2 * model.volume


def _when(state: State) -> str:
    return f"{1e3 * state.time:.4f} ms (step {state.step_count})"


def _millimetres(point) -> str:
    x, y, z = (1e3 * float(c) for c in point)
    return f"({x:.2f}, {y:.2f}, {z:.2f}) mm"
