"""What the residuals of a fit say about it."""

import numpy as np
import pytest

from lcmchain.coupons.identification import general_warnings
from lcmchain.coupons.regression import coefficient_of_determination, residual_autocorrelation


def test_autocorrelation_is_that_within_the_specimens():
    """Neighbours of different specimens are no neighbours."""
    residuals = np.array([1.0, 1.0, 1.0, -1.0, -1.0, -1.0])
    one, two = np.zeros(6), np.array([0, 0, 0, 1, 1, 1])
    assert residual_autocorrelation(residuals, one) == pytest.approx((4 - 1) / 6)
    assert residual_autocorrelation(residuals, two) == pytest.approx(4 / 6)
    assert residual_autocorrelation(residuals, np.arange(6)) == 0.0
    assert residual_autocorrelation(0.0 * residuals, one) == 0.0


def test_correlated_residuals_are_told():
    """From twenty points on."""
    smooth, rough = np.repeat([1.0, -1.0], 10), np.tile([1.0, -1.0], 10)
    for residuals, said in ((smooth, True), (rough, False), (smooth[1:], False)):
        found = general_warnings((), residuals, np.zeros(len(residuals)))
        assert any("neighbouring residuals are correlated" in text for text in found) == said


def test_coefficient_of_determination_compares_with_the_mean():
    data = np.array([10.0, 12.0, 14.0])
    assert coefficient_of_determination(data, data) == 1.0
    assert coefficient_of_determination(data, np.full(3, 12.0)) == 0.0
    assert coefficient_of_determination(data, data + [1.0, 0.0, -1.0]) == pytest.approx(0.75)
    assert np.isnan(coefficient_of_determination(np.ones(3), data))
