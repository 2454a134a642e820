"""Benchmarks of shells and solid-shells, linear and with large deformation.

::

    meshes ─▶ patch, linear, large_deformation, semi_cylinder ─▶ result ─▶ table: all of them
"""
