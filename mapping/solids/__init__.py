"""Mapping onto solid cells: the sheet as a slab of columns, and what each cell holds of them.

columns.py     the sheet ─▶ a column on every face, as far as its own region reaches
tetrahedra.py  cells and columns ─▶ tetrahedra, and these clipped exactly
   ▼
overlap.py     volumes of cells in columns, each with its own wall of the sheet
skin.py        the outside of the target ─▶ which part of each face has target over it
stack.py       which part of the thickness each ply of a stack takes
   ▼
weights.py     all of it as the weights of a mapping
"""
