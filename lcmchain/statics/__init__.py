"""Quasi-static equilibrium of a sheet: Newton's method, arc length, linear analyses."""
