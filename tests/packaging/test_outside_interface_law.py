"""An interface law in a file of the user: added to those of an interface, and never stale."""

from __future__ import annotations

import pytest

# The line of the script with the law that a changed file has otherwise.
PARAMETERS = "return (law.coefficient[interface],)"
# A point on a facet by hand: the search for facets would take most of the time to compile.
EVALUATE = """
import json, sys
sys.path.insert(0, {tests!r})
from drag import DragTable
from stacks import T, ply, scene_of, stack
from lcmchain.compilation.references import Reference
from lcmchain.interfaces.forces import LOST, forces_of_points, list_points
from lcmchain.interfaces.rows import AREA, FORCE, NORMAL, REACH, SHARE, WEIGHT, row_start
from lcmchain.interfaces.table import Interface
from lcmchain.elements.blocks import SPAN, vector_at

between = Interface().with_laws(DragTable(coefficient=50.0, fastest=10.0))
sim = stack([ply("bed", z=0.5 * T), ply("sled", z=1.5 * T)], scene_of(), between)
data, arrays, dt = sim.model.ply_contact.data, sim.arrays, 1e-7
point = sim.model.bodies[1].first_node
arrays.velocity[0, point] = {speed}
arrays.ply_facet[point] = sim.model.bodies[0].mesh.element_count  # the first one of its upper face
at = row_start(data, point)
rows = {{WEIGHT: 1.0, NORMAL + 2: 1.0, SHARE: 1.0, AREA: {area}, REACH: 1e-5}}
for row, value in rows.items():
    arrays.ply_rows[at + row * SPAN] = value
list_points(data, arrays)
forces_of_points(Reference(sim.model.ply_contact), arrays, dt)
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
def law(request):
    """The script that holds the law."""
    script = request.config.rootpath / "examples" / "scripts" / "own_interface.py"
    text = script.read_text(encoding="utf-8")
    assert text.count(PARAMETERS) == 1
    return text


@pytest.fixture
def evaluate(tmp_path, request, in_new_process):
    """Evaluate the drag on a point that slides, in a fresh process."""
    tests = str(request.config.rootpath / "tests" / "interfaces")

    def call(law):
        code = EVALUATE.format(tests=tests, speed=SPEED, area=AREA)
        (tmp_path / "drag.py").write_text(law, encoding="utf-8")
        return in_new_process(code)

    return call


def test_an_interface_takes_a_law_from_outside_the_package(evaluate, law):
    found = evaluate(law)
    wanted = 50.0 * SPEED**2 * AREA
    assert found["force"] == pytest.approx([-wanted, 0.0, 0.0], rel=1e-9)
    assert found["lost"] == pytest.approx(wanted * SPEED, rel=1e-9)
    assert found["rate"] > 0.0
    assert found["words"] == "drag 50 Pa s²/m²"
    assert found["cached"] == [0, 1]


@pytest.mark.slow
def test_kernels_follow_the_file_of_a_law_between_plies(evaluate, law):
    """As those of a law of the sheet do, by the same key (test_outside_law.py)."""
    found = evaluate(law)
    wanted = 50.0 * SPEED**2 * AREA
    # the same file again comes from disk, a changed one does not
    assert evaluate(law) == {**found, "cached": [1, 0]}
    changed = evaluate(law.replace(PARAMETERS, PARAMETERS.replace("(law", "(3.0 * law")))
    assert changed["cached"] == [0, 1]
    assert changed["force"][0] == pytest.approx(-3.0 * wanted, rel=1e-9)
