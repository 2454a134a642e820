"""Tools given as surface meshes.

    file ─▶ reading ─▶ welded triangles ─▶ solids ─▶ Surface ─┬─▶ distance_field
                        (normals into free space, union)      └─▶ triangle_distance (exact)

Files are named after these steps; ``surface.py`` has the triangles and their edges.
"""
