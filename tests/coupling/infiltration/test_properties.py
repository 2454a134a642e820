"""What holds for any mesh, tensor and gate: conservation, bounds; and bad input is named."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lcmchain.coupling.infiltration.filling import Filling, FillingOptions
from lcmchain.coupling.infiltration.flow.boundaries import Gate, Schedule, TimeTable, Vent
from lcmchain.coupling.infiltration.flow.film import Film
from lcmchain.coupling.infiltration.flow.network import RaceTrack
from lcmchain.coupling.infiltration.flow.preform import FlowMesh, Preform
from lcmchain.errors import InputError

from .sample_meshes import plate, random_plate


@pytest.mark.parametrize("seed", range(12))
def test_conserves_and_stays_within_bounds(seed):
    random = np.random.default_rng(seed)
    ratio, angle, gates = random.uniform(0.05, 1.0), random.uniform(0.0, np.pi), 1 + seed % 3
    rate, bleeds = bool(seed % 2), bool(seed // 2 % 2)
    mesh = random_plate(0.05, 0.4, 0.3, seed=seed)
    axis = np.array([np.cos(angle), np.sin(angle), 0.0])
    tensor = 1e-10 * (ratio * np.diag([1.0, 1.0, 0.0]) + (1.0 - ratio) * np.outer(axis, axis))
    tensor = tensor * random.uniform(0.3, 3.0, mesh.cell_count)[:, None, None]
    height = random.uniform(0.002, 0.004, mesh.cell_count)
    preform = Preform(height, random.uniform(0.4, 0.6, mesh.cell_count), tensor)
    chosen = random.choice(mesh.node_count, gates + 1, replace=False)
    drive = {"flow_rate": 1e-7} if rate else {"pressure": 1e5}
    filling = Filling(
        mesh, preform, 0.1,
        [Gate(f"gate {k}", [node], **drive) for k, node in enumerate(chosen[1:])],
        [Vent("vent", chosen[:1], closes_when_wet=not bleeds)],
    )  # fmt: skip
    pores = filling.pores

    def check(filling):
        state = filling.state
        assert abs(state.balance_error) <= 1e-10 * state.stored
        assert state.fill.min() >= 0.0 and state.fill.max() <= 1.0
        assert (state.resin_volume >= 0.0).all()
        assert (state.resin_volume <= pores * (1.0 + 1e-12)).all()
        assert state.pressure[~state.full].min(initial=0.0) >= 0.0

    outcome, _ = filling.advance(2000.0, check)
    assert outcome in ("filled", "reached")


@settings(max_examples=5, deadline=None, derandomize=True)
@given(seed=st.integers(0, 10_000), columns=st.integers(3, 12))
def test_pressure_lies_between_vent_and_gate_on_meshes_without_obtuse_angles(seed, columns):
    """All conductances are positive there, and the matrix has the signs of an M-matrix."""
    random = np.random.default_rng(seed)
    mesh = plate(columns, 8, 0.04 * columns, 0.3, triangles=True)
    preform = Preform(
        0.003, 0.5, 1e-10 * random.uniform(0.1, 1.0, mesh.cell_count)[:, None, None] * np.eye(3)
    )
    chosen = random.choice(mesh.node_count, 3, replace=False)
    pressures = random.uniform(0.5e5, 2e5, 2)
    filling = Filling(
        mesh, preform, 0.1,
        [Gate(f"gate {k}", [n], pressure=p) for k, (n, p) in enumerate(zip(chosen[1:], pressures))],
        [Vent("vent", chosen[:1], pressure=1e4)],
    )  # fmt: skip

    def check(filling):
        assert filling.state.pressure.min() >= 1e4 * (1.0 - 1e-9)
        assert filling.state.pressure.max() <= pressures.max() * (1.0 + 1e-9)

    filling.advance(300.0, check)
    assert filling.filled_share > 0.05


def line_fill(mesh, **options):
    return Filling(
        mesh, Preform(0.003, 0.5, 1e-10), 0.1,
        [Gate("inlet", mesh.node_sets["left"], pressure=1e5)],
        [Vent("end", mesh.node_sets["right"])], **options,
    )  # fmt: skip


def test_race_track_runs_ahead():
    mesh = plate(20, 5, 0.3, 0.1)
    bottom = mesh.node_sets["bottom"]
    edges = np.stack([bottom[:-1], bottom[1:]], axis=1)
    track = RaceTrack("edge", edges, 2e-14)
    slow, fast = line_fill(mesh), line_fill(mesh, edges=[track])
    for filling in (slow, fast):
        filling.advance(20.0)
    assert fast.state.stored > 1.1 * slow.state.stored
    reached = [np.nanmax(mesh.points[f.state.fill_time <= 20.0, 0]) for f in (slow, fast)]
    assert reached[1] > reached[0] + 0.05


def test_race_track_alone_fills_like_a_strip_of_its_conductance():
    """Along every line of a strip, channels add to the conductance of the sheet."""
    mesh = plate(30, 1, 0.3, 0.02)
    ends = [mesh.node_sets[side] for side in ("bottom", "top")]
    edges = np.concatenate([np.stack([n[:-1], n[1:]], axis=1) for n in ends])
    sheet = 1e-10 * 0.003 * 0.02
    filling = line_fill(mesh, edges=[RaceTrack("both", edges, 0.5 * sheet)])
    filling.advance(1e4)
    assert filling.time == pytest.approx(225.0 / 2.0, rel=5e-3)


class Water:
    density, gel_cure, initial_cure = 1000.0, np.inf, 0.0
    reacts = depends_on_temperature = False

    def viscosity(self, temperature, cure):
        return np.full(np.shape(cure), 1e-3)


@pytest.mark.parametrize("triangles", [False, True])
def test_gravity_in_a_vertical_strip(triangles):
    """x + H ln(1 - x / H) = -K ρ g t / (µ φ), up to the height H where the column balances."""
    flat = plate(40, 2, 0.4, 0.1, triangles=triangles)
    upright = FlowMesh(flat.points[:, [2, 1, 0]], flat.cells, node_sets=flat.node_sets)
    filling = Filling(
        upright, Preform(0.003, 0.5, 1e-10), Water(),
        [Gate("foot", flat.node_sets["left"], pressure=1000.0 * 9.81 * 0.2)],
        [Vent("top", flat.node_sets["right"])], gravity=np.array([0.0, 0.0, -9.81]),
    )  # fmt: skip
    line = np.linspace(0.0, 0.2, 20_000, endpoint=False)
    times = -(line + 0.2 * np.log(1.0 - line / 0.2)) * 1e-3 * 0.5 / (1e-10 * 1000.0 * 9.81)
    for time, within in ((20.0, 5e-3), (100.0, 5e-3), (500.0, 1e-2), (1e5, 1e-6)):
        filling.advance(time)
        height = filling.state.stored / (0.1 * 0.003 * 0.5)
        assert height == pytest.approx(np.interp(time, times, line, right=0.2), rel=within)
    # Coming to rest takes some steps, however long it lasts.
    assert filling.state.step_count < 150
    assert abs(filling.state.balance_error) <= 1e-10 * filling.state.stored


def test_dry_spot_is_reported_with_place_and_time():
    """Resin comes from all sides; a vent at the rim leaves the air in the middle."""
    mesh = plate(20, 20, 0.2, 0.2)
    rim = mesh.rim
    filling = Filling(
        mesh, Preform(0.003, 0.5, 1e-10), 0.1, [Gate("rim", rim[1:], pressure=1e5)],
        [Vent("corner", rim[:1])],
    )  # fmt: skip
    filling.advance(1e4)
    (spot,) = filling.state.dry_spots
    assert spot.place == pytest.approx([0.1, 0.1, 0.0], abs=0.011)
    assert spot.area > 0.9 * 0.2 * 0.2 * 0.8
    assert 0.0 < spot.time < filling.time


def test_trapped_air_is_compressed():
    """Closed end: the front stops where the air has the gate's pressure, p V = p0 V0."""
    mesh = plate(40, 2, 0.3, 0.1)
    filling = Filling(
        mesh, Preform(0.003, 0.5, 1e-10), 0.1,
        [Gate("inlet", mesh.node_sets["left"], pressure=4e5)], [],
        options=FillingOptions(trapped_air=True, air_pressure=1e5, largest_step=5.0),
    )  # fmt: skip
    filling.advance(300.0)
    assert filling.filled_share == pytest.approx(0.75, rel=1e-3)
    assert filling.state.air_pressure[~filling.state.full] == pytest.approx(4e5, rel=1e-3)


