"""Meshes of the sheet: the blank inside its outline, and what is read off a mesh.

    outline, holes, seams ─▶ contours ─▶ lattice ─▶ cut ─▶ blank ─▶ solid elements
     (scene, or drawing)                 (tries)    (seams)       └▶ mid_surface (faces, triangles)

How a blank is meshed:

- ``outline.py``: what an outline must not do; ``contours.py``: rim, holes, darts and slits;
  ``drawing.py``: the same from a DXF file.
- ``lattice.py``: the lattice along the fibres, its best position, and the numbering.
- ``cut.py``: cells at the outline; ``seams.py``: cells that darts, slits and narrow holes part, up
  to their tips; ``cells.py``: how good cells are, and what step they leave.
- ``blank.py``: the scene table of a blank, and its mesh of solid elements; ``courses.py``: strips
  side by side, each meshed as a blank.

What is asked of meshes:

- ``sheet_mesh.py``: what every mesh of a sheet answers, and the fibres of a deformed one;
  ``mid_surface.py``: meshes without a thickness; ``hexahedron.py``: corners and modes of the
  solid-shell, and how a sheet of them bends.
- ``places.py``: places that a scene names; ``lines.py``: along fibres and rim, and cuts by a plane;
  ``search.py``: closest points and boxes, for contact, tools and mapping.
"""
