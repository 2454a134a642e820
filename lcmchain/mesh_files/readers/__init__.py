"""Readers of mesh files, one kind of file each; every one returns a ``FileMesh``.

    path ─▶ mesh_files/read ─▶ reader of that format ─▶ FileMesh ─▶ tools, targets, gates, sets
            (format by content)  nodes, cells, numbers, sets, parts, and what was left out

``mesh_files/read.py`` chooses the reader by what the file holds. Here stand

- ``decks``: text decks of solvers;
- files of meshing programs: ``gmsh.py``, ``netgen.py``, ``med.py``, ``cgns.py``, ``exodus.py``;
- ``facets.py``: surfaces in OBJ and PLY files;
- ``by_meshio.py``: VTU, and every format that has no reader of its own.
"""
