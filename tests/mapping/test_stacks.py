"""Two plies over each other onto shells and solids: each keeps its mass and its fields."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

from lcmchain.errors import InputError
from lcmchain.fields.netcdf_file import write_netcdf
from lcmchain.mapping import (
    Status,
    TargetMesh,
    compute_weights,
    map_file,
    plies,
    read_sheet,
    transfer,
)
from lcmchain.mapping.fields import content_of_cells, content_of_sheet
from lcmchain.mapping.picture import comparable
from lcmchain.mapping.report import mapping_report
from lcmchain.mapping.solids.tetrahedra import solids_of_cells
from lcmchain.mapping.verify import verify
from lcmchain.mapping.weights import present

DEPTH = 0.3
UNDER, OVER = 0.02, 0.03  # thicknesses
DENSITIES = (0.3 / (0.5 * UNDER), 0.6 / (0.4 * OVER))
STACK = UNDER + OVER
#: from the lower side of the stack to the upper one; the middle of three layers is in both plies
THREE_LAYERS = np.array([-0.5, -0.2, 0.1, 0.5]) * STACK


def meshes(make, shape, half=0.5):
    """Both plies at their places in the stack, each in its own mesh."""
    first = make.grid(13, 12, (-half, -half), (half, half), jitter=0.2)
    second = make.grid(11, 14, (-half, -half), (half, half), jitter=0.2, seed=2)
    places = (0.5 * (UNDER - STACK), 0.5 * (STACK - OVER))
    return [(shape(points, z), quads) for (points, quads), z in zip((first, second), places)]


def flat(make):
    return lambda points, z: make.lifted(points) + [0.0, 0.0, z]


def two_plies(make, shape, **fields):
    under, over = meshes(make, shape)
    families = [make.families(*mesh, shear) for mesh, shear in ((under, 0.3), (over, -0.2))]
    own = {
        "thickness": (UNDER, OVER),
        "areal_fibre_mass": (0.3, 0.6),
        "fibre_volume_fraction": (0.5, 0.4),
        "fibre_direction_1": tuple(pair[0] for pair in families),
        "fibre_direction_2": tuple(pair[1] for pair in families),
    }
    return make.two_plies(under, over, **(own | fields))


def solid(make, kind, shape, heights, half=0.5, seed=1):
    other, cells = make.grid(9, 10, (-half, -half), (half, half), jitter=0.2, seed=seed)
    nodes, corners = make.bricks(other, cells, heights, shape, kind)
    return TargetMesh(nodes, ((kind, corners),), {})


def shells(make, shape, half=0.5):
    other, cells = make.grid(9, 10, (-half, -half), (half, half), jitter=0.2, seed=1)
    return TargetMesh(shape(other, 0.0), (("quad", cells),), {})


def mapped_onto(sheet, target):
    weights = compute_weights(sheet, target)
    return weights, transfer(sheet, target, weights)


def volumes_of(target):
    return solids_of_cells(target.points, target.corners).volumes


def mass_of_ply(sheet, number, coverage=1.0):
    own = sheet.plies == number
    return np.sum((sheet.scalars["areal_fibre_mass"] * sheet.surface.areas * coverage)[own])


def test_the_plies_of_a_result_are_read(make):
    sheet = read_sheet(two_plies(make, flat(make)))
    assert sheet.ply_names == ("under", "over") and sheet.is_stack
    np.testing.assert_array_equal(np.bincount(sheet.plies), [13 * 12, 11 * 14])
    alone = read_sheet(make.forming_result(*meshes(make, flat(make))[0]))
    assert not alone.is_stack and alone.ply_names == () and set(alone.plies) == {0}


def test_a_field_that_one_ply_does_not_have_stays_with_the_other(make):
    missing = np.full(13 * 12, np.nan)
    sheet = read_sheet(
        two_plies(make, flat(make), wrinkle=(missing, 2.0), shear_angle=(missing, 0.1))
    )
    assert sheet.unused == ()
    _, fields = mapped_onto(sheet, shells(make, flat(make)))
    np.testing.assert_allclose(fields.scalars["over_wrinkle"], 2.0, rtol=1e-12)
    assert "under_wrinkle" not in fields.scalars
    holes = np.where(np.arange(13 * 12) == 5, np.nan, 0.1)
    with pytest.raises(InputError, match="shear_angle of face 5 is not finite"):
        read_sheet(two_plies(make, flat(make), shear_angle=(holes, 0.1)))


def test_flags_that_name_no_body_are_refused(make):
    dataset = two_plies(make, flat(make))
    dataset["body"].attrs["flag_meanings"] = "one"
    with pytest.raises(InputError, match="flag_meanings do not name them all"):
        read_sheet(dataset)


# --- mass of every ply ----------------------------------------------------------------------------


@pytest.mark.parametrize("curved", [False, True])
@pytest.mark.parametrize("kind", ["hexahedron", "tetra", "wedge"])
@pytest.mark.parametrize("layers", [1, 3])
def test_every_ply_keeps_its_mass_on_solids(make, curved, kind, layers):
    """Σ of a ply's fibre volume times its density, to 1e-12, on targets within and beyond it."""
    shape = make.shell_of_bowl(DEPTH) if curved else flat(make)
    uneven = {"areal_fibre_mass": tuple(
        (lambda c, d=d, t=t, v=v: d * t * v * (1.0 + 0.3 * c[:, 0]))
        for d, t, v in zip(DENSITIES, (UNDER, OVER), (0.5, 0.4))
    ), "fibre_volume_fraction": tuple(
        (lambda c, v=v: v * (1.0 + 0.3 * c[:, 0])) for v in (0.5, 0.4)
    )}  # fmt: skip
    sheet = read_sheet(two_plies(make, shape, **uneven))
    heights = THREE_LAYERS if layers == 3 else THREE_LAYERS[[0, 3]]
    for half in (0.45, 0.55):
        target = solid(make, kind, shape, heights, half)
        weights, fields = mapped_onto(sheet, target)
        volumes, total = volumes_of(target), 0.0
        for number, name in enumerate(sheet.ply_names):
            fraction = fields.scalars[f"{name}_fibre_volume_fraction"]
            share = fields.scalars[f"ply_share_{name}"]
            mass = np.nansum(fraction * share * volumes) * DENSITIES[number]
            total += mass
            if half > 0.5:
                own = mass_of_ply(sheet, number)
                assert mass == pytest.approx(own, rel=1e-12)
            else:
                covered = mass_of_ply(sheet, number, weights.face_coverage)
                assert mass == pytest.approx(covered, rel=2e-3)  # second order within cut faces
        areal = fields.scalars["areal_fibre_mass"]
        assert content_of_cells(weights, areal) == pytest.approx(total, rel=1e-12)
        content = content_of_sheet(sheet, weights, sheet.scalars["areal_fibre_mass"])
        assert content == pytest.approx(total, rel=1e-12)


