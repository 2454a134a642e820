"""Tools given as surface meshes.

    file ─▶ reading ─▶ welded triangles ─▶ orientation ─▶ (union) ─▶ Surface ─▶ distance_field
                                        (normals into free space)      └▶ triangle_distance (exact)

Files are named after these steps; ``surface.py`` has the triangles and their edges.
"""
