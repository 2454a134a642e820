"""Solid sides of a coupling with a fluid: what deforms under its pressure and drives its volume.

``local`` compacts every cell alone, by ``compaction_law`` under ``closures``; ``stack`` presses
plies on each other (``stack_compaction``, ``inner_faces``); ``explicit`` is the forming simulation
itself, with ``tool_loads`` split into what bears them. ``strip`` is a fluid to verify them with.
"""
