"""Forming and infiltration at once: wet compression moulding, brought to agree in time windows."""
