"""The structural stage: its files, what other programs read of them, and clear refusals."""

import json
import stat

import meshio
import numpy as np
import pytest
import xarray as xr

from lcmchain.errors import InputError
from lcmchain.mapping import map_file
from lcmchain.mapping.structure import SolverError, SolverOptions, analyse
from lcmchain.mapping.target import TargetMesh
from lcmchain.scene import structure_from_text

from .conftest import MATERIAL, SIDE, condition, needs_calculix, plane

HELD = condition("supports", "rim", edge="true")
PUSHED = condition("loads", "push", point='"0.1 0.1 0 m"', force='"0 0 -10 N"')


def fake(path, text):
    """A program in CalculiX's place."""
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(path.stat().st_mode | stat.S_IXUSR)
    return SolverOptions(command=str(path), picture=False)


@needs_calculix
def test_files_and_what_is_in_them(solve, tmp_path):
    case = "frequencies = 2\n" + HELD + PUSHED
    report = solve("quad", case, count=4, options=SolverOptions())
    stem = tmp_path / "plate_calculix"
    for name in report.files.values():
        assert (tmp_path / name).is_file(), name
    assert set(report.files) == {"deck", "netcdf", "vtu", "picture", "report", "frd", "dat", "log"}
    assert json.loads(stem.with_suffix(".json").read_text()) == report.as_dict()
    assert report.solved and report.solver == "CalculiX 2.20"
    assert "largest displacement" in report.summary()
    assert report.mass == pytest.approx((0.5 * 1760 + 0.5 * 1200) * 2e-3 * SIDE**2, rel=1e-12)
    with xr.open_dataset(stem.with_suffix(".nc")) as results:
        assert results["eigenfrequency"].values == pytest.approx(report.eigenfrequencies)
        assert results["mode_shape_z"].shape == (2, 25)
        largest = np.hypot.reduce([results[f"structural_displacement_{a}"].values for a in "xyz"])
        assert largest.max() == pytest.approx(report.displacement_max, rel=1e-6)
        assert results.attrs["structure_solver"] == "CalculiX 2.20"
        assert {"thickness", "fibre_direction_2_x", "mapping_status"} <= set(results.variables)
        for name, variable in results.data_vars.items():
            if name.startswith(("stress", "strain", "laminate", "structural", "mode_shape")):
                assert {"units", "long_name", "mesh", "location"} <= set(variable.attrs), name
    mesh = meshio.read(stem.with_suffix(".vtu"))
    assert mesh.cells[0].type == "quad8"
    assert np.linalg.norm(mesh.point_data["mode_1"], axis=1).max() == pytest.approx(1.0)


@needs_calculix
def test_netcdf_opens_elsewhere(solve, tmp_path):
    solve("quad", "frequencies = 2\n" + HELD + PUSHED, count=4)
    path = tmp_path / "plate_calculix.nc"
    checks = pytest.importorskip("ugrid_checks.check")
    checker = checks.check_dataset(path, print_summary=False)
    assert not checker.logger.report_statement_logrecords(), checker.checking_report()
    xugrid = pytest.importorskip("xugrid")
    with xugrid.open_dataset(path) as opened:
        assert opened["stress_11"].ugrid.grid.n_face == 16


def test_without_calculix_the_deck_is_there_and_said(solve, tmp_path):
    options = SolverOptions(command="no-such-solver", picture=False)
    report = solve("quad", HELD + PUSHED, count=4, options=options)
    assert not report.solved
    (told,) = [w for w in report.warnings if "not installed" in w]
    assert "no-such-solver -i plate_calculix" in told and "apt install calculix-ccx" in told
    deck = (tmp_path / "plate_calculix.inp").read_text()
    assert "*INCLUDE, INPUT=plate_calculix_sections.inp" in deck and "*STATIC" in deck
    with xr.open_dataset(tmp_path / "plate_calculix.nc") as results:
        assert "laminate_A_11" in results and "stress_11" not in results


def test_without_loads_the_deck_has_no_step(solve, tmp_path):
    report = solve("quad", "", count=4)
    assert "*STEP" not in (tmp_path / "plate_calculix.inp").read_text()
    assert any("without a step" in warning for warning in report.warnings)


