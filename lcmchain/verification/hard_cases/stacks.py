"""Hard for contact between plies: sticking, edges, unlike weight, release, closing.

Every stack has three plies, supports and damping: the same compiled loop serves all cases.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from lcmchain.effects.supports import Support, translation
from lcmchain.elements.family import Body
from lcmchain.solver.simulation import Simulation
from lcmchain.state import FRICTION as FRICTION_WORK
from lcmchain.state import PLY_REFRESH
from lcmchain.verification.hard_cases.case import CaseResult, hard_case
from lcmchain.verification.hard_cases.compaction import s_shaped_tools
from lcmchain.verification.hard_cases.contact_and_tools import to_and_back, wiping_tools
from lcmchain.verification.hard_cases.sheets import (
    MD600,
    nodes_at,
    smooth,
    stack_simulation,
)

THEME = "Stacks"
T = 1.004  # thickness of MD600 [mm]
# A plate that touches nothing [mm].
FAR = 1000.0


def plates(bottom: float, top: float, travel: float, stop: float, time: float) -> str:
    """Return the tables of two plates at these heights [mm].

    The upper one goes down by ``travel`` [mm] until ``stop`` [ms], and stays until ``time`` [ms].
    """
    parts = np.linspace(0.0, 1.0, 41)
    times = " ".join(f"{stop * s:.9g}" for s in parts)
    way = " ".join(f"{travel * smooth(s, 1.0):.9g}" for s in parts)
    return f"""
        [[tools]]
        name = "lower_plate"
        shape = {{ type = "plate", side = "below" }}
        position = ["0 mm", "0 mm", "{bottom} mm"]
        [[tools]]
        name = "upper_plate"
        shape = {{ type = "plate", side = "above" }}
        position = ["0 mm", "0 mm", "{top} mm"]
        motion = {{ type = "table", direction = [0, 0, -1], \
times = "{times} {time} ms", travel = "{way} {travel} mm" }}
        """


def ply_table(
    name: str,
    width: float,
    length: float,
    edge: float,
    *,
    x: float = 0.0,
    height: float | None = None,
    **entries: str,
) -> str:
    """Return the table of a ply around (x, 0), its middle at a height; lengths in mm.

    Without a height it lies on the one before. entries : further ones, texts.
    """
    lines = [f'{key} = "{value}"' for key, value in entries.items()]
    if height is not None:
        lines.append(f'height = "{height} mm"')
    more = "\n        ".join(lines)
    return f"""
        [[plies]]
        name = "{name}"
        size = ["{width} mm", "{length} mm"]
        center = ["{x} mm", "0 mm"]
        edge_length = "{edge} mm"
        {more}
        """


def positions_of(sim: Simulation, body: Body) -> np.ndarray:
    """Return the present positions of the nodes of a ply (node_count, 3) [m]."""
    return sim.state.position.T[body.first_node : body.first_node + body.mesh.node_count]


def thickness_of(sim: Simulation, body: Body) -> np.ndarray:
    """Return the present thickness of the elements of a ply (element_count,) [m]."""
    condition = body.condition(sim.state.position, sim.model.history_of(body, sim.state.history))
    return condition.thickness_stretch * body.mesh.thickness


def inside(body: Body, margin: float) -> np.ndarray:
    """Tell which elements lie further inside their ply than ``margin`` [m] (element_count,)."""
    X = body.mesh.node_positions[:, :2]
    centre = X[body.mesh.elements].mean(axis=1)
    return ((centre > X.min(axis=0) + margin) & (centre < X.max(axis=0) - margin)).all(axis=1)


def deepest_overlap(sim: Simulation) -> float:
    """Return how deep a node of one ply lies in another one, at most [m].

    Told from the flat triangles of the faces, without what the contact knows: a node of an upper
    ply's lower face lies below a triangle of a lower ply's upper face, or the other way round. One
    that has gone through another ply counts too, up to twice its thickness.
    """
    deepest = 0.0
    bodies = sim.model.bodies
    for upper in range(len(bodies)):
        for lower in range(upper):
            below, above = bodies[lower], bodies[upper]
            reach = 2.0 * min(below.mesh.thickness, above.mesh.thickness)
            top, bottom = below.mesh.elements[:, 4:], above.mesh.elements[:, 3::-1]
            for points, others, faces in ((above, below, top), (below, above, bottom)):
                own = (
                    points.mesh.elements[:, :4] if points is above else points.mesh.elements[:, 4:]
                )
                nodes = positions_of(sim, points)[np.unique(own)]
                corner = positions_of(sim, others)[faces]
                deepest = max(deepest, _deepest_below(nodes, corner, reach))
    return deepest


def _deepest_below(points: np.ndarray, corner: np.ndarray, reach: float) -> float:
    """Return how deep a point (n, 3) lies straight below a face (m, 4, 3), within a reach [m]."""
    deepest = 0.0
    for a, b, c in (corner[:, [0, k, k + 1]].transpose(1, 0, 2) for k in (1, 2)):
        ab, ac = b - a, c - a
        normal = np.cross(ab, ac)
        square = np.einsum("mi,mi->m", normal, normal)
        real = square > 0.0
        a, ab, ac, normal, square = (x[real] for x in (a, ab, ac, normal, square))
        away = points[:, np.newaxis] - a
        u = np.einsum("nmi,mi->nm", np.cross(away, ac), normal) / square
        v = -np.einsum("nmi,mi->nm", np.cross(away, ab), normal) / square
        depth = -np.einsum("nmi,mi->nm", away, normal) / np.sqrt(square)
        over = (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (depth < reach)
        deepest = max(deepest, float(depth[over].max(initial=0.0)))
    return deepest


def overlap_result(name: str, deepest: float, limit: float) -> CaseResult:
    """Return the criterion that no ply lies in another one, up to what flat facets miss."""
    what = "deepest node in another ply over the thickness"
    return CaseResult(name, what, 1e5 * deepest / T, limit, "%")


def balance_result(name: str, sim: Simulation, limit: float, what: str = "") -> CaseResult:
    """Return the criterion of the energy balance at the end, over the work put in."""
    energy = sim.energy()
    return CaseResult(
        name,
        f"{what}energy balance error over the work",
        100.0 * abs(energy["balance_error"] / energy["external"]),
        limit,
        "%",
    )


# --- sticking and slipping ------------------------------------------------------------------------

FRICTION = 0.2
# Time until the plate stands, and of a stroke to and fro [ms]; strokes, and how far they go [m].
PRESSED, PERIOD, STROKES, SLIDE = 4.0, 8.0, 2, 1e-3


def dragged(**contact: Any) -> Simulation:
    """Return a ply between two others under pressure, dragged to and fro, then held still."""
    end = PRESSED + (STROKES + 1) * PERIOD

    def way(time):
        stroke, part = divmod((1e3 * time - PRESSED) / PERIOD, 1.0)
        if not 0 <= stroke < STROKES:
            return 0.0
        return SLIDE * 0.5 * (1.0 - math.cos(2.0 * math.pi * part))

    def supports(ply, X):
        if ply == "bed":
            return [Support("bed", np.arange(len(X)))]
        left, right = (nodes_at(X, 0, X[:, 0].min()), nodes_at(X, 0, X[:, 0].max()))
        if ply == "sled":
            return [Support("grip", left, "x", translation([1, 0, 0], way))]
        return [Support("cover", np.concatenate([left, right]), "xy")]

    return stack_simulation(
        f"""
        process = {{ time = "{end} ms", mass_damping = "100 1/s" }}
        contact = {{ depth = "zero" }}
        [material]
        {MD600}
        [[interfaces]]
        friction = {FRICTION}
        {ply_table("bed", 40, 20, 4, height=0.5 * T, fibre_angle="30 deg")}
        {ply_table("sled", 16, 12, 4)}
        {ply_table("cover", 24, 15, 3)}
        {plates(-FAR, 3 * T, 0.4 * T, PRESSED, end)}
        """,
        supports=supports,
        **contact,
    )


@hard_case("stick_and_slip_of_plies", THEME, reduced="--full: without as well")
def stick_and_slip_of_plies(name: str, full: bool) -> Iterator[CaseResult]:
    """A ply between two others under pressure is dragged to and fro by 1 mm, and held still.

    Hard because it slips on both faces, sticks at each turn and slips back, while the springs
    between the plies are renewed on the way: what sliding takes must be the friction times the
    pressure in both directions, and sticking must take nothing.
    """
    sim = dragged()
    off = 0.0
    for half in range(2 * STROKES):
        # the middle part of the way, 71 % of it, at nearly one speed
        sim.advance_to(1e-3 * (PRESSED + (0.5 * half + 0.125) * PERIOD))
        before = sim.state.copy()
        sim.advance_to(1e-3 * (PRESSED + (0.5 * half + 0.375) * PERIOD))
        drag = sim.state.support_impulse[1, 0] - before.support_impulse[1, 0]
        load = sim.state.tool_impulse[1, 2] - before.tool_impulse[1, 2]
        off = max(off, abs(abs(drag) / (2.0 * FRICTION * load) - 1.0))
    yield CaseResult(name, "drag against twice friction times load", 100.0 * off, 2.0, "%")
    loss, fed = sticking(sim)
    yield CaseResult(name, "loss of a period of sticking over that of a stroke", loss, 0.2, "%")
    without = ""
    if full:
        without = (
            f"slopes of facets taken anew in full: {sticking(dragged(slope_part=1.0))[1]:.2f} %"
        )
    yield CaseResult(
        name,
        "what renewals of springs put in or take meanwhile, over the same",
        fed,
        0.1,
        "%",
        without=without,
    )
    yield overlap_result(name, deepest_overlap(sim), 5.0)
    yield balance_result(name, sim, 0.1)


def sticking(sim: Simulation) -> tuple[float, float]:
    """Run to the end; return what is lost and what renewals change, over a stroke's loss [%]."""
    sim.advance_to(1e-3 * (PRESSED + STROKES * PERIOD))
    before = sim.state.work.copy()
    sim.advance_to(1e-3 * (PRESSED + (STROKES + 1) * PERIOD))
    change = (sim.state.work - before) / (before[FRICTION_WORK] / STROKES)
    return 100.0 * float(change[FRICTION_WORK]), 100.0 * abs(float(change[PLY_REFRESH]))


