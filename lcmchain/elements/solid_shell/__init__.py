"""The solid-shell element Q1STs for textiles: equations, kernels, reference element."""
