"""Darcy flow with a moving front."""
