"""Structural stage."""
