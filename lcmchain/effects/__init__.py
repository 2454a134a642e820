"""Effects that a scene may or may not need, one file each.

    scene ─▶ [effects]: on, off, auto ─▶ model ─▶ active(model) of every effect ─▶ check, summary
                                           │           is it there, and why
                                           ▼
                     loop: interactions act; elements compute their own effects

The head of each effect's file says what it adds, its source, its stability limit, its scene entry
and its fields.

- **What acts on the nodes**, in this folder: ``contact``, ``contact_depth`` and ``friction`` of
  tools, ``ply_contact``, ``face_pressure``, ``pore_pressure``, ``supports``, ``grippers``,
  ``gravity``, ``fibre_bending`` (of the fibres within the plane).
- **What laws and elements compute**: the folder ``sheet``, whose files only tell of it.
- **How the process goes**: the folder ``process`` (motion of the tools, pace, damping, a longer
  step).

No effects: ``effect`` (what an effect tells, and what a switch does), ``switches`` (the list of all
effects, and the table ``[effects]``), ``interaction`` (what acts on bodies or between them, as the
time loop sees it), ``pressures`` (those in and on a sheet as one interaction).
"""