@pytest.mark.parametrize("curved", [False, True])
def test_every_ply_keeps_its_mass_on_shells(make, curved):
    shape = make.shell_of_bowl(DEPTH) if curved else flat(make)
    sheet = read_sheet(two_plies(make, shape))
    target = shells(make, shape, half=0.45)
    weights, fields = mapped_onto(sheet, target)
    area, total = target.surface.areas, 0.0
    for number, name in enumerate(sheet.ply_names):
        mass = np.sum(fields.scalars[f"{name}_areal_fibre_mass"] * area)
        covered = mass_of_ply(sheet, number, weights.face_coverage)
        assert mass == pytest.approx(covered, rel=1e-12)
        total += mass
    assert np.sum(fields.scalars["areal_fibre_mass"] * area) == pytest.approx(total, rel=1e-12)
    thickness = fields.scalars["thickness"]
    np.testing.assert_allclose(thickness, STACK, rtol=1e-12)
    volume = fields.scalars["fibre_volume_fraction"] * thickness * area
    expected = sum(
        np.sum(fields.scalars[f"{name}_areal_fibre_mass"] * area) / density
        for name, density in zip(sheet.ply_names, DENSITIES)
    )
    assert volume.sum() == pytest.approx(expected, rel=1e-12)


def test_a_picture_compares_a_stack_with_a_stack(make):
    """Thickness of all plies on either side, not that of one ply beside that of all."""
    shape = flat(make)
    sheet = read_sheet(two_plies(make, shape))
    _, fields = mapped_onto(sheet, shells(make, shape, half=0.45))
    drawn, title = comparable(sheet)
    inner = np.abs(drawn.surface.centroids[:, :2]).max(axis=1) < 0.4
    for name in ("thickness", "fibre_volume_fraction"):
        shown, mapped = drawn.scalars[name][inner], fields.scalars[name]
        np.testing.assert_allclose(shown, mapped.mean(), rtol=1e-9)
        np.testing.assert_allclose(mapped, mapped.mean(), rtol=1e-9)
    assert title.startswith("formed stack") and title.endswith(", under")
    alone = plies.of_ply(sheet, 0)
    assert comparable(alone) == (alone, "formed sheet")


