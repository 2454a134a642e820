"""Infiltration: a formed part fills with resin, by Darcy flow with a moving front.

::

    forming.nc, mapped file, mesh ─▶ formed_part ─┐
    [infiltration] of a scene ────────────────────┴▶ setup ─▶ filling ─▶ results ─▶ report
                                                       ▲        │           ├─▶ files
                           cell_permeability, resin ───┘        ▼           └─▶ picture
                                                              flow/

- ``stage`` goes this way from a part and its case to the files: ``fill_part``, and ``map_and_fill``
  where the source has to be mapped before. Its ``FillingRun`` advances the filling, or the mould
  that closes on it, with saved states, histories and checkpoints.
- ``formed_part`` is mesh and fields of what is filled. ``cell_permeability`` says whether resin can
  flow through every cell, and how the permeability follows the compaction.
- ``setup`` finds the places of a case on the mesh. It refuses what cannot be computed and warns of
  what was perhaps not meant.
- ``filling`` is the simulation: a model, its state, and its time steps, which are in
  :mod:`~lcmchain.coupling.infiltration.flow`. It knows nothing of scenes and files.
- ``resin`` and ``resin_temperature`` are the laws of viscosity, cure and temperature.
- ``results`` holds saved states and histories as arrays, ``report`` the same in numbers and words.
- ``foreign_case`` reads cases of RTMsim and LCMsim. ``benchmark`` measures time and memory.
"""
