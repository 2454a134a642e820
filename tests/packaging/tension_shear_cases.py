"""The example of a coupling that a user adds: friction at crossings, outside the package."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

import numpy as np
import pytest

from lcmchain.materials.law import evolved_history, history_count, membrane_response

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "tension_shear"


@pytest.fixture(scope="module")
def example():
    """Import a module of the example by its name, as its folder finds it."""
    if not EXAMPLE.is_dir():
        pytest.skip("needs the checkout, not only the tests")
    sys.path.insert(0, str(EXAMPLE))
    yield importlib.import_module
    sys.path.remove(str(EXAMPLE))
    for name in ("law", "pull"):
        sys.modules.pop(name, None)


def path_of(strains, built):
    """Return stresses, tangents and memories along strains (T, 6), from a fabric without a past."""
    history, rows = (0.0,) * history_count(built.law), []
    for E in strains:
        S, C = membrane_response(built.law, tuple(E), history)
        history = evolved_history(built.law, tuple(E), history)
        rows.append((S, C, history))
    S, C, memory = zip(*rows, strict=True)
    return np.array(S), np.array(C), np.array(memory)


def strains_of(tension, shear):
    E = np.zeros((len(shear), 6))
    E[:, 0], E[:, 1], E[:, 3] = tension, 0.5 * np.asarray(tension), shear
    return E


def test_crossings_slide_at_a_limit_that_goes_with_the_tension(example):
    built = example("law").rubbing_md600().build()
    shear = np.concatenate([np.linspace(0.0, 0.5, 400), np.linspace(0.5, -0.2, 400)])
    E = strains_of(1e-3, shear)
    S, C, memory = path_of(E, built)
    plain, tangent = super(type(built), built).stress_and_tangent(E)
    limit = 0.05 * (1e9 * 1e-3 + 1e9 * 0.5e-3)
    assert built.limit(E) == pytest.approx(limit)
    friction = S[:, 3] - plain[:, 3]
    assert friction[200:400] == pytest.approx(limit)
    assert friction[-200:] == pytest.approx(-limit)
    assert friction[10] == pytest.approx(built.law.stiffness * shear[10])
    # the shear does not change the tension, and the step is bound by crossings that hold
    assert S[:, :3] == pytest.approx(plain[:, :3])
    assert C[:, 3] == pytest.approx(tangent[:, 3, 3] + built.law.stiffness)
    # compressed families bear nothing
    loose = path_of(strains_of(-1e-3, shear), built)[0]
    assert loose[:, 3] == pytest.approx(plain[:, 3])


def test_what_is_lost_is_the_work_of_a_closed_loop(example):
    """In tension and shear: the fabric's own law does no work, the crossings lose all of it."""
    built = example("law").rubbing_md600().build()
    turn = np.linspace(0.0, 4.0 * np.pi, 8001)
    E = strains_of(1e-3 * np.sin(0.5 * turn) ** 2, 0.4 * np.sin(turn))
    S, _, memory = path_of(E, built)
    work = np.cumsum(np.sum(0.5 * (S[1:] + S[:-1]) * np.diff(E, axis=0), axis=1))
    energy = np.array(
        [built.membrane_energy(e, m) + built.dissipated_energy(m) for e, m in zip(E, memory)]
    )
    assert work[-1] > 1e3
    assert energy[1:] == pytest.approx(work, rel=1e-3, abs=1e-3 * work[-1])
    assert np.diff(memory[:, 2]).min() > -1e-9 * work[-1]


@pytest.mark.slow
def test_a_stretched_frame_follows_the_closed_form(example):
    """Force along the frame, forth and back, and the energy that a run books as inelastic."""
    run = example("pull").pull(1.001, frames=61)
    known = np.isfinite(run["S12 [MPa]"])
    assert np.count_nonzero(known) > 30
    largest = np.abs(run["closed form [MPa]"]).max()
    off = np.abs(run["S12 [MPa]"] - run["closed form [MPa]"])[known]
    assert off.max() < 0.02 * largest
    assert run["lost [J]"][-1] > 0.0 and run["balance"][-1] < 1e-3 * run["lost [J]"][-1]