@pytest.mark.parametrize(
    ("script", "message"),
    [
        ("echo ' *ERROR in u_calloc: no memory'; echo; exit 1", "no memory"),
        ("echo '*ERROR reading *DLOAD'; echo ' Job finished'", "reading"),
        ("echo 'Version 2.20'; exit 255", "exit code 255"),
        ("echo 'Version 2.20'", "before its job was finished"),
        ("kill -9 $$", "SIGKILL; it may need more memory"),
    ],
)
def test_a_failed_solver_is_an_error_with_its_words(solve, tmp_path, script, message):
    with pytest.raises(SolverError, match=message) as error:
        solve("quad", HELD + PUSHED, count=2, options=fake(tmp_path / "solver", script))
    assert str(tmp_path / "plate_calculix.log") in str(error.value)
    assert (tmp_path / "plate_calculix.log").is_file()
    assert (tmp_path / "plate_calculix.inp").is_file()


def test_a_solver_that_takes_too_long_is_stopped(solve, tmp_path):
    case = 'time_limit = "0.3 s"\n' + HELD + PUSHED
    with pytest.raises(SolverError, match="did not finish within 0.3 s"):
        solve("quad", case, count=2, options=fake(tmp_path / "solver", "exec sleep 60"))


def test_results_that_miss_something_are_refused(solve, tmp_path):
    script = "echo 9999 > plate_calculix.frd; touch plate_calculix.dat; echo 'Job finished'"
    with pytest.raises(InputError, match="0 static states and 0 modes"):
        solve("quad", HELD + PUSHED, count=2, options=fake(tmp_path / "solver", script))


@needs_calculix
def test_a_part_that_nothing_holds_is_an_error(solve):
    loose = condition("supports", "one", point='"0 0 0 m"', fixed='["x"]')
    with pytest.raises(SolverError, match="supports do not hold the part"):
        solve("quad", loose + PUSHED, count=2)


@pytest.mark.parametrize(
    ("case", "message"),
    [
        (condition("supports", "a", set='"RIM"'), r'supports\[0\] "a".set: the mesh has no set'),
        (
            condition("supports", "a", plane=plane([1, 0, 0], -0.05)),
            r'supports\[0\] "a": no node lies within .* nearest is 50 mm away, node \d+ at \(0',
        ),
        (
            condition("supports", "a", point='"0 0 1.2 m"'),
            r'supports\[0\] "a".point: \(0.00, 0.00, 1200.00\) mm lies off the mesh: the nearest '
            r"node is 1 at \(0.00, 0.00, .*\) mm, 1200 mm away, farther than the longest edge of a "
            r"cell \(100 mm\)",
        ),
        (
            HELD + condition("loads", "p", point='["100 m", "0 m", "0 m"]', force='"0 0 1 N"'),
            r'loads\[0\] "p".point: \(100000.00, .* lies off the mesh',
        ),
        (
            'elements = "as_mesh"\nlay_up = "stacked"\n',
            "layers in S8R and S6 elements only, not in S4",
        ),
    ],
)
def test_wrong_cases_name_the_entry(solve, tmp_path, case, message):
    with pytest.raises(InputError, match=message):
        solve("quad", case, count=2)
    assert not list(tmp_path.glob("plate_calculix*"))


def test_a_force_on_held_nodes_alone_is_told_to_load_nothing(solve):
    corner = condition("loads", "corner", point='"0 0 0 m"', force='"0 0 -10 N"')
    free = HELD.replace("[[supports]]", '[[supports]]\nfixed = ["x", "y"]', 1)
    options = SolverOptions(run=False)
    (told,) = [w for w in solve("quad", HELD + corner, count=2, options=options).warnings
               if "loads nothing" in w]  # fmt: skip
    assert told.startswith('loads[0] "corner" loads nothing: supports hold all of its 1 nodes')
    for case in (free + corner, HELD + PUSHED):
        found = solve("quad", case, count=2, options=options).warnings
        assert not any("loads nothing" in warning for warning in found)


