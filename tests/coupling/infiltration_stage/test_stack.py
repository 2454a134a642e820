"""A stack of plies is filled as one sheet: its layers conduct side by side and one after the other.

Expected values are those of the closed formulas for flat plies.
"""

import numpy as np
import pytest
from scipy.optimize import brentq

from lcmchain.coupling.infiltration.cell_permeability import factor_of
from lcmchain.coupling.infiltration.files import read_checkpoint, write_checkpoint
from lcmchain.coupling.infiltration.flow.preform import kozeny_factor
from lcmchain.coupling.infiltration.formed_part import read_formed_part, with_permeability
from lcmchain.coupling.infiltration.results import FillingRecord
from lcmchain.coupling.infiltration.setup import set_up
from lcmchain.coupling.infiltration.stage import FillOptions, fill, fill_part
from lcmchain.coupling.mould import Mould
from lcmchain.coupling.permeability import principal_permeabilities
from lcmchain.coupling.solids.stack_compaction import compaction_of
from lcmchain.errors import InputError
from lcmchain.fields.netcdf_file import ROOT, open_netcdf, write_netcdf
from lcmchain.fields.ugrid import UgridMesh
from lcmchain.mapping import map_file
from lcmchain.mapping.sheet import PrincipalPermeability
from lcmchain.mapping.surfaces.averages import through_layers
from lcmchain.scene import scene_from_text
from lcmchain.scene.infiltration.laws import GebartPermeability, KozenyCarmanPermeability

from .conftest import LENGTH, PRESSURE, VISCOSITY, WIDTH, strip, write_forming

PLAIN = FillOptions(picture=False, vtu=False)
#: Thickness, fibre volume fraction, principal permeabilities and the angle of the first axis.
LOWER = (2e-3, 0.5, (4e-10, 1e-10, 2e-11), 0.0)
UPPER = (1e-3, 0.6, (2e-10, 5e-11, 8e-12), 90.0)


def fields_of(ply):
    """Fields of a ply, whose fibres lie along the axes of its permeability."""
    thickness, fraction, values, degrees = ply
    turn = np.radians(degrees)
    axes = np.array([[np.cos(turn), np.sin(turn), 0.0], [-np.sin(turn), np.cos(turn), 0.0]])
    found = {"thickness": thickness, "fibre_volume_fraction": fraction,
             "areal_fibre_mass": 1800.0 * thickness * fraction}  # fmt: skip
    for number, (value, axis) in enumerate(zip(values, [*axes, [0.0, 0.0, 1.0]]), start=1):
        found[f"permeability_{number}"] = value
        for name, part in zip("xyz", axis):
            found[f"permeability_direction_{number}_{name}"] = part
            if number < 3:
                found[f"fibre_direction_{number}_{name}"] = part
    return found


def write_stack(path, *plies, names=("lower", "upper")):
    """A result of plies over each other: (mesh, ply) of each, the first lies lowest."""
    sheets, points, quads, height = [], [], [], 0.0
    for (own, cells), ply in plies:
        write_forming(path, own, cells, **fields_of(ply))
        with open_netcdf(path) as dataset:
            sheets.append(dataset.load())
        quads.append(cells + sum(map(len, points)))
        points.append(own + [0.0, 0.0, height + 0.5 * ply[0]])
        height += ply[0]
    mesh = UgridMesh("sheet")
    variables = {
        **mesh.topology(np.concatenate(quads), long_name="sheets"),
        **mesh.node_positions(np.concatenate(points)),
    }
    for name, variable in sheets[0].data_vars.items():
        if variable.dims == (mesh.cell_dimension,):
            values = np.concatenate([sheet[name].values for sheet in sheets])
            variables[name] = mesh.on_cells(values, dict(variable.attrs))
    flags = np.arange(len(plies), dtype=np.int32)
    about = {"flag_values": flags, "flag_meanings": " ".join(names), "long_name": "ply"}
    of_face = np.repeat(flags, [len(cells) for cells in quads])
    variables["body"] = mesh.on_cells(of_face, about | {"units": "1"})
    write_netcdf(path, {ROOT: mesh.dataset(variables, dict(sheets[0].attrs))})
    return path