# --- what lies where in the thickness -------------------------------------------------------------


@pytest.mark.parametrize(("factor", "shift"), [(1.0, 0.0), (1.2, 0.3), (0.8, -0.2)])
@pytest.mark.parametrize("kind", ["hexahedron", "tetra"])
def test_each_ply_takes_its_part_of_the_thickness(make, factor, shift, kind):
    """Two fifths of the solid belong to the lower ply, however thick and wherever the solid is."""
    sheet = read_sheet(two_plies(make, flat(make)))
    heights = factor * np.array([-0.5, -0.3, -0.1, 0.2, 0.5]) * STACK + shift * STACK
    target = solid(make, kind, flat(make), heights)
    weights, fields = mapped_onto(sheet, target)
    share = fields.scalars["ply_share_under"]
    place = (target.centroids[:, 2] - heights[0]) / (heights[-1] - heights[0])
    np.testing.assert_allclose(share, np.where(place < 0.4, 1.0, 0.0), atol=1e-9)
    np.testing.assert_allclose(fields.scalars["ply_share_over"], 1.0 - share, atol=1e-9)
    expected = np.where(place < 0.4, 0.5, 0.4) / factor
    np.testing.assert_allclose(fields.scalars["fibre_volume_fraction"], expected, rtol=1e-9)
    np.testing.assert_allclose(fields.scalars["thickness"], STACK, rtol=1e-9)
    np.testing.assert_allclose(fields.scalars["solid_thickness"], factor * STACK, rtol=1e-9)
    np.testing.assert_allclose(weights.coverage, 1.0, rtol=1e-9)
    for name, thickness in (("under", UNDER), ("over", OVER)):
        held = fields.scalars[f"ply_share_{name}"] > 0.5
        own = fields.scalars[f"{name}_solid_thickness"]
        np.testing.assert_allclose(own[held], factor * thickness, rtol=1e-9)


def test_a_cell_in_several_plies_holds_its_share_of_each(make):
    sheet = read_sheet(two_plies(make, flat(make)))
    target = solid(make, "hexahedron", flat(make), THREE_LAYERS)
    _, fields = mapped_onto(sheet, target)
    middle = np.abs(target.centroids[:, 2] + 0.05 * STACK) < 1e-9
    # from -0.2 to 0.1 of the thickness, the border lies at -0.1
    np.testing.assert_allclose(fields.scalars["ply_share_under"][middle], 1.0 / 3.0, rtol=1e-9)
    mixed = (0.5 + 2.0 * 0.4) / 3.0
    np.testing.assert_allclose(fields.scalars["fibre_volume_fraction"][middle], mixed, rtol=1e-9)
    for name, fraction in (("under", 0.5), ("over", 0.4)):
        own = fields.scalars[f"{name}_fibre_volume_fraction"]
        np.testing.assert_allclose(own[middle], fraction, rtol=1e-9)


def test_a_cell_has_the_directions_of_the_ply_that_fills_most_of_it(make):
    sheet = read_sheet(two_plies(make, flat(make)))
    target = solid(make, "hexahedron", flat(make), THREE_LAYERS)
    _, fields = mapped_onto(sheet, target)
    leading = np.where(fields.scalars["ply_share_under"] > 0.5, 0.3, -0.2)
    for names, shear in (
        (("fibre_direction_1", "fibre_direction_2"), leading),
        (("under_fibre_direction_1", "under_fibre_direction_2"), 0.3),
        (("over_fibre_direction_1", "over_fibre_direction_2"), -0.2),
    ):
        first, second = (fields.directions[name].direction for name in names)
        angle = np.arcsin(np.einsum("ci,ci->c", first, second))
        held = np.isfinite(angle)
        assert held.any()
        np.testing.assert_allclose(np.broadcast_to(shear, held.shape)[held], angle[held], atol=1e-9)
    lower = fields.scalars["ply_share_under"] == 0.0
    assert np.isnan(fields.directions["under_fibre_direction_1"].direction[lower]).all()


