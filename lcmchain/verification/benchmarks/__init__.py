"""Benchmarks of shells and solid-shells, linear and with large deformation."""