def stack_of(folder, lower=LOWER, upper=UPPER, upper_mesh=None):
    """Two plies of unlike meshes; the lower one is the larger."""
    upper_mesh = strip(8, 4) if upper_mesh is None else upper_mesh
    return write_stack(folder / "forming.nc", (strip(), lower), (upper_mesh, upper))


def tensor(part):
    """Permeability (C, 3, 3) of the cells."""
    total = 0.0
    for number in (1, 2, 3):
        axis = np.stack([part.cell(f"permeability_direction_{number}_{a}") for a in "xyz"], axis=1)
        value = part.cell(f"permeability_{number}")[:, None, None]
        total = total + value * axis[:, :, None] * axis[:, None, :]
    return total


def tensor_of(values, degrees):
    turn = np.radians(degrees)
    axis = np.array([np.cos(turn), np.sin(turn)])
    across = np.array([-axis[1], axis[0]])
    return values[0] * np.outer(axis, axis) + values[1] * np.outer(across, across)


def expected_tensor(*plies):
    """In the plane the mean by thickness, through it the harmonic one."""
    total = sum(ply[0] for ply in plies)
    found = np.zeros((3, 3))
    found[:2, :2] = sum(ply[0] / total * tensor_of(ply[2], ply[3]) for ply in plies)
    found[2, 2] = total / sum(ply[0] / ply[2][2] for ply in plies)
    return found


@pytest.mark.parametrize("degrees", [90.0, 30.0])
def test_two_plies_have_the_permeability_of_their_layers(tmp_path, degrees):
    upper = (*UPPER[:3], degrees)
    part = read_formed_part(stack_of(tmp_path, upper=upper))
    assert part.target.cell_count == 36 and part.warnings == ()
    expected = expected_tensor(LOWER, upper)
    assert (abs(expected[0, 1]) > 1e-11) == (degrees != 90.0)
    np.testing.assert_allclose(tensor(part), np.tile(expected, (36, 1, 1)), rtol=0, atol=1e-21)
    np.testing.assert_allclose(part.cell("thickness"), 3e-3, rtol=1e-12)
    fraction = (2.0 * 0.5 + 1.0 * 0.6) / 3.0
    np.testing.assert_allclose(part.cell("fibre_volume_fraction"), fraction, rtol=1e-12)
    mass = 1800.0 * (2e-3 * 0.5 + 1e-3 * 0.6)
    np.testing.assert_allclose(part.cell("areal_fibre_mass"), mass, rtol=1e-12)
    np.testing.assert_allclose(part.cell("ply_share_upper"), 1.0 / 3.0, rtol=1e-12)
    assert part.dataset["upper_fibre_volume_fraction"].attrs["long_name"].endswith("ply upper")


def test_a_channel_of_two_plies_fills_as_the_closed_formula_says(kit, tmp_path):
    expected = expected_tensor(LOWER, UPPER)
    porosity = 1.0 - 1.6 / 3.0
    time = porosity * VISCOSITY * LENGTH**2 / (2.0 * expected[0, 0] * PRESSURE)
    report = fill_part(
        stack_of(tmp_path), kit.case(), name="stack", out_dir=tmp_path, options=PLAIN
    )
    assert report.outcome == "filled"
    assert report.time == pytest.approx(time, rel=0.02)
    assert report.pore_volume == pytest.approx(LENGTH * WIDTH * 3e-3 * porosity, rel=1e-9)


