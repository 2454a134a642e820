"""Effects that a scene may or may not need, one file each.

    scene ─▶ [effects] (switches) ─▶ model ─▶ audit: active(model) of every effect ─▶ check, summary
               on, off, auto          │              is it there, and why
                                      ▼
                     loop: interactions act; elements compute their own effects

The head of each effect's file says what it adds, its source, its stability limit, its scene entry
and its fields. Effects that elements or laws compute (bending, shear locking, ...) are only told
here; those that act on nodes hold their physics too (contact, grippers, pressures, ...).

What is no effect of its own: ``effect.py`` (what an effect tells, and what a switch does),
``audit.py`` (the list of all effects), ``switches.py`` (the table ``[effects]``), and
``interaction.py`` (what acts on bodies or between them, as the time loop sees it). Parts of the
pressures: ``face_pressure.py`` with ``regional_pressure.py``, ``pore_pressure.py`` with
``pore_columns.py``; ``pressures.py`` takes them into the loop as one interaction.
"""
