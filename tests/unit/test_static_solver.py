"""The quasi-static solver: unknowns, supports, load stepping, arc length, and its errors."""

from __future__ import annotations

import re

import numpy as np
import pytest

from lcmchain.elements.solid_shell.tangent import linearise, node_stiffness
from lcmchain.errors import InputError, SimulationError
from lcmchain.materials.fabric import Fabric, FabricLaw
from lcmchain.model import assemble_sheet
from lcmchain.scene import Element
from lcmchain.statics import (
    DirectorCouples,
    StaticProblem,
    StaticStep,
    linear_frequencies,
    linear_solution,
    nodal_forces,
    solve,
    trace,
)
from lcmchain.statics.newton import Balance, Newton, SecantAcceleration, in_equilibrium
from lcmchain.statics.paths import NewtonOnArc
from lcmchain.verification.benchmarks.meshes import (
    AS_PUBLISHED,
    X,
    Y,
    Z,
    isotropic_model,
    parameters,
    rectangle,
    sheet,
)

MPA = 1e6


@pytest.fixture(scope="module")
def strip():
    """A thick strip of 3x2 elements with its model."""
    mesh = rectangle(3.0, 1.0, 0.3, 3, 2)
    return mesh, isotropic_model(mesh, 1e3, 0.3, Element(), density=2.0)


def dense_stiffness(model):
    """Stiffness (3 N, 3 N) in nodal displacements, components fastest."""
    K = np.zeros((3 * model.node_count,) * 2)
    element = node_stiffness(linearise(model, np.zeros((3, model.node_count))).stiffness)
    for nodes, part in zip(model.only_body().mesh.elements, element):
        dofs = (3 * nodes[:, None] + np.arange(3)).ravel()
        K[np.ix_(dofs, dofs)] += part
    return K


def mixed_supports(mesh):
    """Clamped at one end; elsewhere single faces, both faces, and prescribed motion."""
    held = mesh.held((mesh.grid[0], [X, Y, Z]))
    pairs = mesh.blank.pair_count
    held[Z, mesh.grid[-1, 0]] = True  # bottom only
    held[Y, mesh.grid[2, 1] + pairs] = True  # top only
    held[X, mesh.nodes(mesh.grid[-1, -1])] = True
    moved = np.zeros(held.shape)
    moved[Z, mesh.grid[-1, 0]] = 0.02
    moved[Y, mesh.grid[2, 1] + pairs] = -0.01
    moved[X, mesh.nodes(mesh.grid[-1, -1])] = [0.015, -0.005]
    return held, moved


# --- linear -------------------------------------------------------------------------------------


def test_linear_solution_is_that_of_the_nodal_stiffness(strip):
    mesh, model = strip
    held, moved = mixed_supports(mesh)
    forces = np.random.default_rng(0).normal(size=held.shape)
    u = linear_solution(StaticProblem(model=model, held=held, forces=forces, displacements=moved))
    K, free = dense_stiffness(model), ~held.T.ravel()
    expected = moved.T.ravel() * held.T.ravel()
    right = forces.T.ravel() - K @ expected
    expected[free] = np.linalg.solve(K[np.ix_(free, free)], right[free])
    np.testing.assert_allclose(u.T.ravel(), expected, rtol=0.0, atol=1e-11 * abs(expected).max())


def test_frequencies_are_those_of_the_nodal_matrices(strip):
    mesh, model = strip
    held, _ = mixed_supports(mesh)
    frequencies, modes = linear_frequencies(model, held, 4)
    free = ~held.T.ravel()
    mass = np.repeat(model.nodes.mass, 3)[free]
    K = dense_stiffness(model)[np.ix_(free, free)]
    scaled = K / np.sqrt(np.outer(mass, mass))
    squares = np.linalg.eigvalsh(0.5 * (scaled + scaled.T))[:4]
    np.testing.assert_allclose((2 * np.pi * frequencies) ** 2, squares, rtol=1e-9)
    for mode, square in zip(modes, squares):
        shape = mode.T.ravel()[free]
        np.testing.assert_allclose(
            K @ shape, square * mass * shape, atol=1e-8 * abs(K @ shape).max()
        )
        assert np.all(mode[held] == 0.0)


