"""Tools given as surface meshes: reading, checking, and their distance field."""