# --- an edge over a fold --------------------------------------------------------------------------


FOLD_HEIGHT, FOLD_WIDTH, FOLD_PLACE = 3.0, 12.0, 10.0  # [mm]
FOLD_WAY = 18.0  # [mm]


def edge_over_fold(time: float) -> Simulation:
    """Return two plies held at one end, under whose free edges a ply with a fold goes and comes."""

    def fold(x):
        beside = np.clip((1e3 * x - FOLD_PLACE) / FOLD_WIDTH, -0.5, 0.5)
        return 1e-3 * FOLD_HEIGHT * np.cos(math.pi * beside) ** 2

    def shape(ply, X):
        if ply != "folded":
            return X
        return X + np.column_stack([0.0 * X[:, 0], 0.0 * X[:, 0], fold(X[:, 0])])

    def way(t):
        return 1e-3 * FOLD_WAY * smooth(min(t, 0.7 * time - t), 0.35 * time)

    def supports(ply, X):
        if ply != "folded":
            return [Support(ply, nodes_at(X, 0, X[:, 0].min()))]
        flat = np.flatnonzero(fold(X[:, 0]) < 1e-9)
        return [Support("flat parts", flat, motion=translation([-1, 0, 0], way))]

    return stack_simulation(
        f"""
        process = {{ time = "{time} s", mass_damping = "300 1/s" }}
        [material]
        {MD600}
        [[interfaces]]
        friction = {FRICTION}
        {ply_table("folded", 63, 9, 2.25, x=-4.5, height=-0.5 * T)}
        {ply_table("strip", 30, 9, 3, x=-15, height=0.5 * T)}
        {ply_table("cover", 27, 9, 1.8, x=-16.5, height=1.5 * T)}
        {plates(-FAR, FAR, 0.0, 500.0 * time, 1e3 * time)}
        """,
        supports=supports,
        shape=shape,
    )