def test_supports_that_allow_rigid_motion_are_told(strip):
    mesh, model = strip
    hinge = mesh.nothing_held.copy()
    hinge[:, mesh.grid[0]] = True  # the lower edge of one end: a hinge
    for held in (mesh.nothing_held, mesh.held((mesh.grid, [X, Y])), hinge):
        with pytest.raises(InputError, match="held: lets the sheet move rigidly"):
            StaticProblem(model=model, held=held)
    with pytest.raises(InputError, match="held: lets the sheet move rigidly"):
        linear_frequencies(model, hinge, 1)


# --- nonlinear ----------------------------------------------------------------------------------


def test_forces_and_prescribed_displacements_meet_at_the_same_state(strip):
    """Prescribing the displacement that a force makes needs that force."""
    mesh, model = strip
    tip = mesh.grid[-1]
    clamp = mesh.held((mesh.grid[0], [X, Y, Z]))
    forces = mesh.edge_load(tip, [0.0, 0.0, 1.0])
    (loaded,) = solve(StaticProblem(model=model, held=clamp, forces=forces), [1.0])
    held = clamp.copy()
    held[:, mesh.nodes(tip)] = True
    problem = StaticProblem(model=model, held=held, displacements=loaded.displacement)
    (moved,) = solve(problem, [1.0], first_step=0.5)
    assert abs(loaded.displacement).max() > 0.5  # large
    np.testing.assert_allclose(moved.displacement, loaded.displacement, atol=1e-6)
    reaction = nodal_forces(model, moved.displacement)[:, mesh.nodes(tip)].sum(axis=1)
    np.testing.assert_allclose(reaction, [0.0, 0.0, 1.0], atol=1e-5)


def test_reactions_carry_the_weight(strip):
    mesh, model = strip
    held = mesh.held((mesh.grid[0], [X, Y, Z]))
    problem = StaticProblem(model=model, held=held, gravity=(0.0, 0.5, -1.0))
    (state,) = solve(problem, [1.0])
    reaction = nodal_forces(model, state.displacement) - problem.external_forces(state.displacement)
    reaction = reaction[held].reshape(3, -1).sum(axis=1)
    np.testing.assert_allclose(reaction, [0.0, -0.5 * 1.8, 1.8], atol=1e-5)


def test_history_is_at_the_load_factors_and_tells_every_step(strip):
    mesh, model = strip
    held = mesh.held((mesh.grid[0], [X, Y, Z]))
    problem = StaticProblem(
        model=model, held=held, forces=mesh.edge_load(mesh.grid[-1], [0.0, 0.0, 1.0])
    )
    steps = []
    history = solve(problem, [0.2, 1.0, 0.5], first_step=0.1, on_step=steps.append)
    assert [step.load_factor for step in history] == [0.2, 1.0, 0.5]
    factors = [step.load_factor for step in steps]
    assert factors[0] == 0.1 and {0.2, 1.0, 0.5} < set(factors)
    assert max(step.residual for step in steps) <= 1e-6
    back = solve(problem, [0.5])[0]  # elastic: the way there does not matter
    np.testing.assert_allclose(history[-1].displacement, back.displacement, atol=1e-6)


# --- convergence ----------------------------------------------------------------------------------

ROUND_OFF = 1e-9


def forces_of(free, work=1.0):
    """A balance of forces of 1 N; the internal forces are exact to ROUND_OFF."""
    return Balance(np.zeros((3, 1)), free=free, scale=1.0, round_off=ROUND_OFF, work=work)


