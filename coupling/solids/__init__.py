"""Solid sides of a coupling with a fluid: they deform under its pressure and change its volume.

::

    material ─▶ compaction_law ─▶ stack_compaction ─▶ local ◀── closures: bag, gap, press
    scene ─▶ simulation ─▶ explicit, stack ─▶ tool_loads

- ``local`` compacts every cell alone: a law of compaction bears what a closure presses with.
  ``compaction_law`` is that of one textile, ``stack_compaction`` that of plies on each other and of
  a formed part.
- ``explicit`` is the forming simulation of a sheet, ``stack`` that of several plies.
- ``tool_loads`` splits the forces of tools into those of fibres, fluid and friction.
"""
