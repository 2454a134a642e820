"""Forming and infiltration as participants of a coupling through preCICE (version 3).

::

    participant.toml ─▶ case ─▶ run: part, results ─▶ adapter ◀─▶ preCICE

``example`` writes the files of a coupled example.
"""