def test_on_a_curved_solid_the_plies_tile_the_thickness(make):
    shape = make.shell_of_bowl(DEPTH)
    sheet = read_sheet(two_plies(make, shape))
    target = solid(make, "hexahedron", shape, THREE_LAYERS, half=0.4)
    weights, fields = mapped_onto(sheet, target)
    np.testing.assert_allclose(weights.coverage, 1.0, rtol=1e-9)
    shares = fields.scalars["ply_share_under"], fields.scalars["ply_share_over"]
    np.testing.assert_allclose(sum(shares), 1.0, rtol=1e-12)
    lower, middle, upper = (values for values in np.split(shares[0], 3))
    np.testing.assert_allclose(lower, 1.0, atol=1e-9)
    np.testing.assert_allclose(upper, 0.0, atol=1e-9)
    np.testing.assert_allclose(middle, 1.0 / 3.0, atol=0.02)
    np.testing.assert_allclose(
        np.split(fields.scalars["fibre_volume_fraction"], 3)[0], 0.5, rtol=0.01
    )
    assert set(weights.status) == {Status.INSIDE}


def test_where_a_ply_ends_the_other_takes_the_whole_thickness(make):
    shape = flat(make)
    under, over = meshes(make, shape)
    half = over[0][over[1]].mean(axis=1)[:, 0] < 0.0
    points, quads = over[0].copy(), over[1][half]
    points[:, 0] = np.minimum(points[:, 0], 0.0)  # a straight end at x = 0
    areas = np.linalg.norm(make.area_vectors(points, quads), axis=1)
    quads = quads[areas > 1e-6]
    pairs = {"thickness": (UNDER, OVER), "areal_fibre_mass": (0.3, 0.6)}
    sheet = read_sheet(make.two_plies(under, (points, quads), **pairs))

    def stepped(p, z):
        # the solid has the thickness of what is there
        low = -0.5 * STACK
        scale = np.where(p[:, :1] > 1e-9, UNDER / STACK, 1.0)
        return make.lifted(p) + [0.0, 0.0, low] + [0.0, 0.0, z - low] * scale

    other, cells = make.grid(10, 5, (-0.4, -0.4), (0.4, 0.4))
    nodes, corners = make.bricks(other, cells, (-0.5 * STACK, 0.5 * STACK), stepped)
    target = TargetMesh(nodes, (("hexahedron", corners),), {})
    _, fields = mapped_onto(sheet, target)
    x = target.centroids[:, 0]
    right, left = x > 0.09, x < -0.1
    np.testing.assert_allclose(fields.scalars["ply_share_under"][right], 1.0, rtol=1e-9)
    np.testing.assert_allclose(fields.scalars["ply_share_under"][left], 0.4, rtol=1e-9)
    np.testing.assert_allclose(fields.scalars["thickness"][right], UNDER, rtol=1e-9)
    np.testing.assert_allclose(fields.scalars["thickness"][left], STACK, rtol=1e-9)


def test_the_error_of_a_mapping_is_that_of_the_stack_where_a_ply_ends(make):
    """Even plies of the same outline have none; beyond the end of one it stays below a ply."""
    under, over = meshes(make, flat(make))
    half = over[0][over[1]].mean(axis=1)[:, 0] < 0.0
    pairs = {"thickness": (UNDER, OVER), "areal_fibre_mass": (0.3, 0.6)}
    families = [make.families(*mesh) for mesh in (under, (over[0], over[1][half]))]
    target = shells(make, flat(make), half=0.4)

    def judged(one, **more):
        sheet = read_sheet(make.two_plies(under, one, **pairs, **more))
        weights, mapped = mapped_onto(sheet, target)
        return verify(sheet, target, weights, mapped, compute_weights)

    found = judged(over).fields["thickness"]
    assert found.worst < 1e-9 * STACK and found.there_and_back is None
    directions = {"fibre_direction_1": tuple(pair[0] for pair in families)}
    ended = judged((over[0], over[1][half]), **directions)
    away = np.abs(target.centroids[:, 0]) > 0.2
    assert ended.cells["thickness"][away].max() < 1e-9 * STACK
    assert ended.fields["thickness"].worst < OVER


def test_numbering_of_the_plies_means_nothing(make):
    """Which ply comes first in the file, and which way its normals look."""
    shape = make.shell_of_bowl(DEPTH)
    under, over = meshes(make, shape)
    pairs = {"thickness": (UNDER, OVER), "areal_fibre_mass": (0.3, 0.6),
             "fibre_volume_fraction": (0.5, 0.4)}  # fmt: skip
    turned = (over[0], over[1][:, ::-1])
    target = solid(make, "tetra", shape, THREE_LAYERS, half=0.45)
    one = read_sheet(make.two_plies(under, over, **pairs))
    before = transfer(one, target, compute_weights(one, target, order=1))
    other = make.two_plies(turned, under, **{name: pair[::-1] for name, pair in pairs.items()})
    other["body"].attrs["flag_meanings"] = "over under"
    turned_round = read_sheet(other)
    after = transfer(turned_round, target, compute_weights(turned_round, target, order=1))
    assert set(before.scalars) == set(after.scalars)
    for name, values in before.scalars.items():
        np.testing.assert_allclose(
            after.scalars[name], values, rtol=1e-10, atol=1e-12, err_msg=name
        )