@hard_case("edge_over_a_fold", THEME)
def edge_over_a_fold(name: str, full: bool) -> Iterator[CaseResult]:
    """A ply with a fold, 3 mm high on 12 mm, goes under the free edges of two others and back.

    Hard because the edge of a ply climbs a flank of 38°, falls off behind it and catches on the way
    back: its points hang beyond the rim, those of the fold come out from under it, and both push
    along the plies. Afterwards everything must lie as before. The free plies rattle on each other
    without pressure, which lets rounding grow tenfold in 0.15 ms: heights changed by 1e-15 m put
    the two sides apart by 3 to 7 % of the fold at the worst node and time. Their mean square tells
    a bias from such a draw: its root is 0.17 to 0.20 % for six draws.
    """
    time = 0.1
    sim = edge_over_fold(time)
    start = sim.state.position.copy()
    deepest, highest = 0.0, 0.0
    uneven = []
    for part in np.linspace(0.0, 1.0, 51)[1:]:
        sim.advance_to(float(part * time))
        deepest = max(deepest, deepest_overlap(sim))
        lifted = sim.state.position[2] - start[2]
        highest = max(highest, float(lifted.max()))
        uneven.append(unevenness(sim))
    yield overlap_result(name, deepest, 10.0)
    yield CaseResult(
        name,
        "difference of the two sides over the height, rms",
        1e5 * math.sqrt(np.mean(np.square(uneven))) / FOLD_HEIGHT,
        0.5,
        "%",
    )
    yield CaseResult(
        name,
        f"free edges back where they were (they rose by {1e3 * highest:.1f} mm), over the height",
        1e5 * float(np.abs(sim.state.position - start)[2].max()) / FOLD_HEIGHT,
        2.0,
        "%",
    )
    yield balance_result(name, sim, 0.1)


