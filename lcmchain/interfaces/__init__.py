"""Contact between plies: deformable to deformable, with large sliding and meshes that do not match.

``table.py`` is the scene's entry, ``surfaces.py`` what stays constant, ``springs.py`` the geometry
of one point and one facet, ``rims.py`` the share of a point that lies over the other ply,
``search.py`` which facet a point faces, ``forces.py`` what happens in every step, ``refresh.py``
what happens now and then, ``limits.py`` the bound of the step and what stops a run.
"""
