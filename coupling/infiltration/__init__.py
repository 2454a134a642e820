"""Infiltration: a formed part fills with resin, by Darcy flow with a moving front.

::

    forming.nc, mapped file, mesh ─▶ formed_part ─┐
    [infiltration] of a scene ────────────────────┴▶ setup ─▶ filling ─▶ results ─▶ report
                                                       ▲        │           ├─▶ files
                           cell_permeability, resin ───┘        ▼           └─▶ picture
                                                              flow/

- ``stage`` is the way from a part and its case to the files: ``fill_part``, and ``map_and_fill``
  where the source has to be mapped first. Its ``FillingRun`` advances the filling, or the mould
  that closes on it, with saved states, histories and checkpoints.
- ``formed_part`` is the mesh and the fields of the part. ``cell_permeability`` checks that resin
  can flow through every cell, and gives the permeability under compaction.
- ``setup`` finds the places of a case on the mesh, refuses wrong cases, and warns of likely
  mistakes.
- ``filling`` is the simulation: a model, its state, and its time steps, which are in
  :mod:`~lcmchain.coupling.infiltration.flow`. It does not depend on scenes and files.
- ``resin`` and ``resin_temperature`` are the laws of viscosity, cure and temperature.
- ``results`` holds saved states and histories as arrays, ``report`` the same in numbers and words.
- ``foreign_case`` reads cases of RTMsim and LCMsim, with their ``foreign_ports``. ``benchmark``
  measures time and memory.
"""