def test_trapped_air_goes_on_from_a_saved_state_to_the_same_bits():
    mesh = random_plate(0.012, 0.3, 0.1, seed=2)
    one, other = (
        Filling(
            mesh, Preform(0.003, 0.5, 1e-10), 0.1,
            [Gate("inlet", mesh.node_sets["left"], pressure=3e5)], [],
            options=FillingOptions(trapped_air=True, air_pressure=1e5),
        )
        for _ in range(2)
    )  # fmt: skip
    for time in (20.0, 23.0, 60.0):
        other.restore(other.save())
        for filling in (one, other):
            filling.advance(time)
    assert one.state.step_count > 20
    for name in ("resin_volume", "pressure", "air_pressure"):
        assert getattr(one.state, name).tobytes() == getattr(other.state, name).tobytes()


def test_vent_that_stays_open_bleeds():
    mesh = plate(10, 2, 0.3, 0.1)
    filling = Filling(
        mesh, Preform(0.003, 0.5, 1e-10), 0.1,
        [Gate("inlet", mesh.node_sets["left"], pressure=1e5)],
        [Vent("end", mesh.node_sets["right"], closes_when_wet=False)],
    )  # fmt: skip
    filling.advance(400.0)
    assert filling.time == 400.0
    steady = 1e-10 / 0.1 * 1e5 / 0.3 * 0.1 * 0.003
    assert filling.state.gate_rate[0] == pytest.approx(steady, rel=1e-9)
    assert filling.state.vented[0] == pytest.approx(steady * (400.0 - 225.0), rel=1e-2)
    assert abs(filling.state.balance_error) <= 1e-10 * filling.state.stored


