"""Random solid-shell elements and materials for the element tests."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from lcmchain.verification import random_elements


@pytest.fixture(scope="session")
def make():
    """The makers of :mod:`lcmchain.verification.random_elements`."""
    makers = {name: value for name, value in vars(random_elements).items() if callable(value)}
    return SimpleNamespace(cube=random_elements.CUBE, **makers)