def unevenness(sim: Simulation) -> float:
    """Return the rms difference in height of nodes that mirror each other in y [m]."""
    differences = []
    for body in sim.model.bodies:
        X = np.round(1e9 * body.mesh.node_positions).astype(int)
        place = {tuple(x): i for i, x in enumerate(X.tolist())}
        other = [place[x, -y, z] for x, y, z in X.tolist()]
        height = positions_of(sim, body)[:, 2]
        differences.append(height - height[other])
    return math.sqrt(np.mean(np.square(np.concatenate(differences))))


# --- unlike weight --------------------------------------------------------------------------------


def light_between_heavy(time: float, speed: float) -> Simulation:
    """Return a light ply between two a hundred times as heavy, which fly at each other [m/s]."""
    sim = stack_simulation(
        f"""
        # hardly any damping: without any another loop would be compiled
        process = {{ time = "{time} ms", mass_damping = "1e-6 1/s" }}
        [materials.heavy]
        {MD600}
        areal_mass = "6 kg/m^2"
        fibre_density = "18100 kg/m^3"
        [materials.light]
        {MD600}
        areal_mass = "60 g/m^2"
        fibre_density = "181 kg/m^3"
        [[interfaces]]
        friction = {FRICTION}
        {ply_table("lower", 30, 20, 5, height=-T - 0.1, material="heavy")}
        {ply_table("light", 24, 16, 4, height=0, material="light")}
        {ply_table("upper", 30, 20, 5, height=T + 0.1, material="heavy")}
        {plates(-FAR, FAR, 0.0, 0.5 * time, time)}
        """,
    )
    velocity = np.zeros_like(sim.state.position)
    for body, sign in zip(sim.model.bodies, (1.0, 0.0, -1.0), strict=True):
        velocity[2, body.first_node : body.first_node + body.mesh.node_count] = sign * speed
    sim.set_velocity(velocity)
    return sim


@hard_case("light_between_heavy_plies", THEME)
def light_between_heavy_plies(name: str, full: bool) -> Iterator[CaseResult]:
    """Two plies fly at a third one between them, a hundred times lighter, and bounce back.

    Hard because the light ply follows the heavy ones within a few steps and is hit from both sides
    again and again. It must stay near the middle, and no impact may add energy or momentum. Both
    sides touch it in the same step, and rounding decides whether points at no pressure are damped
    in it: velocities changed by 1e-15 m/s put it 0.01, 2 or 4 % of its thickness off the middle.
    """
    time, speed = 20.0, 0.5
    sim = light_between_heavy(time, speed)
    start = sim.energy()["external"]
    mass = sim.model.nodes.mass
    lower, light, upper = sim.model.bodies
    deepest, aside, gain = 0.0, 0.0, 0.0
    for part in np.linspace(0.0, 1.0, 41)[1:]:
        sim.advance_to(1e-3 * float(part * time))
        deepest = max(deepest, deepest_overlap(sim))
        aside = max(aside, abs(float(positions_of(sim, light)[:, 2].mean())))
        gain = max(gain, sim.energy()["balance_error"] / start)
    momentum = np.abs((mass * sim.state.velocity).sum(axis=1)).max()
    yield overlap_result(name, deepest, 5.0)
    yield CaseResult(
        name, "light ply off the middle, over its thickness", 1e5 * aside / T, 10.0, "%"
    )
    yield CaseResult(
        name,
        "momentum of all over that of a heavy ply",
        100.0 * momentum / (speed * float(upper.inertial_mass.sum())),
        0.01,
        "%",
    )
    yield CaseResult(name, "largest gain of energy", 100.0 * max(gain, 0.0), 0.5, "%")