def test_where_the_upper_ply_ends_the_lower_one_is_alone(kit, tmp_path):
    """Two zones one after the other, of unlike thickness, porosity and permeability."""
    patch = strip(6, 4, length=0.5 * LENGTH)
    path = stack_of(tmp_path, upper_mesh=patch)
    part = read_formed_part(path)
    left = part.target.centroids[:, 0] < 0.5 * LENGTH
    assert left.sum() == 18
    np.testing.assert_allclose(part.cell("thickness"), np.where(left, 3e-3, 2e-3), rtol=1e-12)
    assert np.isnan(part.cell("upper_thickness")[~left]).all()
    alone = expected_tensor(LOWER)
    np.testing.assert_allclose(tensor(part)[~left], np.tile(alone, (18, 1, 1)), atol=1e-21)
    both = expected_tensor(LOWER, UPPER)[0, 0]
    half, porosities = 0.5 * LENGTH, (1.0 - 1.6 / 3.0, 0.5)
    flow = np.array([both * 3e-3, alone[0, 0] * 2e-3]) / VISCOSITY  # per width and gradient
    first = porosities[0] * 3e-3 * half**2 / (2.0 * flow[0] * PRESSURE)
    second = porosities[1] * 2e-3 * half**2 / PRESSURE * (1.0 / flow[0] + 0.5 / flow[1])
    report = fill_part(path, kit.case(), name="step", out_dir=tmp_path, options=PLAIN)
    assert report.time == pytest.approx(first + second, rel=0.02)


def test_a_ply_twice_fills_as_one_of_twice_its_thickness(kit, tmp_path):
    twice = stack_of(tmp_path, LOWER, LOWER, strip())
    double = write_forming(tmp_path / "one.nc", *strip(), **fields_of((2.0 * LOWER[0], *LOWER[1:])))
    one, other = (
        fill_part(path, kit.case(), name=path.stem, out_dir=tmp_path, options=PLAIN)
        for path in (twice, double)
    )
    assert one.time == pytest.approx(other.time, rel=1e-9)
    assert one.pore_volume == pytest.approx(other.pore_volume, rel=1e-12)
    assert one.gates["left"]["pressure_max"] == other.gates["left"]["pressure_max"]


def test_a_law_acts_in_every_ply_by_itself(tmp_path):
    """Their fibre volume fractions and directions are unlike: a mean of them has no meaning."""
    law = GebartPermeability(law="gebart", fibre_radius=3.5e-6)
    upper = (*UPPER[:3], 30.0)
    part = with_permeability(read_formed_part(stack_of(tmp_path, upper=upper)), law)
    layers = []
    for thickness, fraction, _, degrees in (LOWER, upper):
        # the families are at right angles: all directions of the plane are alike
        families = np.eye(3)[:2]
        found = principal_permeabilities(law, np.array([fraction]), *families[:, None])
        values = [float(k[0]) for k in (found.k1, found.k2, found.k3)]
        layers.append((thickness, fraction, values, degrees))
    expected = np.tile(expected_tensor(*layers), (36, 1, 1))
    np.testing.assert_allclose(tensor(part), expected, rtol=0, atol=1e-9 * expected.max())
    assert part.cell("permeability_3")[0] != pytest.approx(
        float(principal_permeabilities(law, np.array([1.6 / 3.0]), *families[:, None]).k3[0]),
        rel=0.1,
        abs=0.0,
    )


def test_a_mapped_stack_has_the_same_permeability(kit, tmp_path, write_quads):
    upper = (*UPPER[:3], 30.0)
    source = stack_of(tmp_path, upper=upper)
    points, quads = strip(7, 2)
    mesh = write_quads(points + [0.0, 0.0, 1.5e-3], quads)
    map_file(source, mesh, tmp_path / "mapped.nc", kind="infiltration", picture=False)
    part = read_formed_part(tmp_path / "mapped.nc")
    expected = np.tile(expected_tensor(LOWER, upper), (14, 1, 1))
    np.testing.assert_allclose(tensor(part), expected, rtol=0, atol=1e-19)
    law = GebartPermeability(law="gebart", fibre_radius=3.5e-6)
    own = with_permeability(read_formed_part(source), law)
    mapped = with_permeability(part, law)
    for name in ("permeability_1", "permeability_3"):
        value = own.cell(name)[0]
        np.testing.assert_allclose(mapped.cell(name), value, rtol=1e-9)


@pytest.fixture
def write_quads(tmp_path):
    import meshio

    def write(points, quads):
        meshio.Mesh(points, [("quad", quads)]).write(tmp_path / "target.vtu")
        return tmp_path / "target.vtu"

    return write


