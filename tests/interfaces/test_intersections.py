"""Plies of a formed stack do not go through each other, told by a library of its own (ipctk)."""

from __future__ import annotations

import numpy as np
import pytest
from stacks import ALL, T, ply, stack

from lcmchain.interfaces.table import Interface
from lcmchain.scene import scene_from_text

ipctk = pytest.importorskip("ipctk")

# A punch of 15 mm presses both plies 10 mm deep through a hole.
SCENE = f"""
process = {{ time = "20 ms", mass_damping = "200 1/s" }}
contact = {{ friction = 0.157, depth = "zero" }}
blank = {{ size = ["50 mm", "50 mm"], edge_length = "2.5 mm" }}
material = {{ preset = "MD600" }}
[[tools]]
name = "punch"
shape = {{ type = "sphere_capped_punch", radius = "15 mm" }}
position = "0 0 {2 * T} mm"
motion = {{ type = "stroke", direction = [0, 0, -1], distance = "10 mm" }}
[[tools]]
name = "die"
shape = {{ type = "plate_with_hole", hole_radius = "18 mm", fillet_radius = "5 mm", \
side = "below" }}
"""


@pytest.fixture(scope="module")
def formed():
    """Mid-surfaces of the formed plies (n, 3) [m] and their triangles (m, 3)."""
    plies = [
        ply("lower", width=50.0, height=50.0, edge=2.5, angle=30.0, z=0.5 * T),
        ply("upper", width=50.0, height=50.0, edge=3.0, z=1.5 * T),
    ]
    sim = stack(plies, scene_from_text(SCENE), ALL, Interface(friction=0.2))
    sim.advance_to(20e-3)
    found = []
    for body in sim.model.bodies:
        x = sim.state.position.T[body.first_node : body.first_node + body.mesh.node_count]
        lower, upper = body.mesh.elements[:, :4], body.mesh.elements[:, 4:]
        nodes, index = np.unique(lower, return_index=True)
        faces = np.searchsorted(nodes, lower)
        triangles = np.concatenate([faces[:, [0, 1, 2]], faces[:, [0, 2, 3]]])
        triangles = triangles[triangles[:, 1] != triangles[:, 2]]
        found.append((0.5 * (x[nodes] + x[upper.ravel()[index]]), triangles))
    assert np.ptp(found[0][0][:, 2]) > 8e-3
    return found


def intersect(surfaces):
    (lower, lower_faces), (upper, upper_faces) = surfaces
    points = np.asfortranarray(np.concatenate([lower, upper]))
    faces = np.concatenate([lower_faces, upper_faces + len(lower)]).astype(np.int32)
    return ipctk.has_intersections(ipctk.CollisionMesh(points, ipctk.edges(faces), faces), points)


def test_mid_surfaces_of_formed_plies_do_not_intersect(formed):
    """Nor do they where one ply is half a thickness deep in the other."""
    assert not intersect(formed)
    (lower, faces), upper = formed
    assert not intersect([(lower + [0.0, 0.0, 0.5e-3 * T], faces), upper])


def test_a_ply_that_is_moved_through_the_other_one_is_found(formed):
    (lower, faces), upper = formed
    assert intersect([(lower + [0.0, 0.0, 1.2e-3 * T], faces), upper])
