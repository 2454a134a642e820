"""Exponential and logarithm as straight-line code.

The lane loop of the element kernel holds no call: a libm call would keep it scalar. Both functions
are accurate to about 2 units in the last place over the range stated, with the argument reduction
of Cody and Waite and a polynomial for the rest.
"""

from __future__ import annotations

import numpy as np

from lcmchain.jit import strict_equation

LOG2_E = 1.4426950408889634
LN2_HIGH = 6.93147180369123816490e-01
LN2_LOW = 1.90821492927058770002e-10
EXPONENT_OF_ONE = np.int64(0x3FF0000000000000)
# Adding 1.5 * 2**52 leaves a small integer in the low bits of the sum: a conversion between
# floating point and integer that every vector instruction set has.
ROUND_TO_INTEGER = 6755399441055744.0
ROUND_BITS = np.int64(0x4338000000000000)
# bits of sqrt(1/2): mantissas are brought to [sqrt(1/2), sqrt(2))
SQRT_HALF_BITS = np.int64(0x3FE6A09E667F3BCD)


@strict_equation
def exponential(x):
    """Return exp(x) for -700 < x < 700."""
    shifted = x * LOG2_E + ROUND_TO_INTEGER
    k = shifted - ROUND_TO_INTEGER
    r = (x - k * LN2_HIGH) - k * LN2_LOW
    # Taylor polynomial of degree 13 on |r| < ln(2)/2: remainder below 5e-18.
    p = 1.0 / 6227020800.0
    p = p * r + 1.0 / 479001600.0
    p = p * r + 1.0 / 39916800.0
    p = p * r + 1.0 / 3628800.0
    p = p * r + 1.0 / 362880.0
    p = p * r + 1.0 / 40320.0
    p = p * r + 1.0 / 5040.0
    p = p * r + 1.0 / 720.0
    p = p * r + 1.0 / 120.0
    p = p * r + 1.0 / 24.0
    p = p * r + 1.0 / 6.0
    p = p * r + 0.5
    p = (p * r) * r + r
    bits = (np.float64(shifted).view(np.int64) << np.int64(52)) + EXPONENT_OF_ONE
    return np.int64(bits).view(np.float64) * (1.0 + p)


@strict_equation
def logarithm(x):
    """Return log(x) for normal positive x."""
    bits = np.float64(x).view(np.int64)
    exponent = (bits - SQRT_HALF_BITS) >> np.int64(52)
    m = np.int64(bits - (exponent << np.int64(52))).view(np.float64)
    # log(m) = 2 atanh(s), |s| < 0.172: the odd series to s^23 has a remainder below 1e-19.
    s = (m - 1.0) / (m + 1.0)
    z = s * s
    p = 1.0 / 23.0
    p = p * z + 1.0 / 21.0
    p = p * z + 1.0 / 19.0
    p = p * z + 1.0 / 17.0
    p = p * z + 1.0 / 15.0
    p = p * z + 1.0 / 13.0
    p = p * z + 1.0 / 11.0
    p = p * z + 1.0 / 9.0
    p = p * z + 1.0 / 7.0
    p = p * z + 1.0 / 5.0
    p = p * z + 1.0 / 3.0
    k = np.int64(exponent + ROUND_BITS).view(np.float64) - ROUND_TO_INTEGER
    return k * LN2_HIGH + (2.0 * s + (2.0 * s * z * p + k * LN2_LOW))
