"""Terzaghi's consolidation as two coupled parts, against the series and between the schemes."""

import contextlib
import math

import numpy as np
import pytest

from lcmchain.coupling.iteration import (
    CoupledPart,
    HasPlaces,
    NotConverged,
    PartFailed,
    WindowControl,
    aitken,
    fixed_point,
    gauss_seidel,
    iqn_ils,
    iqn_mvj,
    jacobi,
)
from lcmchain.coupling.iteration.consolidation import (
    Column,
    FluidColumn,
    OutflowColumn,
    SolidColumn,
    SqueezedColumn,
    coupled_column,
    degree_of_consolidation,
    settlement_share,
)
from lcmchain.errors import InputError

# A preform of 10 mm in an epoxy; T = 1 after 10 s.
COLUMN = Column(height=0.01, cell_count=40, modulus=1e6, permeability=1e-12, viscosity=0.1)
ALL = ("pressure_from_fluid", "fixed_stress", "pressure_from_solid")


def pressure(system):
    """Of the part that gives it."""
    owner = "fluid" if isinstance(system.parts["fluid"], FluidColumn) else "solid"
    return system.get_fields([f"{owner}.pore_pressure"])[f"{owner}.pore_pressure"]


def consolidate(time_factor, windows, scheme, direction="fixed_stress", column=COLUMN, **options):
    time = time_factor * column.time_scale
    system = coupled_column(column, scheme, time / windows, direction=direction, **options)
    system.advance(time)
    return system


def at_strength(gain, **entries):
    """A column and a window in which the slowest mode's fixed point has the eigenvalue -gain."""
    column = Column(**entries)
    return column, column.time_scale / (gain * (math.pi / 2.0) ** 2)


def test_all_parts_satisfy_the_protocol_and_know_their_places():
    for part in (FluidColumn, SolidColumn, OutflowColumn, SqueezedColumn):
        assert isinstance(part(COLUMN), CoupledPart) and isinstance(part(COLUMN), HasPlaces)


@pytest.mark.parametrize(
    ("time_factor", "degree"), [(0.05, 0.25231), (0.197, 0.50034), (0.848, 0.89998), (2.0, 0.99417)]
)
def test_series_of_terzaghi(time_factor, degree):
    assert degree_of_consolidation(time_factor) == pytest.approx(degree, abs=6e-6)


@pytest.mark.parametrize(("time_factor", "degree"), [(0.197, 0.5003), (0.848, 0.9000)])
@pytest.mark.parametrize("direction", ["pressure_from_fluid", "fixed_stress"])
def test_degree_of_consolidation(time_factor, degree, direction):
    system = consolidate(time_factor, 100, iqn_ils(), direction)
    assert settlement_share(system, COLUMN) == pytest.approx(degree, rel=0.004)


def test_pressure_at_the_base():
    """p/p0 = 0.77774 at T = 0.197 (values of section 4.3)."""
    system = consolidate(0.197, 200, iqn_ils())
    assert pressure(system)[0] / COLUMN.load == pytest.approx(0.77774, rel=0.005)


def test_settlement_converges_with_the_first_order_of_the_windows():
    reference = settlement_share(consolidate(0.5, 3200, fixed_point()), COLUMN)
    errors = [
        settlement_share(consolidate(0.5, windows, fixed_point()), COLUMN) - reference
        for windows in (25, 50, 100)
    ]
    orders = [math.log2(errors[i] / errors[i + 1]) for i in range(2)]
    assert orders == pytest.approx([1.0, 1.0], abs=0.1)


def test_pressure_converges_with_the_second_order_of_the_cells():
    def base(cells):
        column = Column(cell_count=cells)
        return pressure(consolidate(0.3, 40, fixed_point(), column=column)).mean()

    coarse, middle, fine = base(10), base(20), base(40)
    assert math.log2((coarse - middle) / (middle - fine)) == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize(
    "direction", ["pressure_from_fluid", "fixed_stress", "pressure_from_solid"]
)
def test_undrained_limit_keeps_the_volume_and_carries_the_load_as_pressure(direction):
    column = Column(permeability=1e-20)
    scheme = fixed_point() if direction != "pressure_from_fluid" else iqn_ils(filter_limit=1e-9)
    if direction == "pressure_from_fluid":
        column = Column(permeability=1e-17)  # a gain of 4e5; beyond, round-off is in the way
    system = coupled_column(column, scheme, 1.0, direction=direction)
    system.advance(2.0)
    below = slice(0, 36)  # the cells at the drained top begin to consolidate
    assert pressure(system)[below] == pytest.approx(column.load, rel=1e-4)
    assert settlement_share(system, column) < 0.02
    thickness = system.get_fields(["solid.thickness"])["solid.thickness"]
    assert thickness[below] == pytest.approx(column.cell, rel=1e-5)


