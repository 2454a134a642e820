"""The fibre volume fraction stops a run where it passes 1, whether by shear or by compaction."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest

from lcmchain.effects.supports import Support
from lcmchain.errors import SimulationError
from lcmchain.fields.derived import derive_fields
from lcmchain.model import assemble_model, build_model
from lcmchain.scene import scene_from_text
from lcmchain.solver.simulation import Simulation
from lcmchain.verification.hard_cases.sheets import linear_fabric, outline_nodes, simulation

INITIAL = 0.6 / (1810.0 * 1.004e-3)
SCENE = """
title = "patch"
process = { time = "20 ms", frames = 2 }
material = { preset = "MD600" }
blank = { size = ["40 mm", "40 mm"], edge_length = "10 mm", height = "0.502 mm" }
"""
TWO_D = SCENE.replace("[material]", "").replace("blank", 'element = "membrane-shell"\nblank')


def deformation(angle=0.0, thickness=1.0):
    """Fibres along x and y closed by ``angle`` [rad], neither stretched; and compaction."""
    c, s = math.cos(0.5 * angle), math.sin(0.5 * angle)
    return np.array([[c, s, 0.0], [s, c, 0.0], [0.0, 0.0, thickness]])


def deformed(sim, *arguments):
    sim.state.position[:] = deformation(*arguments) @ sim.model.node_positions.T
    return sim


def solid():
    return Simulation.from_scene(scene_from_text(SCENE))


def triangles():
    return Simulation.from_scene(scene_from_text(TWO_D))


def test_it_is_the_field_of_the_results():
    """On a curved, unevenly thick sheet after a random deformation."""
    rng = np.random.default_rng(3)
    flat = build_model(scene_from_text(SCENE))
    X = flat.node_positions + rng.uniform(-1.0, 1.0, (flat.node_count, 3)) * [1e-3, 1e-3, 5e-5]
    X[:, 2] += 20.0 * X[:, 0] ** 2
    mesh = type(flat.only_body().mesh)(
        X,
        flat.only_body().mesh.elements,
        flat.only_body().mesh.fibre_direction_1,
        flat.only_body().mesh.fibre_direction_2,
        1.004e-3,
    )
    sim = Simulation(
        assemble_model(
            mesh, flat.only_body().material, scene_from_text(SCENE).element, tools=flat.tools,
            tool_names=(), contact=scene_from_text(SCENE).contact,
            process=scene_from_text(SCENE).process,
        )
    )  # fmt: skip
    x = X @ deformation(0.9, 0.8).T + rng.uniform(-1.0, 1.0, X.shape) * [5e-4, 5e-4, 5e-5]
    body = sim.model.only_body()
    positions, history = np.ascontiguousarray(x.T), body.no_history()
    body.renew(positions, history)
    fraction = body.fibre_volume_fraction(body.condition(positions, history))
    field = derive_fields(mesh, flat.only_body().material, x)["fibre_volume_fraction"]
    assert np.ptp(field) > 0.1
    np.testing.assert_allclose(fraction, field, rtol=1e-10)


def test_triangles_keep_their_thickness():
    sim = deformed(triangles(), 0.8)
    body = sim.model.only_body()
    fraction = body.fibre_volume_fraction(
        body.condition(sim.state.position, sim.model.history_of(body, sim.state.history))
    )
    areal = derive_fields(body.mesh, body.material, sim.state.position.T)["areal_fibre_mass"]
    np.testing.assert_allclose(fraction, areal / (1810.0 * 1.004e-3), rtol=1e-12)
    np.testing.assert_allclose(fraction, INITIAL / math.cos(0.8), rtol=1e-12)


# shear angle, thickness stretch: λ cos γ just above and just below the initial fraction 0.330
@pytest.mark.parametrize(
    ("angle", "thickness", "cause"),
    [
        (70.5, 1.0, ""),
        (71.0, 1.0, "sheared further than the fabric bears"),
        (60.0, 0.67, ""),
        (60.0, 0.65, "sheared further"),
        (30.0, 0.39, ""),
        (30.0, 0.375, "mesh cannot resolve the tool"),
        (0.0, 0.325, "mesh cannot resolve the tool"),
    ],
)
def test_a_run_stops_above_one_and_names_what_contributes_most(angle, thickness, cause):
    sim = deformed(solid(), math.radians(angle), thickness)
    if not cause:
        sim.require_sound()
        return
    with pytest.raises(SimulationError, match=f"Likely cause: .*{cause}") as caught:
        sim.require_sound()
    found = re.search(
        r"element (\d+) is collapsed: its fibre volume fraction is ([\d.]+), more fibre than space "
        r"\(thickness ([\d.]+) of the initial one, area ([\d.]+) of the initial one, shear angle "
        r"([\d.]+) deg\) at \(.* mm at 0\.0000 ms \(step 0\)",
        str(caught.value),
    )
    told = [float(text) for text in found.groups()[1:]]
    cosine = math.cos(math.radians(angle))
    expected = [INITIAL / thickness / cosine, thickness, cosine, angle]
    assert told == pytest.approx(expected, abs=0.051)


def test_triangles_stop_as_well():
    deformed(triangles(), math.radians(70.0)).require_sound()
    with pytest.raises(SimulationError, match=r"triangle \d+ is collapsed: .* 1\.041, .*initial "):
        deformed(triangles(), math.radians(71.5)).require_sound()


def test_a_law_without_fibres_may_be_sheared_on():
    material = """{ law = "isotropic", young_modulus = "1 GPa", poisson_ratio = 0.3,
        density = "1000 kg/m^3", thickness = "1 mm" }"""
    text = SCENE.replace('{ preset = "MD600" }', " ".join(material.split()))
    deformed(Simulation.from_scene(scene_from_text(text)), math.radians(80.0)).require_sound()


def test_a_sheared_square_stops_on_its_way():
    """A frame closes the fibres to 85 degrees; the run ends when they fill all space, at 70.7."""

    def motion(time):
        return np.column_stack([deformation(math.radians(85.0) * time / 0.02), np.zeros(3)])

    sim = simulation(
        SCENE.replace('{ preset = "MD600" }', "{}").replace("material = {}", "")
        + f"[material]\n{linear_fabric(C12=0.2)}",
        supports=lambda X: [Support("frame", outline_nodes(X), motion=motion)],
    )
    with pytest.raises(SimulationError, match="sheared further than the fabric bears") as caught:
        sim.advance_to(0.02)
    angle = float(re.search(r"shear angle ([\d.]+) deg", str(caught.value))[1])
    assert math.degrees(math.acos(INITIAL)) < angle < 75.0
    cause = str(caught.value).split("cause")[1]
    assert "locking_angle" in cause and "step" not in cause
