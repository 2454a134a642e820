"""A law in a file of the user: found by its type, and never taken for an older one."""

from __future__ import annotations

import pytest

LAW = '''
from typing import NamedTuple

from lcmchain.jit import equation
from lcmchain.materials.law import bending_stiffness, implements, membrane_response


class Spring(NamedTuple):
    """One modulus for every strain [Pa]."""

    modulus: float


@implements(membrane_response, Spring)
@equation
def response(law, E, history):
    k = FACTOR * law.modulus
    return (k * E[0], k * E[1], k * E[2], k * E[3], k * E[4], k * E[5]), (k, k, k, k, k, k)


@implements(bending_stiffness, Spring)
@equation
def bending(law):
    k = law.modulus
    return (k, k, k, k, k, k)
'''
EVALUATE = """
import json
import numpy as np
{import_law}
# the kernel that is compiled fastest of those that ask a law
from lcmchain.elements.solid_shell.pressure import _stress33 as stress_across
from lcmchain.elements.solid_shell.reference import ElementOptions
from lcmchain.verification import random_elements as make

material = make.md600()
if {use_law}:
    material.law = Spring(1e6)
X = make.CUBE * np.array([2.5e-3, 2.5e-3, 0.5e-3])
model = make.separate_elements(X[None], np.array([[1.0, 0.0, 0.0]]), material, ElementOptions())
data = model.only_body().data
strain, stress = np.tile([0.0, 0.0, 0.01, 0.0, 0.0, 0.0], (16, 1)), np.empty(16)
stress_across(data.law, data.options, strain, np.empty(0), stress)
stats = stress_across.stats
print(json.dumps([float(stress[0]), len(stats.cache_hits), len(stats.cache_misses)]))
"""


@pytest.fixture
def evaluate(tmp_path, in_new_process):
    """Evaluate a stress in a fresh process: (stress, cache hits, cache misses)."""

    def call(law=None):
        code = EVALUATE.format(
            import_law="from spring import Spring" if law else "", use_law=law is not None
        )
        if law:
            (tmp_path / "spring.py").write_text(law, encoding="utf-8")
        return in_new_process(code)

    return call


def test_kernels_follow_the_file_of_a_law_outside_the_package(evaluate):
    own, _, misses = evaluate()
    assert misses == 1
    # a run without the law must not need its file to read the cache, before and after
    stress, _, misses = evaluate(LAW.replace("FACTOR", "1.0"))
    assert misses == 1 and stress == pytest.approx(1e4, rel=1e-9) != own
    assert evaluate(LAW.replace("FACTOR", "1.0")) == [stress, 1, 0]
    changed, _, misses = evaluate(LAW.replace("FACTOR", "3.0"))
    assert misses == 1 and changed == pytest.approx(3.0 * stress, rel=1e-9)
    assert evaluate() == [own, 1, 0]
