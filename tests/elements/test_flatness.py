"""Which elements count as flat parallelograms: only those give the same numbers either way."""

import numpy as np
import pytest

from lcmchain.elements.solid_shell.geometry import reference_geometry

SIZE, THICKNESS = 5e-3, 1e-3
FIBRE = np.array([[1.0, 0.0, 0.0]])


def brick():
    """A flat parallelogram with upright directors, (8, 3)."""
    low = np.array([[0.0, 0, 0], [1, 0, 0], [1.3, 1, 0], [0.3, 1, 0]]) * SIZE
    return np.concatenate([low, low + [0.0, 0.0, THICKNESS]])


def is_flat(nodes):
    return bool(reference_geometry(nodes[None], FIBRE).flat[0])


def test_round_off_of_a_mesh_generator_leaves_an_element_flat():
    noise = np.random.default_rng(0).uniform(-1.0, 1.0, (8, 3))
    assert is_flat(brick())
    assert is_flat(brick() + 1e-13 * SIZE * noise)
    rotation = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    rotation *= np.linalg.det(rotation)  # no mirror image
    assert is_flat(brick() @ rotation.T)


def test_edges_off_the_fibres_are_not_aligned():
    """Of a rectangle and of a parallelogram with one edge along a fibre, in any direction."""
    shear = np.array([[1.0, 0.3, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    rectangle = brick() @ np.linalg.inv(shear).T
    rotation = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    rotation *= np.linalg.det(rotation)

    def is_aligned(nodes, angle=0.0):
        fibre = np.array([[np.cos(angle), np.sin(angle), 0.0]])
        geometry = reference_geometry((nodes @ rotation.T)[None], fibre @ rotation.T)
        assert geometry.flat[0]
        return bool(geometry.aligned[0])

    assert is_aligned(rectangle)
    assert is_aligned(rectangle + 1e-13 * SIZE * np.random.default_rng(0).uniform(-1, 1, (8, 3)))
    assert not is_aligned(rectangle, 1e-8)
    assert not is_aligned(brick())
    assert not is_aligned(brick() @ [[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]])


@pytest.mark.parametrize("size", [1e-3, 1e-6, 1e-8])
@pytest.mark.parametrize("kind", ["taper", "warp", "wedge", "tilt"])
def test_a_shape_that_someone_means_is_not_flat(kind, size):
    """Down to a millionth of the element: its stiffness depends on the shape at first order."""
    nodes = brick()
    move = {
        "taper": np.array([1.0, 0, 0]) * SIZE,  # of both nodes of a corner, along the sheet
        "warp": np.array([0, 0, 1.0]) * SIZE,  # upwards
    }
    if kind in move:
        nodes[[2, 6]] += 8.0 * size * move[kind]
    elif kind == "wedge":  # thicker on one side
        nodes[[5, 6]] += 4.0 * size * np.array([0.0, 0.0, SIZE])
    else:  # directors that lean
        nodes[4:] += 4.0 * size * np.array([SIZE, 0.0, 0.0])
    assert not is_flat(nodes)