@pytest.mark.parametrize(
    ("free", "energy", "found"),
    [
        (1e-7, 1e-9, True),  # both small
        (1e-5, 1e-9, False),  # out of balance, though nothing moves
        (1e-7, 1e-3, False),  # nearly in balance, though a soft sheet still moves
    ],
)
def test_equilibrium_takes_a_small_force_and_a_small_energy(free, energy, found):
    correction = np.full(3, 1e-3)
    after = forces_of(free, work=1.0)
    assert in_equilibrium(after, correction, energy, 1.0, 1e-6) is found


def test_a_small_step_is_measured_by_the_work_of_all_forces():
    """Its first correction is as small as the last one; the work so far is not."""
    correction, energy = np.full(3, 1e-7), 1e-13
    assert in_equilibrium(forces_of(1e-7), correction, energy, energy, 1e-6)
    assert not in_equilibrium(forces_of(1e-7, work=1e-3), correction, energy, energy, 1e-6)


def test_forces_within_their_round_off_are_in_balance():
    correction = np.full(3, 1e-8)
    after = forces_of(1.9 * ROUND_OFF, work=0.0)
    assert in_equilibrium(after, correction, 1e-18, 1e-18, 1e-12)
    assert not in_equilibrium(after._replace(free=2.1 * ROUND_OFF), correction, 0.0, 1.0, 1e-12)
    assert not in_equilibrium(after, correction, 1e-15, 1e-15, 1e-12)  # a correction of its own


@pytest.mark.parametrize("factor", [0.96, -0.7, -1.7])
def test_corrections_along_one_direction_are_accelerated(factor):
    """A part left out of the tangent makes the error change by a factor with every correction."""
    factors = np.array([1e-3, factor, 2e-3])
    error = np.array([1.0, 0.02, 1.0])
    acceleration = SecantAcceleration()
    for _ in range(6):
        error = error + acceleration.move((factors - 1.0) * error)
    assert np.linalg.norm(error) < 1e-8


def test_quadratic_convergence_is_left_alone():
    acceleration = SecantAcceleration()
    for size in (1.0, 0.2, 2e-3, 2e-7):
        correction = np.array([size, -0.5 * size])
        assert acceleration.move(correction) is correction


def test_very_thin_strips_bend_as_thin_ones_do():
    """At a slenderness of 10⁵ the forces are out of balance by their round-off, above 10⁻⁶."""
    tips = []
    for slenderness in (1e3, 1e5):
        thickness = 10.0 / slenderness
        mesh = rectangle(10.0, 1.0, thickness, 16, 1)
        model = isotropic_model(mesh, 1.2e6, 0.0, AS_PUBLISHED)
        load = 4.0 * 1.2e6 * thickness**3 / 12.0 / 10.0**2
        forces = mesh.edge_load(mesh.grid[-1], [0.0, 0.0, load])
        held = mesh.held((mesh.grid[0], [X, Y, Z]))
        (state,) = solve(StaticProblem(model=model, held=held, forces=forces), [1.0])
        tips.append(mesh.middle(state.displacement, mesh.grid[-1]).mean(axis=0))
    assert state.residual > 1e-6
    np.testing.assert_allclose(tips[1], tips[0], atol=1e-5)


def test_lowest_stiffness_is_the_eigenvalue_nearest_to_zero(strip):
    mesh, model = strip
    newton = Newton(StaticProblem(model=model, held=mixed_supports(mesh)[0]), 1e-6)
    start = np.zeros((3, model.node_count))
    K = newton.system.reduced(newton.system.assemble(linearise(model, start).stiffness)).toarray()
    assert newton.lowest_stiffness(start, 0.0) == pytest.approx(
        abs(np.linalg.eigvalsh(K)).min(), rel=1e-6
    )


# --- paths ----------------------------------------------------------------------------------------


