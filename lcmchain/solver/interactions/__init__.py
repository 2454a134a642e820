"""What acts on the nodes of bodies within a step: one file for each interaction.

Each file registers for its table what the loop asks of every interaction
(:mod:`lcmchain.effects.interaction`): what is done before and after the nodes move, the forces on a
chunk of nodes, and the bound that it sets to the step. The equations are those of
:mod:`lcmchain.effects`. A further interaction is one more file here::

    tools                  contact_forces (search and forces), tool_motion (their own motion)
    plies                  ply_contact, of lcmchain.interfaces
    pressures              pressure_loads
    grippers, supports     gripper_forces (what pulls), held_nodes (what is held)
"""

from lcmchain.solver.interactions import (
    contact_forces,
    gripper_forces,
    held_nodes,
    ply_contact,
    pressure_loads,
    tool_motion,
)

#: They register what they do when they are imported: without that they would do nothing.
ACTING = (
    contact_forces, gripper_forces, held_nodes, ply_contact, pressure_loads, tool_motion,
)  # fmt: skip
