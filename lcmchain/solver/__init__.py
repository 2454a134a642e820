"""Explicit time integration: loop, stable time step, energy balance, guards.

::

    Model, State ─▶ simulation ─▶ loop: one step after the other, compiled
                        │           schedule: elements, fibres and nodes in the order of the step
                        │           interactions: tools, plies, pressures, grippers, supports
                        ├▶ between chunks of steps: bounds of the step, search of contact,
                        │   guards (with remedies: why, and what to do), and recovery: one try
                        │   with half the step
                        ├▶ histories: what is kept over time
                        └▶ checkpoint: all that a run needs to go on bit for bit

A process in stages goes on from one to the next by ``stages``, with plies that are laid down. A
stage may end at rest (``rest``), and a run may begin where a stage of another one ended
(``stage_start``). The first run on a machine compiles its loops in two processes
(``compile_beside``).
"""