def test_few_large_steps_find_the_state_of_many_small_ones():
    """A strip of slenderness 1000 rolled by a quarter turn in one step."""
    mesh = rectangle(10.0, 1.0, 0.01, 16, 1)
    model = isotropic_model(mesh, 1.2e6, 0.0)
    held = mesh.held((mesh.grid[0], [X, Y, Z]))
    moment = 0.5 * np.pi * 1.2e6 * 0.01**3 / 12.0 / 10.0
    couple = DirectorCouples(mesh.grid[-1], np.array([0.0, -1.0, 0.0]), np.full(2, 0.5 * moment))
    problem = StaticProblem(model=model, held=held, couples=(couple,))
    (once,) = solve(problem, [1.0])
    many = solve(problem, np.linspace(0.05, 1.0, 20))
    assert once.iterations <= 10
    np.testing.assert_allclose(once.displacement, many[-1].displacement, atol=1e-5)
    angle = 0.5 * np.pi
    tip = mesh.middle(once.displacement, mesh.grid[-1, 0])
    exact = [10.0 * (np.sin(angle) / angle - 1.0), 0.0, 10.0 * (1.0 - np.cos(angle)) / angle]
    np.testing.assert_allclose(tip, exact, atol=0.02)


def test_held_middle_is_a_hinge_under_large_rotations(strip):
    """The strip turns by 60° about its end as a rigid body; held faces would bend it."""
    mesh, model = strip
    end, tip = mesh.grid[0], mesh.grid[-1, 1]
    hinge = np.zeros((3, mesh.blank.pair_count), dtype=bool)
    hinge[:, end] = True
    drop = -3.0 * np.sin(np.pi / 3) - 0.15 * (1.0 - np.cos(np.pi / 3))
    held = mesh.nothing_held.copy()
    held[Z, tip + mesh.blank.pair_count] = True
    moved = np.where(held, drop, 0.0)
    problem = StaticProblem(model=model, held=held, held_middle=hinge, displacements=moved)
    (state,) = solve(problem, [1.0], first_step=0.25)
    np.testing.assert_allclose(
        mesh.middle(state.displacement, mesh.grid[-1]),
        np.tile([-1.5, 0.0, -3.0 * np.sin(np.pi / 3)], (3, 1)),
        atol=1e-6,
    )
    np.testing.assert_allclose(mesh.middle(state.displacement, end), 0.0, atol=1e-14)
    assert abs(nodal_forces(model, state.displacement)).max() < 1e-6


def test_couples_have_a_potential():
    couple = DirectorCouples(np.arange(4), np.array([0.0, 0.6, 0.8]), np.arange(1.0, 5.0))
    d = np.random.default_rng(2).normal(size=(4, 3))
    force, gradient = couple.force_and_gradient(d)
    np.testing.assert_allclose(gradient, gradient.transpose(0, 2, 1), atol=1e-12)
    np.testing.assert_allclose(np.einsum("nd,nd->n", force, d), 0.0, atol=1e-12)
    # the moment of the pair of forces about the axis
    moment = np.cross(d, force) @ couple.axis
    np.testing.assert_allclose(moment, couple.moments, rtol=1e-12)
    step = 1e-6
    for i in range(3):
        move = step * np.eye(3)[i]
        change = couple.force_and_gradient(d + move)[0] - couple.force_and_gradient(d - move)[0]
        np.testing.assert_allclose(change / (2 * step), gradient[:, :, i], rtol=1e-5, atol=1e-6)


@pytest.fixture(scope="module")
def arch():
    """A shallow arch with held ends under a force at its crown."""
    s, t = parameters(16, 1)
    rise, span = 0.5, 10.0
    middle = np.stack([span * (s - 0.5), t, rise * np.cos(np.pi * (s - 0.5))], axis=-1)
    slope = -rise * np.pi / span * np.sin(np.pi * (s - 0.5))
    normal = np.stack([-slope, 0 * s, np.ones_like(s)], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1)[..., None]
    mesh = sheet(middle, normal, 0.1)
    model = isotropic_model(mesh, 1e6, 0.0)
    held = mesh.held((mesh.grid[[0, -1]], [X, Y, Z]), (mesh.grid, [Y]))
    return mesh, model, held


