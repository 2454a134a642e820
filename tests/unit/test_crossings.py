"""A sheet that passes through itself is told with time, share and place, and no other is."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from lcmchain.judgements.crossings import crossing_faces, crossing_warnings

T = 1e-3


def strip(count=20, length=0.1, width=0.01, triangles=False):
    """Nodes (N, 3) and faces (F, 4) of a flat strip along x, two cells wide."""
    x, y = np.linspace(0.0, length, count + 1), np.linspace(0.0, width, 3)
    points = np.array([[a, b, 0.0] for a in x for b in y])
    node = np.arange(len(points)).reshape(count + 1, 3)
    quads = np.stack([node[:-1, :-1], node[1:, :-1], node[1:, 1:], node[:-1, 1:]], -1).reshape(
        -1, 4
    )
    if not triangles:
        return points, quads
    return points, np.concatenate([quads[:, [0, 1, 2, 2]], quads[:, [0, 2, 3, 3]]])


def rolled(points, radius):
    """The strip bent to an arc about the y axis."""
    angle = points[:, 0] / radius
    return np.stack([radius * np.sin(angle), points[:, 1], radius * (1 - np.cos(angle))], axis=1)


@pytest.mark.parametrize("triangles", [False, True])
def test_a_flat_or_bent_sheet_crosses_nothing(triangles):
    points, faces = strip(triangles=triangles)
    assert not crossing_faces(points, faces, T).any()
    # a hair pin as tight as the sheet is thick, and a ring that is nearly closed
    assert not crossing_faces(rolled(points, 0.1 / 5.6), faces, T).any()


@pytest.mark.parametrize("triangles", [False, True])
def test_a_ring_that_overlaps_itself_and_a_loop_that_crosses_are_seen(triangles):
    points, faces = strip(triangles=triangles)
    ring = rolled(points, 0.1 / 7.2)  # the end lies in the beginning
    assert 0 < crossing_faces(ring, faces, T).sum() < len(faces) / 2
    ring[:, 2] *= 1.0 + 2.0 * points[:, 0]  # a spiral: the end crosses at no node's distance
    assert crossing_faces(ring, faces, 1e-9).any()


def test_lips_that_slide_over_each_other_in_a_plane_are_seen():
    """No edge crosses a face there: both lie in one plane."""
    points, faces = strip()
    lip = points + [0.0, 0.0102, 0.0]
    both, cells = np.concatenate([points, lip]), np.concatenate([faces, faces + len(points)])
    assert not crossing_faces(both, cells, T).any()
    both[len(points) :, 1] -= 0.0032
    assert crossing_faces(both, cells, T).sum() >= 20


def test_edges_far_shorter_than_the_sheet_is_thick_hide_nothing(monkeypatch):
    """Lips that lie over each other at every distance below half the thickness, and just above."""
    monkeypatch.setattr(
        "lcmchain.judgements.crossings.BATCH", 7
    )  # so that pairs come in many batches
    points, faces = strip(count=40, length=4e-3, width=2e-4)  # edges of a tenth of the thickness
    both, cells = np.concatenate([points, points]), np.concatenate([faces, faces + len(points)])
    for height in np.linspace(0.02, 0.49, 8) * T:
        both[len(points) :, 2] = height
        assert crossing_faces(both, cells, T).all()
        assert crossing_faces(both[:, [2, 0, 1]], cells, T).all()
    both[len(points) :, 2] = 0.51 * T
    assert not crossing_faces(both, cells, T).any()


def test_pairs_of_a_fine_mesh_are_as_many_as_its_faces_not_their_square(monkeypatch):
    """A mesh finer than its thickness once took 20 GB."""
    counted = []

    def count(corners, points, distance):
        counted.append(len(points))
        return np.zeros(len(points), dtype=bool)

    monkeypatch.setattr("lcmchain.judgements.crossings._lies_in", count)
    points, faces = strip(count=2000, length=0.02, width=2e-5)
    crossing_faces(points, faces, T)
    assert sum(counted) < 40 * len(faces)


def result(frames, faces):
    sheet = xr.Dataset({
        "time": ("time", 1e-3 * np.arange(len(frames))),
        "sheet_face_nodes": (("face", "corner"), faces),
    })  # fmt: skip
    for k, axis in enumerate("xyz"):
        sheet[f"reference_position_{axis}"] = ("node", frames[0][:, k])
        moved = np.stack([frame[:, k] - frames[0][:, k] for frame in frames])
        sheet[f"displacement_{axis}"] = (("time", "node"), moved)
    return sheet


def test_the_warning_names_the_first_state_and_the_share(monkeypatch):
    points, faces = strip()
    through, apart = rolled(points, 0.1 / 7.2), rolled(points, 0.1 / 5.6)
    (text,) = crossing_warnings(result([points, apart, through, points], faces), T)
    count = int(crossing_faces(through, faces, T).sum())
    assert f"at 2 ms {count} faces ({count / len(faces):.2%} of the area)" in text
    assert "interfaces.itself = true" in text
    assert crossing_warnings(result([points, apart], faces), T) == []
    monkeypatch.setattr("lcmchain.judgements.crossings.MOST_FACES", 10)
    assert crossing_warnings(result([points, through, points], faces), T) == []


def test_sheets_of_their_own_may_lie_in_each_other():
    """Several sheets of a model are no folds; what keeps them apart is told elsewhere."""
    points, faces = strip()
    both = np.concatenate([points, points + [0.0, 0.0, 1e-4]])
    sheet = result([both], np.concatenate([faces, faces + len(points)]))
    assert len(crossing_warnings(sheet, T)) == 1
    sheet["body"] = ("face", np.repeat([0, 1], len(faces)))
    assert crossing_warnings(sheet, T) == []


def test_lips_of_a_slit_touch_from_the_start_and_are_told_when_they_overlap_further():
    """Two halves of a strip that meet edge to edge, with nodes of their own on the common line."""
    points, faces = strip()
    flat = np.concatenate([points, points * [1.0, -1.0, 1.0]])
    cells = np.concatenate([faces, faces[:, ::-1] + len(points)])
    assert crossing_faces(flat, cells, T).any()
    opened, over = flat.copy(), flat.copy()
    opened[len(points) :, 1] -= 0.002
    over[len(points) :, 1] += 0.007  # by more than a cell of 5 mm
    assert crossing_warnings(result([flat, opened], cells), T) == []
    assert len(crossing_warnings(result([flat, over], cells), T)) == 1


@pytest.mark.parametrize("triangles", [False, True])
def test_rounding_in_a_plane_flange_is_no_crossing(triangles):
    """A net lies in the plane to 1e-18 m: the signs of its heights mean nothing."""
    points, faces = strip(triangles=triangles)
    points[:, 2] = 1e-18 * np.random.default_rng(1).standard_normal(len(points))
    assert not crossing_faces(points, faces, T).any()
