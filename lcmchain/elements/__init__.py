"""Solid-shell elements: strains, internal forces, hourglass stabilisation."""
