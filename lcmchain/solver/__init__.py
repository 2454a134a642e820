"""Explicit time integration: loop, stable time step, energy balance, guards.

::

    Model, State ─▶ simulation ─▶ loop: one step after the other, compiled
                        │           schedule: elements, fibres and nodes in the order of the step
                        │           force_slots: sums of corner forces at the nodes
                        │           contact_forces, ply_contact, pressure_loads, gripper_forces,
                        │           held_nodes, tool_motion: one interaction each
                        ├▶ between chunks of steps: contact_search, bounds of the step,
                        │   guards (with runaway, recovery and remedies: why, and what to do)
                        ├▶ histories, frame_file: what is kept over time
                        └▶ checkpoint: all that a run needs to go on bit for bit

A process in stages goes on from one to the next by ``stages``: plies that are laid down
(``laid_plies``), a stage that ends at rest (``rest``), and a run that begins where a stage of
another one ended (``stage_start``).
"""
