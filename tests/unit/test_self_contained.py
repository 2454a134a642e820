"""Compiled code holds its own copies of what it calls, whatever else the process has compiled."""

import re

import numpy as np
from numba import njit

import lcmchain.jit  # noqa: F401  # sets how numba links


def test_copies_of_functions_are_private():
    @njit(fastmath={"contract", "reassoc"})
    def total(values):
        result = 0.0
        for value in values:
            result += value * value
        return result

    @njit
    def mean(values, others):
        return (total(values) + total(others)) / values.size

    values = np.linspace(0.0, 1.0, 7)
    assert mean(values, values) == 2.0 * total(values) / 7
    (code,) = mean.inspect_llvm().values()
    shared = re.findall(r"^define linkonce_odr [^@]*@(\S+)\(", code, re.M)
    assert all(name.strip('"').startswith(("NRT_", "nrt_")) for name in shared)
    assert "define" in code and "total" in code