def test_arc_length_follows_a_snap_through(arch):
    """The load falls after the limit point; the path is that of a prescribed displacement."""
    mesh, model, held = arch
    crown = mesh.grid[8]
    forces = mesh.edge_load(crown, [0.0, 0.0, -10.0])
    problem = StaticProblem(model=model, held=held, forces=forces)
    path = trace(problem, 1.5, first_step=0.1, largest_step=2.0)
    load = np.array([step.load_factor for step in path])
    drop = np.array([-mesh.middle(step.displacement, crown)[:, Z].mean() for step in path])
    assert np.all(np.diff(drop) > 0.0)
    peak = int(np.argmax(load[: np.argmax(drop > 0.5)]))
    assert load[peak] > load[peak + 1 :].min() + 0.1
    assert load[-1] >= 1.5

    driven = held.copy()
    driven[Z, mesh.nodes(crown)] = True
    down = np.zeros(held.shape)
    down[Z, mesh.nodes(crown)] = -1.0
    near = [int(np.argmin(abs(drop - d))) for d in (0.2, 0.5, 0.8)]
    driven_problem = StaticProblem(model=model, held=driven, displacements=down)
    for step, row in zip(solve(driven_problem, drop[near], largest_step=0.1), near):
        reaction = -nodal_forces(model, step.displacement)[Z, mesh.nodes(crown)].sum()
        # the driven crown does not rotate, nor by symmetry does that under the force
        assert reaction == pytest.approx(10.0 * load[row], abs=0.05)


def test_load_control_names_the_limit(arch):
    """The load at which the arch snaps through, 1.165: there its stiffness vanishes."""
    mesh, model, held = arch
    forces = mesh.edge_load(mesh.grid[8], [0.0, 0.0, -10.0])
    problem = StaticProblem(model=model, held=held, forces=forces)
    with pytest.raises(SimulationError, match="a limit or bifurcation point; follow") as stop:
        solve(problem, [1.5], first_step=0.1)
    load, left = re.search(
        r"beyond the load factor (\S+) .*lowest stiffness before is (\S+) of", str(stop.value)
    ).groups()
    assert float(load) == pytest.approx(1.165, abs=1e-3)
    assert float(left) < 0.01


def test_load_control_passes_a_limit_where_it_is_asked_to(arch):
    """It finds the snapped arch, on the path that the arc length follows to the same load."""
    mesh, model, held = arch
    crown = mesh.grid[8]
    forces = mesh.edge_load(crown, [0.0, 0.0, -10.0])
    problem = StaticProblem(model=model, held=held, forces=forces)
    seen = []
    states = solve(problem, [1.0, 1.5], first_step=0.1, past_limits=True, on_step=seen.append)
    assert [state.load_factor for state in states] == [1.0, 1.5]
    assert min(np.diff([state.load_factor for state in seen])) < -0.1
    before, after = (-mesh.middle(s.displacement, crown)[:, Z].mean() for s in states)
    assert before < 0.1 < 0.8 < after
    assert all(state.residual < 1e-6 for state in states)
    last = trace(problem, 1.4, first_step=0.2)[-1]
    (there,) = solve(problem, [last.load_factor], first_step=0.1, past_limits=True)
    np.testing.assert_allclose(there.displacement, last.displacement, atol=1e-6)


def test_a_path_back_to_the_unloaded_sheet_is_no_way_past_a_limit(arch, monkeypatch):
    mesh, model, held = arch
    forces = mesh.edge_load(mesh.grid[8], [0.0, 0.0, -10.0])
    problem = StaticProblem(model=model, held=held, forces=forces)
    seen = []

    def back_and_on(self, displacement, *rest):
        for factor in (1.0, 0.5, -0.1, 0.2, 1.6):
            seen.append(factor)
            yield StaticStep(factor, displacement, 1, 0.0)

    monkeypatch.setattr(NewtonOnArc, "path", back_and_on)
    with pytest.raises(SimulationError, match="beyond the load factor 1.16"):
        solve(problem, [1.5], first_step=0.1, past_limits=True)
    assert seen == [1.0, 0.5, -0.1]