def test_a_ply_whose_faces_lie_too_far_off_a_cell_is_not_in_it(make):
    """Such faces are listed for the cell with no share: no division by it, no direction of it."""
    sheet = read_sheet(two_plies(make, flat(make)))
    target = shells(make, flat(make), half=0.45)
    weights = compute_weights(sheet, target)
    off = (weights.cell == 5) & (sheet.plies[weights.face] == 1)
    assert off.any()
    fields = transfer(sheet, target, replace(weights, average=np.where(off, 0.0, weights.average)))
    whole = transfer(sheet, target, weights)
    for name in ("over_thickness", "over_fibre_volume_fraction"):
        values = fields.scalars[name]
        assert np.flatnonzero(np.isnan(values)).tolist() == [5]
        there = np.arange(target.cell_count) != 5
        np.testing.assert_array_equal(values[there], whole.scalars[name][there])
    assert fields.scalars["ply_share_over"][5] == 0.0
    assert fields.scalars["under_thickness"][5] == pytest.approx(UNDER)


def test_sums_over_the_plies_are_left_to_the_mapping(make):
    stack = two_plies(make, flat(make), stack_thickness=(STACK, STACK))
    stack["stack_thickness"].attrs["units"] = "m"
    sheet = read_sheet(stack)
    assert "stack_thickness" not in (*sheet.scalars, *sheet.unused)
    target = shells(make, flat(make), half=0.45)
    _, fields = mapped_onto(sheet, target)
    np.testing.assert_allclose(fields.scalars["thickness"], STACK, rtol=1e-9)


# --- files ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["quad", "hexahedron"])
def test_a_stack_is_mapped_from_file_to_file(make, write_mesh, tmp_path, kind):
    dataset = two_plies(make, flat(make))
    write_netcdf(tmp_path / "forming.nc", {"/": dataset})
    target = (
        shells(make, flat(make), half=0.45)
        if kind == "quad"
        else solid(make, "hexahedron", flat(make), THREE_LAYERS, half=0.45)
    )
    mesh = write_mesh(target.points, [(kind, target.blocks[0][1])])
    stored = tmp_path / "weights.npz"
    for name in ("first", "again"):
        out = tmp_path / f"{name}.nc"
        report = map_file(
            tmp_path / "forming.nc", mesh, out, weights_file=stored, picture=kind == "quad"
        )
        assert abs(report.conservation_error) < 1e-12
    group = None if kind == "quad" else "solid"
    opened = [xr.open_dataset(tmp_path / f"{name}.nc", group=group) for name in ("again", "first")]
    with opened[0] as again, opened[1] as one:
        for name in ("under_thickness", "over_fibre_direction_1_x", "ply_share_over"):
            assert again[name].attrs["long_name"] and again[name].attrs["units"]
            np.testing.assert_array_equal(again[name].values, one[name].values)
        assert again["under_thickness"].attrs["units"] == "m"
        assert again["under_thickness"].attrs["long_name"].endswith("ply under")