def test_bad_input_is_named():
    mesh = plate(4, 2, 0.3, 0.1)
    preform = Preform(0.003, 0.5, 1e-10)
    gate, vent = Gate("in", [0], pressure=1.0), Vent("out", [14])
    with pytest.raises(InputError, match="no vent"):
        Filling(mesh, preform, 0.1, [gate], [])
    with pytest.raises(InputError, match="neither a gate"):
        Filling(mesh, preform, 0.1, [], [vent])
    with pytest.raises(InputError, match='"in" names node rows outside'):
        Filling(mesh, preform, 0.1, [Gate("in", [99], pressure=1.0)], [vent])
    with pytest.raises(InputError, match='"in" and to "out"'):
        Filling(mesh, preform, 0.1, [gate], [Vent("out", [0])])
    for bad in (
        {"permeability": 0.0},
        {"permeability": -1e-10},
        {"porosity": 0.0},
        {"thickness": 0.0},
    ):
        given = {"thickness": 0.003, "porosity": 0.5, "permeability": 1e-10} | bad
        with pytest.raises(InputError, match=f"preform.{next(iter(bad))}"):
            Preform(**given)
    with pytest.raises(InputError, match="lies outside the mesh"):
        Gate("nowhere", [], pressure=1.0)
    with pytest.raises(InputError, match="ascend"):
        TimeTable([1.0, 0.0], [0.0, 1.0])
    with pytest.raises(InputError, match="before it opens"):
        Schedule(opens=2.0, closes=1.0)
    with pytest.raises(InputError, match="no cell has"):
        Filling(mesh, preform, 0.1, [gate], [vent], edges=[RaceTrack("far", [[0, 14]], 1e-14)])
    with pytest.raises(InputError, match="rows of a mask"):
        Gate("in", mesh.points[:, 0] < 0.01, pressure=1.0)
    with pytest.raises(InputError, match="three finite numbers"):
        Filling(mesh, preform, Water(), [gate], [vent], gravity=np.array([0.0, np.nan, 0.0]))
    with pytest.raises(InputError, match=r"film.thickness: has the shape \(3,\)"):
        through = Preform(0.003, 0.5, 1e-10, 1e-12)
        Filling(mesh, through, 0.1, [], [vent], film=Film(np.ones(3), 1.0))