def test_rotations_and_pressure_of_solids(solve):
    with pytest.raises(InputError, match="no rotations"):
        solve("hexahedron", condition("supports", "a", point='"0 0 0 m"', fixed='["rx"]'), count=2)
    case = condition("supports", "a", point='"0 0 0 m"')
    with pytest.raises(InputError, match="needs its place"):
        solve("hexahedron", case + condition("loads", "p", pressure='"1 Pa"'), count=2)
    with pytest.raises(InputError, match="no outer edge"):
        solve("hexahedron", HELD, count=2)


def change(name, values):
    def apply(mapped):
        if values is None:
            return mapped.drop_vars(name)
        mapped[name].values[:2] = values
        return mapped

    return apply


@pytest.mark.parametrize(
    ("apply", "message"),
    [
        (change("fibre_volume_fraction", None), "no fibre_volume_fraction; give material.fibre_d"),
        (change("thickness", None), "no thickness; form the sheet with element"),
        (change("thickness", np.nan), r"2 of 4 cells have no sheet .*\(cell 1, 2\)"),
        (change("fibre_volume_fraction", 1.2), "2 cells is not between 0 and 1"),
        (change("fibre_direction_2_x", 1.0), None),
        (lambda m: m.isel(target_face=[0]), "holds 1 cells and the mesh 4"),
    ],
)
def test_mapped_files_that_will_not_do(kit, write_mesh, tmp_path, apply, message):
    mesh = write_mesh(*kit.plate("quad", count=2), "mesh.vtu")
    map_file(kit.formed(), mesh, tmp_path / "plate.nc", picture=False)
    with xr.open_dataset(tmp_path / "plate.nc", mask_and_scale=False) as opened:
        mapped = apply(opened.load())
    if message is None:  # the second family lies upon the first
        mapped["fibre_direction_2_y"].values[:2] = 0.0
        message = "both fibre families run in the same direction in 2 cells"
    with pytest.raises(InputError, match=message):
        analyse(mapped, mesh, structure_from_text(MATERIAL), name="p", out_dir=tmp_path)
    assert not list(tmp_path.glob("p_calculix*"))


def test_thickness_steps_keep_the_fibre_mass(kit, write_mesh, tmp_path):
    """Nodes take mean thicknesses; the cells' fibre volume fraction makes up for it."""
    mesh = write_mesh(*kit.plate("quad", count=4), "mesh.vtu")
    map_file(kit.formed(), mesh, tmp_path / "plate.nc", picture=False)
    with xr.open_dataset(tmp_path / "plate.nc", mask_and_scale=False) as opened:
        mapped = opened.load()
    thickness = 2e-3 * (1.0 + 0.2 * np.random.default_rng(2).uniform(-1, 1, 16))
    mapped["thickness"].values[:] = thickness
    mapped["fibre_volume_fraction"].values[:] = 0.5 * 2e-3 / thickness
    report = analyse(mapped, mesh, structure_from_text(MATERIAL), name="p", out_dir=tmp_path)
    with xr.open_dataset(tmp_path / "p_calculix.nc") as results:
        deck = results["deck_thickness"].values
        np.testing.assert_allclose(deck * results["deck_fibre_volume_fraction"].values, 1e-3)
        assert np.abs(deck / thickness - 1.0).max() == pytest.approx(report.thickness_error_max)
    assert report.thickness_error_max > 0.05
    assert any("between neighbouring cells" in warning for warning in report.warnings)


