"""Infiltration of a textile on its surface mesh: Darcy flow with a moving front."""