@pytest.mark.parametrize("wrong", [np.nan, np.inf])
def test_pressures_and_rates_are_finite_numbers(wrong):
    for what in ({"pressure": wrong}, {"flow_rate": wrong}, {"flow_rate": 1.0, "pressure": wrong}):
        with pytest.raises(InputError, match='of the gate "in" is'):
            Gate("in", [0], **what)
    with pytest.raises(InputError, match='of the vent "out" is'):
        Vent("out", [0], pressure=wrong)


def test_what_a_filling_refuses_changes_nothing():
    mesh = plate(12, 2, 0.3, 0.1)
    one, other = (line_fill(mesh) for _ in range(2))
    for filling in (one, other):
        filling.advance(10.0)
    moved = mesh.points * np.array([1.0, 0.0, 1.0])
    for refused, message in (
        (lambda: one.set_thickness(0.004, rate=np.ones(3)), "thickness rate has the shape"),
        (lambda: one.set_thickness(np.ones(3)), "thickness has the shape"),
        (lambda: one.set_thickness(0.004, lift=np.nan), "lift of cell 0"),
        (lambda: one.set_points(moved), "have no area"),
        (lambda: one.set_points(mesh.points[:5]), "places of the nodes have the shape"),
        (lambda: one.advance(np.nan), "not a number"),
    ):
        with pytest.raises(InputError, match=message):
            refused()
    for filling in (one, other):
        filling.advance(60.0)
        filling.restore(filling.save())
    assert one.state.resin_volume.tobytes() == other.state.resin_volume.tobytes()


def test_part_of_the_mesh_without_a_source_is_an_error():
    one = plate(4, 2, 0.3, 0.1)
    both = FlowMesh(
        np.concatenate([one.points, one.points + [1.0, 0.0, 0.0]]),
        np.concatenate([one.cells, np.where(one.cells < 0, -1, one.cells + 15)]),
    )
    with pytest.raises(InputError, match="can never fill"):
        Filling(
            both,
            Preform(0.003, 0.5, 1e-10),
            0.1,
            [Gate("in", [0], pressure=1.0)],
            [Vent("out", [14])],
        )


def test_meshes_with_gaps_are_noticed():
    mesh = plate(4, 2, 0.3, 0.1)
    doubled = FlowMesh(
        np.concatenate([mesh.points, mesh.points + [0.3, 0.0, 0.0]]),
        np.concatenate([mesh.cells, mesh.cells + 15]),
    )
    assert any("one place" in sentence for sentence in doubled.warnings())
    assert mesh.warnings() == []
    hanging = FlowMesh(
        np.array([[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0], [2, 1, 0], [3, 0, 0], [3, 2, 0.0]]),
        np.array([[0, 1, 2, 3], [1, 5, 4, -1], [4, 6, 2, -1], [4, 5, 6, -1]]),
    )
    assert any("middle of a side" in sentence for sentence in hanging.warnings())