def test_numbers_and_sets_of_the_mesh_stand_in_the_deck(kit, write_mesh, tmp_path):
    points, ((name, cells),) = kit.plate("quad", count=2)
    target = TargetMesh(
        points, ((name, cells),), {}, cell_ids=[11, 7, 30, 5], node_ids=50 - np.arange(9),
        cell_sets={"half part": np.array([0, 1])}, node_sets={"Left": np.array([0, 1, 2])},
    )  # fmt: skip
    mesh = write_mesh(points, [(name, cells)], "mesh.vtu")
    map_file(kit.formed(), mesh, tmp_path / "plate.nc", picture=False)
    case = condition("supports", "hold", set='"Left"')
    case += condition("loads", "p", set='"half part"', pressure='"5 Pa"')
    options = SolverOptions(run=False, picture=False)
    with xr.open_dataset(tmp_path / "plate.nc", mask_and_scale=False) as mapped:
        # Without the numbers of the file, which are not those of this target.
        own = mapped.load().drop_vars("node_id")
        analyse(own, target, structure_from_text(MATERIAL + case), name="p",
                out_dir=tmp_path, options=options)  # fmt: skip
    text = (tmp_path / "p_calculix_mesh.inp").read_text().splitlines()
    element = text.index("*ELEMENT, TYPE=S8R, ELSET=LCM_ELEMENTS") + 1
    assert text[element].startswith("11, 50, 47, 46, 49, ")
    middles = sorted(int(n) for n in text[text.index("*NSET, NSET=LEFT") + 1].split(",")[:-1])
    assert middles[:3] == [48, 49, 50]
    assert len(middles) == 5 and middles[3] > 50  # and the two nodes between them
    assert text[text.index("*ELSET, ELSET=HALF_PART") + 1] == "11, 7,"
    deck = (tmp_path / "p_calculix.inp").read_text()
    assert "11, P, 5.0" in deck and "7, P, 5.0" in deck and "30, P" not in deck
    assert deck.count(", 1, 1") == 5


@needs_calculix
def test_shared_materials_stay_within_the_tolerance(kit, write_mesh, tmp_path):
    mesh = write_mesh(*kit.plate("quad", count=6), "mesh.vtu")
    map_file(kit.formed(), mesh, tmp_path / "plate.nc", picture=False)
    with xr.open_dataset(tmp_path / "plate.nc", mask_and_scale=False) as opened:
        mapped = opened.load()
    mapped["fibre_volume_fraction"].values[:] = np.linspace(0.45, 0.55, 36)
    reports = {}
    for tolerance in (0.0, 0.02):
        case = f"material_tolerance = {tolerance}\nfrequencies = 2\n" + HELD
        reports[tolerance] = analyse(
            mapped, mesh, structure_from_text(MATERIAL + case), name="p", out_dir=tmp_path,
            options=SolverOptions(picture=False),
        )  # fmt: skip
    own, shared = reports[0.0], reports[0.02]
    assert own.material_count == 36 and own.material_error_max == 0.0
    assert 3 <= shared.material_count <= 18
    assert 0.0 < shared.material_error_max <= 0.02
    np.testing.assert_allclose(shared.eigenfrequencies, own.eigenfrequencies, rtol=0.01)


def test_plies_of_a_stack_have_their_own_directions(kit, write_mesh, tmp_path):
    """Plies at 0/90 and at 45/-45 with equal shares: the same stiffness in every direction."""
    mesh = write_mesh(*kit.plate("quad", count=2), "mesh.vtu")
    map_file(kit.formed(), mesh, tmp_path / "plate.nc", picture=False)
    with xr.open_dataset(tmp_path / "plate.nc", mask_and_scale=False) as opened:
        mapped = opened.load()
    face = mapped["thickness"].dims
    for name, angle, share in (("lower", 0.0, 0.5), ("upper", np.pi / 4, 0.5)):
        mapped[f"ply_share_{name}"] = (face, np.full(4, share))
        mapped[f"{name}_fibre_volume_fraction"] = mapped["fibre_volume_fraction"]
        for family, turn in ((1, angle), (2, angle + np.pi / 2)):
            for axis, value in zip("xyz", (np.cos(turn), np.sin(turn), 0.0)):
                values = np.full(4, value)
                mapped[f"{name}_fibre_direction_{family}_{axis}"] = (face, values)
    mapped["ply_share_upper"].values[3] = 0.0  # one cell with the lower ply alone
    mapped["ply_share_lower"].values[3] = 1.0
    mapped["upper_fibre_direction_1_x"].values[3] = np.nan
    structure = structure_from_text(MATERIAL)
    report = analyse(mapped, mesh, structure, name="p", out_dir=tmp_path)
    assert any("2 plies are taken as mixed" in warning for warning in report.warnings)
    with xr.open_dataset(tmp_path / "p_calculix.nc") as results:
        A11, A22, A12, A66 = (results[f"laminate_A_{k}"].values for k in ("11", "22", "12", "66"))
    np.testing.assert_allclose(A11, A22, rtol=1e-9)
    np.testing.assert_allclose(A66[:3], 0.5 * (A11 - A12)[:3], rtol=1e-9)
    assert A66[3] < 0.3 * (A11 - A12)[3]
    stacked = structure_from_text(MATERIAL + 'lay_up = "stacked"')
    with pytest.raises(InputError, match="needs the order of the plies"):
        analyse(mapped, mesh, stacked, name="q", out_dir=tmp_path)


