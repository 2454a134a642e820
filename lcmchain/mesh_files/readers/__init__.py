"""Readers of mesh files, one kind of file each; every one returns a ``FileMesh``.

    path ─▶ mesh_files/read ─▶ reader of that format ─▶ FileMesh ─▶ tools, targets, gates, sets
            (format by content)  nodes, cells, numbers, sets, parts, and what was left out

``mesh_files/read.py`` chooses the reader by what the file holds. Here stand

- decks of solvers: ``abaqus.py`` (with ``abaqus_blocks.py``, the deck as text, and
  ``abaqus_scope.py``, one part of it), ``nastran.py`` (``nastran_cards.py``, the deck as text,
  ``nastran_sets.py``), ``lsdyna.py`` (``lsdyna_blocks.py``, the deck as text), ``universal.py``;
  ``decks.py`` is what they share;
- files of meshing programs: ``gmsh.py``, ``netgen.py``, ``med.py``; ``cgns.py`` and ``exodus.py``,
  which with ``med.py`` share ``binary_files.py``;
- surfaces: ``obj.py``, ``ply.py``;
- ``by_meshio.py``: VTU, and every format that has no reader of its own.
"""