def test_a_region_makes_all_plies_as_much_denser(kit, tmp_path):
    text = 'time = "1 h"\nresin = { law = "constant", viscosity = "0.1 Pa*s" }\n' \
           'permeability = { law = "gebart", fibre_radius = "3.5 um" }\n' \
           '[[regions]]\nname = "dense"\nbox = ["-1 -1 -1 mm", "150 61 9 mm"]\n' \
           "fibre_volume_fraction = 0.6\n"  # fmt: skip
    gate = '[[gates]]\nname = "left"\nbox = ["0 -1 -1 mm", "0 61 9 mm"]\npressure = "1 bar"\n'
    vent = '[[vents]]\nname = "right"\nbox = ["300 -1 -1 mm", "300 61 9 mm"]\n'
    part = set_up(read_formed_part(stack_of(tmp_path)), kit.case(text, gate, vent)).part
    dense = part.target.centroids[:, 0] < 0.15
    change = np.where(dense, 0.6 / (1.6 / 3.0), 1.0)
    np.testing.assert_allclose(part.cell("lower_fibre_volume_fraction"), 0.5 * change, rtol=1e-12)
    np.testing.assert_allclose(part.cell("upper_fibre_volume_fraction"), 0.6 * change, rtol=1e-12)
    assert part.cell("permeability_1")[dense].max() < 0.7 * part.cell("permeability_1")[~dense][0]


def test_what_lies_beside_the_largest_ply_is_named(tmp_path):
    points, quads = strip(6, 4, length=0.5 * LENGTH)
    part = read_formed_part(stack_of(tmp_path, upper_mesh=(points - [0.05, 0.0, 0.0], quads)))
    (warning,) = part.warnings
    assert '33 % of the ply "upper" lie beside "lower"' in warning and "--mesh" in warning
    larger = write_stack(tmp_path / "other.nc", ((points, quads), LOWER), (strip(), UPPER))
    part = read_formed_part(larger)
    assert part.target.cell_count == 36 and part.warnings == ()
    assert part.cell("ply_share_lower").max() == pytest.approx(2.0 / 3.0)


# --- a closure ------------------------------------------------------------------------------------

FABRIC = 'preset = "MD600"\n'
SOFT = FABRIC + 'thickness = "0.8 mm"\ncompaction.c0 = "0.08 MPa"\n'
DOUBLE = FABRIC + 'thickness = "2.008 mm"\nareal_mass = "1.2 kg/m^2"\n'
AREAL_MASS, FIBRE_DENSITY, FREE = 0.6, 1810.0, 1.004e-3
#: A ply of the fabric at 0.95 mm, below its free thickness; it has the fibres of the scene.
FORMED = (0.95e-3, AREAL_MASS / (FIBRE_DENSITY * 0.95e-3), (4e-10, 1e-10, 2e-11), 0.0)
PRESSED = """
time = "400 s"
frames = 5
resin = { law = "constant", viscosity = "0.1 Pa*s", density = "1100 kg/m^3" }
[permeability]
law = "kozeny_carman"
fibre_radius = "40 um"
k_along = 1.0
k_across = 1.0
"""
CLOSING = {
    "bag": 'type = "bag"\npressure = "1 bar"\n',
    "gap": 'type = "gap"\nthickness = "1.7 mm"\nclosing_time = "100 s"\n',
    "press": 'type = "press"\nforce = "1600 N"\n',
    # resin bears what the fibres do not, from the start
    "wet press": 'type = "press"\nforce = "1600 N"\n[[wetted]]\nname = "all"\n'
    'box = ["-1 -1 -1 mm", "301 61 9 mm"]\n',
}
ENDS = """
[[gates]]
name = "left"
box = ["0 -1 -1 mm", "0 61 9 mm"]
pressure = "0.5 bar"
[[vents]]
name = "right"
box = ["300 -1 -1 mm", "300 61 9 mm"]
bleeds = true
"""