def test_load_control_names_the_node_and_steps_that_are_too_large(arch):
    mesh, model, held = arch
    ends = mesh.held((mesh.grid[0], [X, Y, Z]))
    forces = mesh.edge_load(mesh.grid[-1], [-1e7, 0.0, 0.0])
    message = r"beyond the load factor 0 .*force is .* at node \d+.*steps too large"
    with pytest.raises(SimulationError, match=message):
        solve(StaticProblem(model=model, held=ends, forces=forces), [1.0])


def test_arc_length_says_when_the_steps_do_not_suffice(arch):
    mesh, model, held = arch
    forces = mesh.edge_load(mesh.grid[8], [0.0, 0.0, -10.0])
    with pytest.raises(SimulationError, match="has made 3 steps and only reached"):
        trace(
            StaticProblem(model=model, held=held, forces=forces),
            10.0,
            first_step=0.01,
            maximum_steps=3,
        )


def test_arrays_that_do_not_fit_are_named(strip):
    mesh, model = strip
    with pytest.raises(InputError, match="held: must have the shape"):
        StaticProblem(model=model, held=np.zeros((3, 4), dtype=bool))
    with pytest.raises(InputError, match="held_middle: must have the shape"):
        StaticProblem(model=model, held=mesh.nothing_held, held_middle=mesh.nothing_held)
    with pytest.raises(InputError, match="forces: must have the shape"):
        StaticProblem(model=model, held=mesh.nothing_held, forces=np.zeros(3))


def test_textile_strip_hangs_like_a_heavy_elastica():
    """MD600 of bending length L/2 falls by 41.5° (Peirce); membrane over bending stiffness 26."""
    law = FabricLaw(
        C11=1000 * MPA, C22=1000 * MPA, C23=0.1 * MPA, C13=0.1 * MPA,
        s0=0.1919 * MPA, s1=-2.3637 * MPA, s2=14.7593 * MPA, s3=-40.7199 * MPA, s4=42.3208 * MPA,
        c0=0.1563 * MPA, c1=60.4653, c2=2.4528,
        B11=38.0615 * MPA, B22=43.0668 * MPA, B33=0.1 * MPA, B12=4.2123 * MPA, B23=0.1 * MPA,
        B13=0.1 * MPA,
    )  # fmt: skip
    thickness, areal_mass, gravity = 1.004e-3, 0.6, 9.81
    material = Fabric(law, thickness=thickness, areal_mass=areal_mass, fibre_density=1810.0)
    bending = law.B11 * thickness**3 / 12.0
    length = (8.0 * bending / (areal_mass * gravity)) ** (1 / 3)
    mesh = rectangle(length, 25e-3, thickness, 40, 1)
    model = assemble_sheet(mesh.blank, material)
    held = mesh.held((mesh.grid[0], [X, Y, Z]))
    problem = StaticProblem(model=model, held=held, gravity=(0.0, 0.0, -gravity))
    steps = []
    (state,) = solve(problem, [1.0], first_step=0.1, on_step=steps.append)
    assert sum(step.iterations for step in steps) < 40
    tip = mesh.middle(state.displacement, mesh.grid[-1]).mean(axis=0)
    reach, drop = length + tip[X], -tip[Z]
    # 0.72442 L and 0.64063 L of the elastica; the low transverse shear stiffness adds 0.5 %
    np.testing.assert_allclose([reach / length, drop / length], [0.72442, 0.64063], atol=5e-3)
    assert np.degrees(np.arctan2(drop, reach)) == pytest.approx(41.49, abs=0.4)