# --- unlike thickness -----------------------------------------------------------------------------

THICK, THIN = 5.0, 0.2  # [mm]
SQUEEZE, DRAWN = 1.0, 2e-3  # of the stack [mm]; way of the upper ply [m]


def thin_between_thick(time: float, angle: float = 30.0, **contact: Any) -> Simulation:
    """Return a thin ply between two thick ones, pressed, of which the upper one is drawn along.

    The plates stand after 0.4 of the time, the grip goes from there to 0.8 of it.

    Parameters
    ----------
    angle : of the fibres of the thin ply [degrees].
    """

    def way(t):
        return DRAWN * smooth(min(max(t - 0.4 * time, 0.0), 0.4 * time), 0.4 * time)

    def supports(ply, X):
        left, right = (nodes_at(X, 0, X[:, 0].min()), nodes_at(X, 0, X[:, 0].max()))
        if ply == "lower":
            return [Support(ply, left, "xy")]
        if ply == "thin":
            return [Support(ply, right, "x")]
        return [Support("grip", left, "xy", translation([1, 0, 0], way))]

    return stack_simulation(
        f"""
        process = {{ time = "{time} s", mass_damping = "100 1/s" }}
        contact = {{ depth = "zero" }}
        [materials.thick]
        {MD600}
        areal_mass = "3 kg/m^2"
        thickness = "{THICK} mm"
        [materials.thin]
        {MD600}
        areal_mass = "120 g/m^2"
        thickness = "{THIN} mm"
        [[interfaces]]
        friction = {FRICTION}
        {ply_table("lower", 40, 30, 5, height=0.5 * THICK, material="thick")}
        {ply_table("thin", 44, 24, 4, material="thin", fibre_angle=f"{angle} deg")}
        {ply_table("upper", 36, 33, 5, material="thick")}
        {plates(0.0, 2.0 * THICK + THIN, SQUEEZE, 400.0 * time, 1e3 * time)}
        """,
        supports=supports,
        **contact,
    )


@hard_case(
    "thin_between_thick_plies",
    THEME,
    reduced="fibres along the edges; --full: at 30° in the thin ply, and without",
)
def thin_between_thick_plies(name: str, full: bool) -> Iterator[CaseResult]:
    """A ply of 0.2 mm between two of 5 mm, pressed by a tenth, of which the upper is drawn along.

    Hard because the mass on the contact springs is 25 times what these are made for, and a ply goes
    into the next one by a part of an element, not of the thin ply: what drives depths to zero must
    not make the thick plies vibrate, and no point may be lost through the thin one.
    """
    time = 0.05
    # across its elements the fibres take a loop of their own
    sim = thin_between_thick(time, angle=30.0 if full else 0.0)
    sim.advance_to(0.55 * time)
    before = sim.state.copy()
    sim.advance_to(0.65 * time)
    drag = float((sim.state.support_impulse - before.support_impulse)[2, 0])
    load = float((sim.state.tool_impulse - before.tool_impulse)[1, 2])
    sim.advance_to(time)
    yield CaseResult(
        name,
        "drag against friction times load",
        100.0 * abs(drag / (FRICTION * load) - 1.0),
        1.0,
        "%",
    )
    without = ""
    if full:
        fast = thin_between_thick(time, depth_time=np.zeros((3, 3)))
        without = f"depths to zero within 500 steps: {calm(fast):.2g} %"
    yield CaseResult(
        name, "kinetic over internal energy at rest", calm(sim), 0.1, "%", without=without
    )
    yield balance_result(name, sim, 0.1)


def calm(sim: Simulation) -> float:
    """Run to the end; return the kinetic over the internal energy there [%]."""
    sim.advance_to(float(sim.model.process_time))
    energy = sim.energy()
    return 100.0 * energy["kinetic"] / energy["internal"]


# --- bent -----------------------------------------------------------------------------------------


def laid(size: tuple[float, float], height: float) -> str:
    """Return the tables of three plies of this size on a height, with unlike meshes; in mm."""
    plies = ""
    for number, edge in enumerate((5.0, 4.0, 5.0)):
        plies += f"""
        [[plies]]
        size = ["{size[0]} mm", "{size[1]} mm"]
        edge_length = "{edge} mm"
        height = "{height + (number + 0.5) * T} mm"
        """
    return f"""
        [material]
        {MD600}
        [[interfaces]]
        friction = {FRICTION}
        {plies}
        """