def test_a_mapped_file_in_another_unit_of_length_is_told(kit, write_mesh, tmp_path):
    points, blocks = kit.plate("quad", count=2)
    mesh = write_mesh(1e3 * points, blocks, "mesh.vtu")
    map_file(kit.formed(), mesh, tmp_path / "plate.nc", length_unit="mm", picture=False)
    case = structure_from_text(MATERIAL)
    with pytest.raises(InputError, match="nodes of the mapped file lie up to 2e.05 mm away"):
        analyse(tmp_path / "plate.nc", mesh, case, name="p", out_dir=tmp_path)
    analyse(tmp_path / "plate.nc", mesh, case, name="p", out_dir=tmp_path, length_unit="mm")


def test_of_all_saved_states_the_mapped_one_is_taken(kit, write_mesh, tmp_path):
    """The first of two states of the sheet has half its fields (see the maker)."""
    mesh = write_mesh(*kit.plate("quad", count=2), "mesh.vtu")
    source = kit.formed().assign_coords(time=("time", [0.0, 0.1]))
    found = {}
    for all_frames in (False, True):
        options = {"all_frames": all_frames, "picture": False}
        map_file(source, mesh, tmp_path / "plate.nc", **options)
        report = analyse(
            tmp_path / "plate.nc", mesh, structure_from_text(MATERIAL), name="p", out_dir=tmp_path
        )
        found[all_frames] = report.mass, report.fibre_volume_fraction_max
    assert found[True] == pytest.approx(found[False], rel=1e-9)


@needs_calculix
def test_numbers_that_calculix_has_no_room_for_stay_in_the_files(kit, write_mesh, tmp_path):
    """Numbers above 1.5e9 overflow what CalculiX reserves; the solution does not depend on them."""
    points, blocks = kit.plate("quad", count=2)
    structure = structure_from_text(MATERIAL + "frequencies = 1\n" + HELD + PUSHED)
    map_file(kit.formed(), write_mesh(points, blocks), tmp_path / "plate.nc", picture=False)
    with xr.open_dataset(tmp_path / "plate.nc", mask_and_scale=False) as opened:
        mapped = opened.load().drop_vars("node_id")
    reports, found = [], []
    for first in (1, 1_500_000_001):
        target = TargetMesh(
            points, blocks, {}, cell_ids=first + np.arange(4), node_ids=first + np.arange(9)
        )
        options = SolverOptions(picture=False)
        report = analyse(mapped, target, structure, name="m", out_dir=tmp_path, options=options)
        reports.append(report)
        with xr.open_dataset(tmp_path / "m_calculix.nc") as results:
            found.append(results[["structural_displacement_z", "stress_11"]].load())
    assert all(report.solved for report in reports)
    assert reports[1].displacement_max_node == reports[0].displacement_max_node + 1_500_000_000
    for name in ("structural_displacement_z", "stress_11"):
        np.testing.assert_array_equal(found[1][name].values, found[0][name].values)
    assert "\n1500000001, " in (tmp_path / "m_calculix_mesh.inp").read_text()
    told = [warning for warning in reports[1].warnings if "counted from 1" in warning]
    assert len(told) == 1 and told[0].startswith("the mesh has numbers up to 1500000021")
    assert not any("counted from 1" in warning for warning in reports[0].warnings)