def scene_of_plies(*materials, names=("lower", "upper")):
    """Text of a scene whose plies have a material each."""
    plies = "".join(
        f'[[plies]]\nname = "{name}"\nmaterial = "{name}"\nsize = ["300 mm", "60 mm"]\n'
        'edge_length = "20 mm"\n'
        for name in names
    )
    tables = "".join(
        f"[materials.{name}]\n{material}" for name, material in zip(names, materials, strict=True)
    )
    return '[process]\ntime = "1 s"\n' + plies + tables


def with_scene(path, text):
    """Put the scene that formed it into a result."""
    with open_netcdf(path) as dataset:
        changed = dataset.load().assign_attrs(scene=text)
    write_netcdf(path, {ROOT: changed})
    return path


def pressed_stack(folder, *materials, upper=FORMED, upper_mesh=None):
    upper_mesh = strip() if upper_mesh is None else upper_mesh
    path = write_stack(folder / "stack.nc", (strip(), FORMED), (upper_mesh, upper))
    return with_scene(path, scene_of_plies(*materials))


@pytest.mark.parametrize("kind", CLOSING)
def test_two_equal_plies_are_pressed_as_one_sheet_of_twice_their_thickness(kit, tmp_path, kind):
    """The same pressure, force and time; the resin that came is in the part or has left it."""
    case = kit.case(PRESSED, ENDS, "[closure]\n" + CLOSING[kind])
    one = with_scene(
        write_forming(tmp_path / "one.nc", *strip(), **fields_of((2.0 * FORMED[0], *FORMED[1:]))),
        'process = { time = "1 s" }\nblank = { size = ["300 mm", "60 mm"], '
        'edge_length = "20 mm" }\n[material]\n' + DOUBLE,
    )
    stack, sheet = (
        fill(read_formed_part(path), case)
        for path in (pressed_stack(tmp_path, FABRIC, FABRIC), one)
    )
    np.testing.assert_allclose(stack.history.time, sheet.history.time, rtol=1e-9)
    np.testing.assert_allclose(stack.thickness, sheet.thickness, rtol=1e-9)
    np.testing.assert_allclose(stack.history.force, sheet.history.force, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(stack.pressure, sheet.pressure, rtol=1e-6, atol=1e-3)
    assert np.ptp(stack.thickness) > 0.04e-3 and stack.state.full.all()
    assert np.abs(stack.history.balance_error).max() < 1e-10 * stack.history.stored[-1]


def law_of(material, part, ply):
    """Thickness of a ply under a pressure, written apart from the program's."""
    table = scene_from_text(scene_of_plies(material, names=("one",))).stack[0].material.build()
    fraction, own = part.cell(f"{ply}_fibre_volume_fraction"), part.cell(f"{ply}_thickness")
    areas = table.areal_mass / (table.fibre_density * fraction * own)

    def thickness(pressure):
        found = np.full(len(areas), np.nan)
        for cell in np.flatnonzero(np.isfinite(areas)):

            def lacking(stretch, cell=cell):
                return float(table.compaction_pressure(stretch)) / areas[cell] - pressure

            found[cell] = table.thickness * brentq(lacking, 0.5, 1.0, xtol=1e-14)
        return found

    return thickness


def test_a_patch_of_another_fabric_is_pressed_with_the_ply_below(kit, tmp_path):
    """Dry and at last wet: the thickness of every column is the sum of those under one pressure."""
    half = strip(6, 3, length=0.5 * LENGTH)
    upper = (0.75e-3, 0.45, *FORMED[2:])
    path = pressed_stack(tmp_path, FABRIC, SOFT, upper=upper, upper_mesh=half)
    part = read_formed_part(path)
    case = kit.case(PRESSED.replace("400 s", "4000 s"), ENDS.replace("bleeds = true\n", ""),
                    "[closure]\n" + CLOSING["bag"])  # fmt: skip
    filled = fill(part, case)
    for frame, pressure in ((0, 1e5), (-1, 0.5e5)):
        lower, patch = (
            law_of(material, part, ply)(pressure)
            for material, ply in ((FABRIC, "lower"), (SOFT, "upper"))
        )
        assert np.isnan(patch).sum() == 18
        assert np.nanmax(patch) / 0.8e-3 < 0.97 * lower.min() / FREE  # the softer one
        expected = lower + np.nan_to_num(patch)
        np.testing.assert_allclose(
            filled.thickness[frame], expected, rtol=1e-9 if frame == 0 else 2e-3
        )
    assert filled.is_filled
    assert np.abs(filled.history.balance_error).max() < 1e-10 * filled.history.stored[-1]


def test_plies_become_unlike_dense_under_a_closure(tmp_path):
    """The permeability is the mean of the plies as each is compacted, not that of the mean."""
    path = pressed_stack(tmp_path, FABRIC, SOFT, upper=(0.75e-3, 0.45, *FORMED[2:]))
    part = read_formed_part(path)
    pressure = 5e4
    each = [law_of(material, part, ply)(pressure) for material, ply in
            ((FABRIC, "lower"), (SOFT, "upper"))]  # fmt: skip
    start = [law_of(material, part, ply)(2e3) for material, ply in
             ((FABRIC, "lower"), (SOFT, "upper"))]  # fmt: skip
    law = KozenyCarmanPermeability(law="kozeny_carman", fibre_radius=40e-6, k_along=1.0,
                                   k_across=1.0)  # fmt: skip
    fibres = [FORMED[0] * FORMED[1], 0.75e-3 * 0.45]

    def conducts(thicknesses):
        total = 0.0
        for own, volume in zip(thicknesses, fibres, strict=True):
            v = volume / own
            total = total + own * (1.0 - v) ** 3 / v**2
        return total / sum(thicknesses)

    now, before = (sum(fibres) / sum(thicknesses) for thicknesses in (each, start))
    expected = conducts(each) / conducts(start)
    for case_law in (law, None):  # without one it is by Kozeny and Carman too
        given = with_permeability(part, case_law)
        factor = factor_of(given, case_law, None, pressed=True)(now, before)
        if case_law is not None:
            np.testing.assert_allclose(factor, expected, rtol=1e-8)
            of_mean = ((1.0 - now) / (1.0 - before)) ** 3 * (before / now) ** 2
            assert (np.abs(of_mean / expected - 1.0) > 0.02).all()
    values = [FORMED[2][0] + FORMED[2][1]] * 2

    def by_start(thicknesses):
        total = 0.0
        for own, volume, k, v0 in zip(thicknesses, fibres, values, (FORMED[1], 0.45), strict=True):
            total = total + own * k * kozeny_factor(volume / own, v0)
        return total / sum(thicknesses)

    np.testing.assert_allclose(factor, by_start(each) / by_start(start), rtol=1e-8)


def test_a_mapped_stack_is_pressed_as_its_own_faces_are(kit, tmp_path, write_quads):
    source = pressed_stack(tmp_path, FABRIC, SOFT, upper=(0.75e-3, 0.45, *FORMED[2:]))
    points, quads = strip(7, 2)
    mesh = write_quads(points + [0.0, 0.0, 0.85e-3], quads)
    map_file(source, mesh, tmp_path / "mapped.nc", kind="infiltration", picture=False)
    own, mapped = (
        compaction_of(read_formed_part(path)) for path in (source, tmp_path / "mapped.nc")
    )
    thickness = mapped.thickness_under(np.full(14, 4e4))
    np.testing.assert_allclose(thickness, own.thickness_under(np.full(36, 4e4))[0], rtol=1e-9)


def test_a_ply_over_half_of_a_cell_is_pressed_as_half_a_ply(kit, tmp_path, write_quads):
    half = strip(6, 3, length=0.5 * LENGTH)
    upper = (0.75e-3, 0.45, *FORMED[2:])
    source = pressed_stack(tmp_path, FABRIC, SOFT, upper=upper, upper_mesh=half)
    points, quads = strip(7, 2)
    mesh = write_quads(points + [0.0, 0.0, 0.85e-3], quads)
    map_file(source, mesh, tmp_path / "mapped.nc", kind="infiltration", picture=False)
    part = read_formed_part(source)
    lower, patch = (
        law_of(material, part, ply)(4e4)[0]
        for material, ply in ((FABRIC, "lower"), (SOFT, "upper"))
    )
    law = compaction_of(read_formed_part(tmp_path / "mapped.nc"))
    covered = np.repeat([1.0, 1.0, 1.0, 0.5, 0.0, 0.0, 0.0], 2)
    np.testing.assert_allclose(law.thickness, FREE + covered * 0.8e-3, rtol=1e-6)
    found = law.thickness_under(np.full(14, 4e4))
    np.testing.assert_allclose(found, lower + covered * patch, rtol=1e-6)


def test_a_pressed_stack_is_saved_and_restored_to_the_same_bits(kit, tmp_path):
    with_set = FABRIC + 'law = "fabric-with-set"\ncompaction.permanent_set = 0.3\n'
    half = strip(6, 3, length=0.5 * LENGTH)
    path = pressed_stack(tmp_path, with_set, FABRIC, upper_mesh=half)
    case = kit.case(PRESSED, ENDS, "[closure]\n" + CLOSING["bag"])

    def mould():
        setup = set_up(read_formed_part(path), case)
        return Mould(setup.part, setup.filling(), setup.case.closure, 400.0)

    whole = mould()
    whole.advance(20.0)
    write_checkpoint(tmp_path / "state.npz", {}, whole.save(), FillingRecord.empty())
    whole.advance(40.0)
    resumed = mould()
    resumed.restore(read_checkpoint(tmp_path / "state.npz", {})[0])
    resumed.advance(40.0)
    np.testing.assert_array_equal(whole.law.history, resumed.law.history)
    np.testing.assert_array_equal(whole.filling.state.pressure, resumed.filling.state.pressure)
    np.testing.assert_array_equal(whole.solid.thickness, resumed.solid.thickness)
    assert whole.force == resumed.force and whole.law.history.min() < -0.01


def test_a_ply_that_the_scene_does_not_have_is_named(kit, tmp_path):
    path = pressed_stack(tmp_path, FABRIC, FABRIC)
    with_scene(path, scene_of_plies(FABRIC, FABRIC, names=("lower", "middle")))
    with pytest.raises(InputError, match='has the ply "upper", but the scene in it has only lower'):
        compaction_of(read_formed_part(path))
    with_scene(path, 'process = { time = "1 s" }\nmaterial = { preset = "MD600" }\n')
    with pytest.raises(InputError, match="plies: the scene in it has no plies"):
        compaction_of(read_formed_part(path))


def test_tilted_layers_are_turned_into_the_plane_of_the_cell():
    """The tensor turns with the cell, and a layer on a slope keeps its values."""
    generator = np.random.default_rng(3)
    axes = np.linalg.qr(generator.normal(size=(2, 3, 3)))[0]
    values = np.array([[4.0, 1.0, 0.3], [3.0, 2.0, 0.1]])
    layers = [PrincipalPermeability(v[None], a[None]) for v, a in zip(values, axes)]
    thickness = np.array([[2.0], [1.0]])
    normal = axes[:1, 2]
    alone = through_layers(thickness * [[0.0], [1.0]], layers, normal)
    np.testing.assert_allclose(alone.values[0], values[1], rtol=1e-12)
    np.testing.assert_allclose(np.abs(alone.axes[0, 2] @ normal[0]), 1.0, rtol=1e-12)
    both = through_layers(thickness, layers, normal)
    assert both.values[0, 2] == pytest.approx(3.0 / (2.0 / 0.3 + 1.0 / 0.1))
    assert both.values[0, :2].sum() == pytest.approx((2.0 * 5.0 + 5.0) / 3.0)
    turn = np.linalg.qr(generator.normal(size=(3, 3)))[0]
    turned = [PrincipalPermeability(k.values, k.axes @ turn.T) for k in layers]
    again = through_layers(thickness, turned, normal @ turn.T)
    np.testing.assert_allclose(again.values, both.values, rtol=1e-12)
    none = through_layers(0.0 * thickness, layers, normal)
    assert np.isnan(none.values).all()
