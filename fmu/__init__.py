"""Functional mock-up units of the stages, for co-simulation by FMI 2.0 and 3.0.

Built, on the machine of the engineer:

    scene ─▶ build.py ─┬▶ description.py: what the unit says of itself
                       ├▶ library/: the exporter's library with the guard
                       ├▶ icons.py; mesh_fields.py: where its fields lie
                       └▶ entry_fmi2.py, entry_fmi3.py, entry_environment.py, copied into the unit

Run, in the process of a master:

    master ─▶ library ─▶ entry file ─▶ fmi2.py or fmi3.py ─▶ unit.py (Unit) ─▶ part.py (Part)
                                                               │                  ▲
                                        conduct.py: statuses,  │     forming/, infiltration/:
                                        messages, Ctrl-C ◀─────┤     the physics, their variables
                                        variables.py ◀─────────┘

instances.py opens a unit from the folder of its resources. doctor/ examines units of anyone, and
benchmark.py says what a unit costs in a master. Entry files in units that were built earlier import
fmi2.UnitSlave2 and fmi3.UnitSlave3 by these names.
"""