@pytest.mark.parametrize("direction", ["pressure_from_fluid", "fixed_stress"])
def test_drained_limit_settles_at_once_without_pressure(direction):
    column = Column(permeability=1e-6)
    system = coupled_column(column, fixed_point(), 1.0, direction=direction)
    system.advance(2.0)
    assert np.abs(pressure(system)).max() < 1e-4 * column.load
    assert settlement_share(system, column) == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("hardening", [0.0, 8.0])
def test_the_answer_does_not_depend_on_the_scheme(hardening):
    column, window = at_strength(30.0, hardening=hardening, load=4e5)
    answers = []
    for direction, scheme in (
        ("fixed_stress", fixed_point()),
        ("fixed_stress", aitken()),
        ("pressure_from_fluid", aitken(most_iterations=200)),
        ("pressure_from_fluid", iqn_ils()),
        ("pressure_from_fluid", iqn_ils(order="parallel")),
        ("pressure_from_fluid", iqn_mvj()),
        ("pressure_from_fluid", fixed_point(0.05, most_iterations=3000)),
    ):
        system = coupled_column(column, scheme, window, direction=direction, relative=1e-9)
        system.advance(10 * window)
        thickness = system.get_fields(["solid.thickness"])["solid.thickness"]
        answers.append((pressure(system) / column.load, 1.0 - thickness / column.cell))
    for found in answers[1:]:
        assert found[0] == pytest.approx(answers[0][0], abs=1e-6)
        assert found[1] == pytest.approx(answers[0][1], rel=1e-6, abs=1e-6 * answers[0][1].max())


@pytest.mark.parametrize("gain", [0.4, 0.6, 2.0, 10.0])
@pytest.mark.parametrize("scheme", [gauss_seidel, jacobi])
def test_staggered_coupling_grows_as_its_recursion_tells(gain, scheme):
    """The slowest mode obeys p = -gain (p' - p''), Jacobi one window later; unstable above 1/2."""
    column, window = at_strength(gain)
    system = coupled_column(column, scheme(), window, prediction=0)
    sizes = []
    for _ in range(150):
        system.advance(window)
        sizes.append(np.abs(pressure(system)).max())
    growth = math.exp(np.polyfit(np.arange(80), np.log(sizes[-80:]), 1)[0])
    delay = [0.0] if scheme is jacobi else []
    expected = max(abs(np.roots([1.0, *delay, gain, -gain])))
    assert growth == pytest.approx(expected, rel=0.02)
    if scheme is gauss_seidel:
        assert (growth > 1.0) == (gain > 0.5)


@pytest.mark.parametrize("gain", [4.0, 40.0])
def test_where_staggered_coupling_diverges_the_implicit_schemes_converge(gain):
    """Aitken within 20, IQN-ILS within 8 iterations a window; the plain fixed point fails."""
    column, window = at_strength(gain)
    with pytest.raises(NotConverged):
        coupled_column(column, fixed_point(), window).advance(window)
    counts = {}
    for scheme in (aitken(), iqn_ils()):
        system = coupled_column(column, scheme, window)
        system.advance(20 * window)
        counts[scheme.name] = system.history.mean_iterations
    assert counts["Aitken"] <= 20.0
    assert counts["IQN-ILS"] <= 5.0


@pytest.mark.parametrize("gain", [4e2, 4e3, 4e4])
def test_iqn_ils_converges_where_aitken_does_not(gain):
    column, window = at_strength(gain)
    with pytest.raises(NotConverged):
        coupled_column(column, aitken(), window).advance(window)
    system = coupled_column(column, iqn_ils(), window)
    system.advance(20 * window)
    assert system.history.mean_iterations <= 5.0


@pytest.mark.parametrize("gain", [1e-2, 1.0, 1e2, 1e4, 1e6])
@pytest.mark.parametrize("factor", [0.55, 1.0, 2.0, 5.0])
def test_fixed_stress_contracts_for_every_stiffness(gain, factor):
    """|C' - C| / (C' + a dt) <= |1 - 1/factor| or |factor - 1| / factor; nothing depends on K."""
    column, window = at_strength(gain)
    scheme = fixed_point(most_iterations=400)
    system = coupled_column(
        column, scheme, window, direction="fixed_stress", slope_factor=factor, prediction=0
    )
    system.advance(window)
    rate = abs(factor - 1.0) / factor
    residuals = np.array([record.residual[1] for record in system.history.iterations])
    assert np.all(residuals[2:] <= (rate + 1e-6) * residuals[1:-1] + 1e-10 * column.load)
    slowest = (factor - 1.0) / (factor + 1.0 / gain)  # of the slowest mode, the most persistent
    if factor > 1.0 and gain >= 1.0:
        late = (residuals[-1] / residuals[-3]) ** 0.5
        assert late == pytest.approx(slowest, rel=0.05)


