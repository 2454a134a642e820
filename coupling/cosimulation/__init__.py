"""Co-simulation master: units of FMI 2.0 and 3.0 as parts of a coupled system.

::

    system.toml ─▶ system_file ─┐
    *.ssp ─▶ ssp/reading ───────┴▶ assembly ─▶ run ─▶ recorder ─▶ netCDF, pictures, summary
                                      │         └──▶ lcmchain.coupling.iteration: schemes, windows
    unit.fmu ─▶ archive ─▶ description┤
                                      └▶ part ─▶ instance: library_instance or process_instance

- ``system_file`` holds the tables of a system; ``ssp`` makes the same of a system of SSP, and back.
- ``archive`` unpacks a unit into a ``temporary_folder``, ``description`` says what it is, with each
  variable and its ``physical_units``.
- ``assembly`` loads the units, sets their ``start_values``, joins them by ``connections`` (those of
  terminals by ``terminal_links``), and initialises them.
- ``part`` is a unit as the coupling sees it, ``instance`` the calls that it needs. A unit runs in
  this process (``library_instance``) or in one of its own (``process_instance``), which may crash
  or hang without taking the master.
- ``run`` goes from the begin to the end, with checkpoints and ``stopping`` by Ctrl-C.
"""
