"""A clamped film under pressure against the membrane of revolution (``inflated_membrane.py``)."""

from __future__ import annotations

import numpy as np
import pytest
from inflated_membrane import inflated_disc, neo_hooke

from lcmchain.model import build_model
from lcmchain.scene import scene_from_text
from lcmchain.solver.simulation import Simulation

RADIUS, THICKNESS, SHEAR = 50e-3, 0.2e-3, 0.4e6
CORNERS = np.linspace(0.0, 0.5 * np.pi, 25)


def circle(radius, angles=CORNERS):
    return [[f"{1e3 * radius * f(a):.6f} mm" for f in (np.cos, np.sin)] for a in angles]


SCENE = f"""
process = {{ time = "50 ms", frames = 2, mass_damping = "200 1/s" }}
blank = {{ outline = {[["0 mm", "0 mm"], *circle(RADIUS)]}, edge_length = "5 mm" }}

[material]
law = "neo-hooke"
shear_modulus = "0.4 MPa"
thickness = "0.2 mm"
density = "1100 kg/m^3"

[[pressure]]
name = "air"
face = "bottom"
point = "0 0 0 mm"
radius = "DISC mm"
value = "PRESSURE kPa"
ramp = "30 ms"

[[grippers]]
name = "rim"
polygon = {circle(0.985 * RADIUS) + circle(1.1 * RADIUS, CORNERS[::-1])}
hold = "xyz"
face = "bottom"

[[grippers]]
name = "pole"
point = "0 0 0 mm"
hold = "xy"

[[grippers]]
name = "x"
box = ["-0.01 0.1 -1 mm", "0.01 48.9 1 mm"]
hold = "x"

[[grippers]]
name = "y"
box = ["0.1 -0.01 -1 mm", "48.9 0.01 1 mm"]
hold = "y"
"""


def inflated(pressure, disc):
    """Return the film at rest under a pressure [kPa] on a disc around its pole [mm]."""
    text = SCENE.replace("DISC", str(disc)).replace("PRESSURE", str(pressure))
    simulation = Simulation(build_model(scene_from_text(text)))
    simulation.advance_to(simulation.model.process_time)
    return simulation


class Film:
    """What a quarter of a film is compared by."""

    def __init__(self, simulation):
        model, mesh = simulation.model, simulation.model.only_body().mesh
        x = simulation.state.position.T
        start, now = mesh.mid_surface(model.node_positions), mesh.mid_surface(x)
        self.height = now[np.argmin(np.linalg.norm(start[:, :2], axis=1)), 2]
        apart = (x[mesh.pair_count :] - x[: mesh.pair_count])[mesh.faces].mean(axis=1)
        corner = now[mesh.faces]
        normal = np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1])
        thickness = (apart * normal).sum(axis=1) / np.linalg.norm(normal, axis=1)
        centre = np.linalg.norm(start[mesh.faces].mean(axis=1)[:, :2], axis=1)
        inside = (centre < 0.9 * RADIUS) & ~mesh.is_triangle
        self.centre, self.thickness = centre[inside], thickness[inside]


@pytest.mark.parametrize(("pressure", "disc"), [(2.0, 60.0), (0.8, 60.0), (2.4, 30.0)])
def test_an_inflated_disc_is_the_membrane(pressure, disc):
    """Pole stretched by 28, 15 and 28 %; the last is pressed on a part, whose border cuts elements.

    Its thickness of 1/250 of the radius, of which the membrane knows nothing, takes 0.3 %.
    """
    film = Film(inflated(pressure, disc))
    reference = inflated_disc(
        neo_hooke(SHEAR), THICKNESS, lambda R: 1e3 * pressure * (R < 1e-3 * disc), RADIUS
    )
    assert film.height == pytest.approx(reference.height, rel=6e-3)
    at = reference.at(film.centre)
    error = film.thickness * at[0] * at[1] / THICKNESS - 1.0
    assert abs(error[np.argmin(film.centre)]) < 5e-3
    assert np.sqrt(np.mean(error**2)) < 0.01


def test_the_energies_balance_and_forces_follow_the_pressure():
    """The rim bears the pressure times the area it closes; what the pressure puts in is kept."""
    simulation = inflated(2.0, 60.0)
    energy = simulation.energy()
    assert abs(energy["balance_error"]) < 1e-4 * energy["external"]
    assert energy["kinetic"] < 1e-4 * energy["internal"]
    assert energy["hourglass"] < 5e-3 * energy["internal"]
