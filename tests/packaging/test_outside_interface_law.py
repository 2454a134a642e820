"""An interface law in a file of the user: added to those of an interface, and never stale."""

from __future__ import annotations

import pytest

LAW = '''
"""Drag between plies that goes with the square of the sliding speed."""

import math
from typing import ClassVar, Literal, NamedTuple

import numpy as np

from lcmchain.elements.vectors import dot, scaled
from lcmchain.interfaces.law import (
    InterfaceLawTable,
    implements,
    parameters,
    respond,
    uses_sliding,
)
from lcmchain.jit import equation


class Drag(NamedTuple):
    """coefficient : (interface_count,) stress over speed² [Pa s²/m²], 0 without a drag."""

    coefficient: np.ndarray

    @staticmethod
    def title():
        return "drag between plies"

    def reason(self):
        return f"up to {self.coefficient.max():g} Pa s²/m²"


@implements(parameters, Drag)
@equation
def drag_parameters(law, interface):
    return (FACTOR * law.coefficient[interface],)


@implements(uses_sliding, Drag)
@equation
def drag_uses_sliding(law):
    return True


@implements(respond, Drag)
@equation
def drag_response(law, values, memory, touch):
    factor = 0.0
    if touch.gap < 1e-5 and touch.time > 0.0:
        speed = math.sqrt(dot(touch.moved, touch.moved)) / touch.time
        factor = -values[0] * touch.area * speed / touch.time
    force = scaled(factor, touch.moved)
    return force, 0.0, 0.0, -dot(force, touch.moved), memory


class DragTable(InterfaceLawTable):
    law: ClassVar[type] = Drag

    type: Literal["drag"] = "drag"
    coefficient: float
    fastest: float

    @classmethod
    def gathered(cls, tables):
        return Drag(np.array([0.0 if t is None else t.coefficient for t in tables]))

    def reach(self):
        return 1e-5

    def slip_viscosity(self):
        return 2.0 * self.coefficient * self.fastest

    def in_words(self):
        return f"drag {self.coefficient:g} Pa s²/m²"
'''
# A point on a facet by hand: the search for facets would take most of the time to compile.
EVALUATE = """
import json, sys
sys.path.insert(0, {tests!r})
from drag import DragTable
from stacks import T, ply, scene_of, stack
from lcmchain.interfaces.forces import LOST, forces_of_points, list_points
from lcmchain.interfaces.rows import AREA, FORCE, NORMAL, REACH, SHARE, WEIGHT, row_start
from lcmchain.interfaces.table import Interface
from lcmchain.tools.span_rows import SPAN, vector_at

between = Interface().with_laws(DragTable(coefficient=50.0, fastest=10.0))
sim = stack([ply("bed", z=0.5 * T), ply("sled", z=1.5 * T)], scene_of(), between)
(data, laws), arrays, dt = sim.model.ply_contact, sim.arrays, 1e-7
point = sim.model.bodies[1].first_node
arrays.velocity[0, point] = {speed}
arrays.ply_facet[point] = sim.model.bodies[0].mesh.element_count  # the first one of its upper face
at = row_start(data, point)
rows = {{WEIGHT: 1.0, NORMAL + 2: 1.0, SHARE: 1.0, AREA: {area}, REACH: 1e-5}}
for row, value in rows.items():
    arrays.ply_rows[at + row * SPAN] = value
list_points(data, arrays)
forces_of_points(data, *laws, arrays, dt)
stats = forces_of_points.for_python.stats
print(json.dumps({{
    "force": vector_at(arrays.ply_rows, FORCE, at),
    "lost": float(arrays.ply_sums[:, LOST].sum() / dt),
    "rate": float(data.sliding_rate),
    "words": between.in_words(),
    "cached": [len(stats.cache_hits), len(stats.cache_misses)],
}}))
"""
AREA, SPEED = 2e-5, 2.0


@pytest.fixture
def evaluate(tmp_path, request, in_new_process):
    """Evaluate the drag on a point that slides, in a fresh process."""
    tests = str(request.config.rootpath / "tests" / "interfaces")

    def call(law):
        code = EVALUATE.format(tests=tests, speed=SPEED, area=AREA)
        (tmp_path / "drag.py").write_text(law, encoding="utf-8")
        return in_new_process(code)

    return call


def test_an_interface_takes_a_law_from_outside_the_package(evaluate):
    found = evaluate(LAW.replace("FACTOR", "1.0"))
    wanted = 50.0 * SPEED**2 * AREA
    assert found["force"] == pytest.approx([-wanted, 0.0, 0.0], rel=1e-9)
    assert found["lost"] == pytest.approx(wanted * SPEED, rel=1e-9)
    assert found["rate"] > 0.0
    assert found["words"] == "drag 50 Pa s²/m²"
    assert found["cached"] == [0, 1]
    # the same file again comes from disk, a changed one does not
    assert evaluate(LAW.replace("FACTOR", "1.0")) == {**found, "cached": [1, 0]}
    changed = evaluate(LAW.replace("FACTOR", "3.0"))
    assert changed["cached"] == [0, 1]
    assert changed["force"][0] == pytest.approx(-3.0 * wanted, rel=1e-9)