def test_fixed_stress_with_too_small_a_slope_diverges():
    """From half the compliance on it contracts, below it does not."""
    column, window = at_strength(1e3)
    system = coupled_column(
        column, fixed_point(), window, direction="fixed_stress", slope_factor=0.45
    )
    with pytest.raises((NotConverged, PartFailed)):
        system.advance(window)


def test_bounds_of_the_pressure_keep_a_hardening_law_in_its_range():
    """Without them the first guesses lie far above the load, from where a law may not come back."""
    column = Column(modulus=1e5, hardening=8.0, permeability=1e-14)

    def tried(system, windows):
        seen = []
        give = system.parts["solid"].set_fields

        def look(given):
            seen.append(given["pore_pressure"].max() / column.load)
            assert given["pore_pressure"].min() >= 0.0 or bounds is None
            give(given)

        system.parts["solid"].set_fields = look
        with contextlib.suppress(NotConverged):
            system.advance(windows)
        return max(seen)

    bounds = None
    assert tried(coupled_column(column, iqn_ils(), 1.0), 1.0) > 10.0
    bounds = (0.0, 1.1 * column.load)
    system = coupled_column(column, iqn_ils(), 1.0, bounds=bounds)
    assert tried(system, 5.0) == pytest.approx(1.1, rel=1e-15)
    assert system.time == 5.0
    split = coupled_column(column, fixed_point(), 1.0, direction="fixed_stress")
    split.advance(5.0)
    assert pressure(system) == pytest.approx(pressure(split), abs=1e-5 * column.load)


def test_fixed_stress_adds_nothing_to_the_converged_answer():
    """With a wrong slope too: only the way there changes."""
    column, window = at_strength(5.0)
    plain = coupled_column(column, iqn_ils(), window, relative=1e-10)
    wrong = coupled_column(
        column, iqn_ils(), window, direction="fixed_stress", slope_factor=3.0, relative=1e-10
    )
    for system in (plain, wrong):
        system.advance(5 * window)
    assert pressure(wrong) == pytest.approx(pressure(plain), rel=1e-8)


def test_the_fluid_takes_all_volume_that_the_solid_gives():
    """Outflow through the top over all windows equals the settlement, to round-off."""
    column, window = at_strength(20.0)
    system = coupled_column(column, iqn_ils(), window)
    conductance = 2.0 * column.permeability / column.viscosity / column.cell
    outflow = 0.0
    for _ in range(10):
        system.advance(window)
        outflow += window * conductance * pressure(system)[-1]
    thickness = system.get_fields(["solid.thickness"])["solid.thickness"]
    assert outflow == pytest.approx(column.height - thickness.sum(), rel=1e-11)


@pytest.mark.parametrize("substeps", [{"solid": 4}, {"fluid": 3}, {"solid": 4, "fluid": 3}])
def test_substeps_conserve_volume_and_keep_the_answer_near(substeps):
    system = consolidate(0.197, 100, iqn_ils(), "pressure_from_fluid", substeps=substeps)
    assert settlement_share(system, COLUMN) == pytest.approx(0.5003, rel=0.01)


def test_windows_that_follow_the_coupling_residual_reach_the_degree_with_fewer_of_them():
    scale = COLUMN.time_scale
    control = WindowControl(
        1e-4 * scale, smallest=1e-5 * scale, largest=0.02 * scale, residual=0.02
    )
    system = coupled_column(COLUMN, iqn_ils(), control, direction="fixed_stress")
    system.advance(0.848 * scale)
    assert settlement_share(system, COLUMN) == pytest.approx(0.9000, rel=0.01)
    sizes = [window.size for window in system.history.accepted]
    assert len(sizes) < 0.848 / 1e-4 / 20
    assert max(sizes) > 20 * sizes[0]


@pytest.mark.parametrize("direction", ALL)
def test_a_wrong_column_is_refused(direction):
    with pytest.raises(InputError, match="permeability"):
        coupled_column(Column(permeability=0.0), iqn_ils(), 1.0, direction=direction)
    with pytest.raises(InputError, match="at least 2 cells"):
        Column(cell_count=1)
