"""Arithmetic on 3-vectors held as tuples, which the compiler keeps in registers."""

from __future__ import annotations

from lcmchain.jit import equation


@equation
def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@equation
def cross(a, b):
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@equation
def scaled(s, a):
    return (s * a[0], s * a[1], s * a[2])


@equation
def combination2(s, a, t, b):
    """Return s a + t b."""
    return (s * a[0] + t * b[0], s * a[1] + t * b[1], s * a[2] + t * b[2])


@equation
def plus(s, a, b):
    """Return s a + b."""
    return (s * a[0] + b[0], s * a[1] + b[1], s * a[2] + b[2])


@equation
def products(a, b):
    """Return the products of the components."""
    return (a[0] * b[0], a[1] * b[1], a[2] * b[2])