@hard_case("release_of_a_stack", THEME)
def release_of_a_stack(name: str, full: bool) -> Iterator[CaseResult]:
    """Three plies are wiped over a fillet of 5 mm with friction, and the punch goes back.

    Hard because the plies spring back over each other, stick, and keep a part of the stored energy
    that way: they must come to rest there, without drift, and make no energy.
    """
    down, end = 0.06, 0.24
    # it would bounce on the released stack, and feed it, without a damper
    holder = 'mass = "1 kg", damping = "100 N*s/m"'
    sim = stack_simulation(
        f"""
        process = {{ time = "{end} s", mass_damping = "100 1/s" }}
        contact = {{ friction = 0.157 }}
        {laid((100.0, 20.0), 0.0)}
        {wiping_tools(5.0, to_and_back(35.0, down), thickness=3 * T, holder=holder)}
        """
    )
    deepest = 0.0
    for part in np.linspace(0.0, 2.0, 21)[1:]:
        sim.advance_to(float(part * down))
        deepest = max(deepest, deepest_overlap(sim))
        if part == 1.0:
            formed = sim.stored_energy()
    rise, last = 0.0, math.inf
    for part in np.linspace(0.0, 0.8, 41):
        sim.advance_to(2.0 * down + float(part) * (end - 2.0 * down))
        energy = sim.energy()
        there = sum(energy[kind] for kind in ("kinetic", "internal", "hourglass", "contact"))
        rise, last = max(rise, there - last), there
    before = sim.state.position.copy()
    sim.advance_to(end)
    energy = sim.energy()
    yield CaseResult(
        name,
        "kinetic energy at the end over the stored energy of the formed stack",
        100.0 * energy["kinetic"] / formed,
        0.1,
        "%",
    )
    yield CaseResult(
        name,
        "largest rise of the energy after release, over it",
        100.0 * max(rise, 0.0) / formed,
        0.1,
        "%",
    )
    yield CaseResult(
        name,
        "largest way of a node in the last 24 ms, over the thickness of a ply",
        1e5 * float(np.abs(sim.state.position - before).max()) / T,
        5.0,
        "%",
    )
    yield CaseResult(
        name,
        "energy balance error over the stored energy of the formed stack",
        100.0 * abs(energy["balance_error"]) / formed,
        1.0,
        "%",
    )
    yield overlap_result(name, deepest, 40.0)


def closed_stack(gap: float, time: float) -> Simulation:
    """Return three plies between S-shaped tools that close to ``gap`` [mm]."""
    return stack_simulation(
        f"""
        process = {{ time = "{time} s", mass_damping = "100 1/s" }}
        contact = {{ friction = 0.157 }}
        {laid((80.0, 20.0), 10.0)}
        {s_shaped_tools(gap, 10.0 + 3.0 * T - gap + 0.1)}
        """,
    )


@hard_case("closed_tools_on_a_stack", THEME)
def closed_tools_on_a_stack(name: str, full: bool) -> Iterator[CaseResult]:
    """Three plies between S-shaped tools that close to 70 % of their thickness.

    Hard because plies must slide on each other in the bends under the pressure that builds up, and
    each of them must take its third of the gap.
    """
    time, gap = 0.08, 0.7 * 3.0 * T
    sim = closed_stack(gap, time)
    sim.advance_to(time)
    level, bends = [], []
    for body in sim.model.bodies:
        off = np.abs(3e3 * thickness_of(sim, body) / gap - 1.0)
        X = body.mesh.node_positions[body.mesh.elements].mean(axis=1)
        x = np.abs(X[:, 0])
        level.append(off[(x > 0.022) & inside(body, 4e-3)])
        bends.append(off[(x <= 0.022) & inside(body, 4e-3)])
    for where, parts, limit in (("level parts", level, 5.0), ("bends", bends, 10.0)):
        value = 100.0 * float(np.concatenate(parts).max())
        yield CaseResult(name, f"{where}: each ply against a third of the gap", value, limit, "%")
    yield overlap_result(name, deepest_overlap(sim), 30.0)
    yield balance_result(name, sim, 0.1)
    yield CaseResult(name, "kinetic over internal energy at the end", calm(sim), 1.0, "%")
