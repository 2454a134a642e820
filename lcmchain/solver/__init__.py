"""Explicit time integration: loop, stable time step, energy balance, guards."""
