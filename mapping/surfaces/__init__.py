"""The faceted surface of the sheet, and what the cells of a target take from it.

    surface.py       areas, normals, neighbours and sides of the faces
       │ gradients.py  linear fields within the faces
       ▼
    search.py        the closest place of the surface, and the curved surface behind the facets
    intersection.py  overlaps of target cells with faces
       ▼
    pairing.py       which faces a cell takes from, in what shares ─▶ weights of shells
                                                                         ▼
    averages.py      means of scalars, directions and tensors over the cells, with any weights

Weights of solid cells are found in :mod:`lcmchain.mapping.solids`.
"""