def test_a_mapped_stack_is_mapped_again_ply_by_ply(make, write_mesh, tmp_path):
    """The second target lies off the first one, and its normals point to the lower side."""
    shear, uneven = (0.3, -0.2), lambda c: 0.3 + 0.2 * c[:, 0] ** 2
    source = two_plies(make, flat(make), shear_angle=shear, areal_fibre_mass=(uneven, 0.6))
    points, quads = make.grid(9, 10, (-0.5, -0.5), (0.5, 0.5), jitter=0.2, seed=1)
    first = write_mesh(make.lifted(points), [("quad", quads)], "first.vtu")
    points, quads = make.grid(5, 4, (-0.5, -0.5), (0.5, 0.5), jitter=0.2, seed=3)
    off = 0.01
    place = make.lifted(points) + [0.0, 0.0, off]
    second = write_mesh(place, [("quad", quads[:, ::-1])], "second.vtu")
    map_file(source, first, tmp_path / "once.nc", picture=False)
    map_file(tmp_path / "once.nc", second, tmp_path / "twice.nc", picture=False)
    with xr.open_dataset(tmp_path / "twice.nc") as opened:
        twice = opened.load()
    assert (twice["ply_order"] == -1.0).all() and twice["ply_order"].attrs["units"] == "1"
    areas = np.linalg.norm(make.area_vectors(place, quads), axis=1)
    given = (flat(make)(points, z) for z in (0.5 * (UNDER - STACK), 0.5 * (STACK - OVER)))
    for name, angle, at in zip(("under", "over"), shear, given, strict=True):
        np.testing.assert_allclose(twice[f"{name}_shear_angle"], -angle, rtol=1e-9)
        height = off - at[0, 2]
        np.testing.assert_allclose(twice[f"ply_height_{name}"], height, atol=1e-12)
    under = meshes(make, flat(make))[0]
    mass = np.linalg.norm(make.area_vectors(*under), axis=1) @ uneven(under[0][under[1]].mean(1))
    assert areas @ twice["under_areal_fibre_mass"].values == pytest.approx(mass, rel=1e-9)
    solids = solid(make, "hexahedron", flat(make), [-0.025, 0.025])
    again = read_sheet(tmp_path / "once.nc")
    inside = transfer(again, solids, compute_weights(again, solids)).scalars
    assert "under_shear_angle" in inside
    assert not {"ply_order", "ply_height_under"} & inside.keys()


def test_a_ply_that_stands_off_the_others_too_far_is_told(make):
    """Beyond the maximum distance a ply is lost where its neighbour is mapped; not at its end."""
    under = make.grid(10, 10, (-0.5, -0.5), (0.5, 0.5))
    over = make.grid(10, 7, (-0.5, -0.5), (0.5, 0.2))
    high = make.lifted(over[0]) + [0.0, 0.0, STACK]
    source = make.two_plies((make.lifted(under[0]), under[1]), (high, over[1]))
    target = TargetMesh(make.lifted(under[0]), (("quad", under[1]),), {})

    def warnings():
        sheet = read_sheet(source)
        weights = compute_weights(sheet, target)
        mapped = transfer(sheet, target, weights)
        return mapping_report(
            sheet, target, weights, mapped, name="m", kind="infiltration"
        ).warnings

    assert not any("too far off the target" in warning for warning in warnings())
    raised = np.arange(len(source["sheet_node_z"])) >= len(under[0])
    raised &= source["sheet_node_x"].values > 0.25
    source["sheet_node_z"][raised] += 0.5
    told = [warning for warning in warnings() if "too far off the target" in warning]
    assert len(told) == 1 and "maximum_distance" in told[0]
    assert 'of the ply "over" stand too far off the target (farthest 100 mm)' in told[0]


def test_faces_that_no_cell_takes_are_told_of_every_ply(make):
    """A fold in the upper ply, which the target lacks."""
    under = make.grid(10, 10, (-0.5, -0.5), (0.5, 0.5))
    points, quads = make.grid(40, 4, (0.0, -0.5), (1.0, 0.5))
    # along the ply x goes there, back above itself, and there again
    s = points[:, 0]
    x = np.interp(s, [0.0, 0.4, 0.5, 0.6, 1.0], [-0.5, 0.15, -0.02, 0.15, 0.5])
    z = np.interp(s, [0.0, 0.4, 0.45, 0.5, 0.55, 0.6], [0.05, 0.05, 0.06, 0.07, 0.08, 0.05])
    fold = np.stack([x, points[:, 1], z], axis=1)
    target = TargetMesh(make.lifted(under[0]), (("quad", under[1]),), {})
    lone = read_sheet(make.forming_result(fold, quads))
    missed = compute_weights(lone, target).missed
    assert missed.any()
    flat_ply = (make.lifted(under[0]), under[1])
    both = compute_weights(read_sheet(make.two_plies(flat_ply, (fold, quads))), target).missed
    np.testing.assert_array_equal(both, [*np.zeros(len(under[1]), dtype=bool), *missed])


def test_a_ply_that_ends_inside_a_cell_counts_with_the_part_that_is_there():
    coverage = np.array([[1.0, 0.5, 0.4, 0.995, 0.0], [0.25, 0.5, 1.6, 1.0, 0.0]])
    expected = [[1.0, 1.0, 0.4, 1.0, 1.0], [0.25, 1.0, 1.0, 1.0, 1.0]]
    np.testing.assert_allclose(present(coverage), expected, rtol=1e-14)
