"""The guard between a master and the exporter's library in a unit.

::

    fmi2.c, fmi3.c (guard.h, states.h) ─▶ compile ─▶ fmi2.o, fmi3.o, part of the package
    the exporter's library, object of the guard ─▶ link ─▶ library of the unit
"""
