"""Interface laws, each against its closed form, and their sum.

All models have all laws, most of them without strength, so that they share what is compiled.
"""

from __future__ import annotations

import numpy as np
import pytest
from stacks import (
    ALL,
    BY_HERSEY,
    BY_SPEED,
    CURVE,
    FAR,
    FILM,
    FRICTION,
    MU,
    TACK,
    T,
    drawn,
    ply,
    require_balance,
    scene_of,
    smooth,
    stack,
)

from lcmchain.effects.supports import Support
from lcmchain.errors import InputError
from lcmchain.interfaces.law import Touch, parameters, respond
from lcmchain.interfaces.laws.friction_map import FrictionMapTable, friction_at
from lcmchain.interfaces.laws.viscous_film import ViscousFilmTable
from lcmchain.interfaces.table import Interface
from lcmchain.scene import scene_from_text

WIDTH, HEIGHT = 16.0, 12.0
AREA = 1e-6 * WIDTH * HEIGHT
GAP = 0.02  # of plies that do not press [mm]


def pair(gap=0.0):
    """A long ply and a short one on it, with edges of one length: one loop serves both."""
    bed = ply("bed", width=48.0, height=20.0, edge=4.0, z=0.5 * T)
    shift = (-9.0, 0.0, 0.0)
    return bed, ply("sled", shift=shift, width=WIDTH, height=HEIGHT, edge=4.0, z=1.5 * T + gap)


def rigid(laws, way, time, gap=GAP):
    """Both plies held at all nodes; the upper one moves by ``way(time)`` (3,) [m]; time in ms."""
    bed, sled = pair(gap)
    own = bed.mesh.node_count
    supports = [
        Support("bed", np.arange(own)),
        Support(
            "sled",
            own + np.arange(sled.mesh.node_count),
            motion=lambda t: np.column_stack([np.eye(3), way(t)]),
        ),
    ]
    interface = Interface(between=("bed", "sled"), laws=laws)
    return stack([bed, sled], scene_of(time=time), ALL, interface, supports=supports)


def drag(sim, start, stop):
    """Mean force that moves the upper ply between two times [s], (3,) [N]."""
    sim.advance_to(start)
    before = sim.state.support_impulse[1].copy()
    sim.advance_to(stop)
    return (sim.state.support_impulse[1] - before) / (stop - start)


def test_a_viscous_film_resists_in_proportion_to_the_speed():
    time = 2.0
    speed = 4e-3 / 1.5e-3

    def way(t):  # at rest, then at one speed after a ramp
        ramp = 0.5e-3
        return [speed * (0.5 * t * t / ramp if t < ramp else t - 0.5 * ramp), 0.0, 0.0]

    sim = rigid((FILM,), way, time)
    force = drag(sim, 1e-3, 1.8e-3)
    wanted = FILM.viscosity * speed / FILM.thickness * AREA
    assert force == pytest.approx([wanted, 0.0, 0.0], abs=1e-2 * wanted)
    before = sim.energy()["friction"]
    sim.advance_to(2e-3)
    assert sim.energy()["friction"] - before == pytest.approx(wanted * speed * 0.2e-3, rel=1e-2)
    require_balance(sim)


def test_a_film_acts_within_its_thickness():
    """At a gap above it a ply slides freely; the law itself answers in closed form."""
    law = ViscousFilmTable.gathered([FILM])
    values = parameters(law, 0)
    for gap, part in ((0.09e-3, 1.0), (0.11e-3, 0.0)):
        touch = Touch(gap, gap, 0.0, 1.0, 2.0, (0.0, 0.0, 1.0), (0.0,) * 3, (3e-6, 0.0, 0.0), 1e-6)
        force, tension, stored, lost, memory = respond(law, values, (0.0, 0.0, 0.0), touch)
        wanted = part * FILM.viscosity / FILM.thickness * 3.0 * 2.0
        assert force == pytest.approx((-wanted, 0.0, 0.0)) and memory == force
        assert (tension, stored) == (0.0, 0.0)
        assert lost == pytest.approx(0.5 * wanted * 3e-6)


def test_tack_takes_its_stress_times_the_difference_of_its_distances():
    """Held at 0.2 mm, down to a gap of 0.02 mm, and up again: one cycle."""

    def way(t):
        down = 0.18e-3 * (smooth((t - 2e-3) / 1e-3) - smooth((t - 0.5e-3) / 1e-3))
        return [0.0, 0.0, down]

    sim = rigid((TACK,), way, 3.2, gap=0.2)
    assert np.abs(drag(sim, 0.1e-3, 0.4e-3)).max() < 1e-9
    # the ply is held against the pull of the other one
    assert drag(sim, 1.6e-3, 1.9e-3)[2] == pytest.approx(TACK.stress * AREA, rel=1e-2)
    sim.advance_to(3.1e-3)
    energy = sim.energy()
    cycle = TACK.stress * AREA * (TACK.off - TACK.on)
    assert energy["friction"] == pytest.approx(cycle, rel=1e-2)
    assert energy["external"] == pytest.approx(cycle, rel=1e-2)
    assert energy["contact"] == pytest.approx(0.0, abs=1e-3 * cycle)
    assert np.abs(drag(sim, 3.1e-3, 3.2e-3)).max() < 1e-9


def test_plies_that_are_laid_on_each_other_stick_from_the_start():
    def way(t):
        return [0.0, 0.0, 0.2e-3 * smooth(t / 1e-3)]

    sim = rigid((TACK,), way, 1.0, gap=0.0)
    sim.advance_to(1e-3)
    energy = sim.energy()
    # what the bond stored is booked as given from outside
    assert energy["friction"] == pytest.approx(TACK.stress * AREA * (TACK.off - TACK.on), rel=2e-2)
    assert abs(energy["balance_error"]) < 1e-2 * energy["friction"]


def test_shear_by_points_follows_its_curve_and_unloads_along_its_first_slope():
    legs = [0.05e-3, 0.2e-3, 0.19e-3, 0.25e-3]

    def way(t):
        place, total = 0.0, 0.0
        for number, target in enumerate(legs):
            total += (target - place) * smooth((t / 1e-3 - number) / 0.8)
            place = target
        return [total, 0.0, 0.0]

    sim = rigid((CURVE,), way, 4.0)
    stress = []
    for leg in range(4):
        stress.append(drag(sim, (leg + 0.85) * 1e-3, (leg + 1.0) * 1e-3)[0] / AREA)
    on_the_curve = np.interp([0.05e-3, 0.2e-3, 0.25e-3], CURVE.slip, CURVE.stress)
    assert [stress[0], stress[1], stress[3]] == pytest.approx(on_the_curve, rel=1e-2)
    assert stress[1] - stress[2] == pytest.approx(CURVE.stiffness() * 0.01e-3, rel=1e-2)
    require_balance(sim)
    slips = np.linspace(0.0, 0.25e-3, 1001)
    under = np.trapezoid(np.interp(slips, (0.0, *CURVE.slip), (0.0, *CURVE.stress)), slips)
    spent = sim.energy()["friction"] + sim.energy()["contact"]
    assert spent == pytest.approx(under * AREA, rel=1e-2)


def sled(laws):
    """A small ply that is pressed on a held one and drawn over it."""
    entries = {"time": 8.0, "bottom": -FAR, "top": 2 * T}
    entries |= {"travel": 0.2 * T, "stop": 2.0}
    bed, small = pair()
    own = bed.mesh.node_count
    x = small.mesh.node_positions[:, 0]
    back = own + np.flatnonzero(x < x.min() + 1e-6)
    supports = [Support("bed", np.arange(own)), drawn("grip", back, 8e-3, 2e-3, 8e-3)]
    interface = Interface(between=("bed", "sled"), laws=laws)
    return stack([bed, small], scene_of(**entries), ALL, interface, supports=supports)


SPEED = 8e-3 / (0.8 * 6e-3)  # of the sled while it is measured [m/s]


@pytest.mark.parametrize(
    ("laws", "force"),
    [
        ((BY_SPEED,), lambda load: np.interp(SPEED, [1.0, 3.0], [0.1, 0.3]) * load),
        ((BY_HERSEY,), lambda load: 0.1 * load + 0.5 / 1e-5 * 0.05 * SPEED * AREA),
        ((FRICTION, FILM), lambda load: MU * load + 0.5 * SPEED / 0.1e-3 * AREA),
    ],
    ids=["by speed", "by Hersey number", "friction and film"],
)
def test_a_sled_takes_what_its_laws_say(laws, force):
    """In closed form at any pressure: by Hersey number the force is a line over the load."""
    sim = sled(laws)
    sim.advance_to(4e-3)
    before = sim.state.copy()
    sim.advance_to(6.5e-3)
    after = sim.state
    found = (after.support_impulse[1, 0] - before.support_impulse[1, 0]) / 2.5e-3
    load = (after.tool_impulse[1, 2] - before.tool_impulse[1, 2]) / 2.5e-3
    assert found == pytest.approx(force(load), rel=1e-2)
    require_balance(sim)


def test_a_map_is_linear_between_its_points_and_constant_outside():
    table = FrictionMapTable(
        pressure=(1.0, 3.0, 4.0), speed=(0.0, 1.0), friction=((0.1, 0.2), (0.3, 0.6), (0.5, 0.5))
    )
    law = FrictionMapTable.gathered([None, table])
    assert friction_at(law, 1, 2.0, 0.5) == pytest.approx(0.3)
    assert friction_at(law, 1, 3.5, 1.0) == pytest.approx(0.55)
    assert friction_at(law, 1, 0.0, 0.0) == pytest.approx(0.1)
    assert friction_at(law, 1, 9.0, 9.0) == pytest.approx(0.5)
    assert friction_at(law, 0, 2.0, 0.5) == 0.0


SCENE = """
layup = "[0/90, 45/-45]"
process = { time = "10 ms" }
blank = { size = ["20 mm", "20 mm"], edge_length = "5 mm" }
material = { preset = "MD600" }
[[interfaces]]
"""
FILM_TEXT = '{ type = "viscous_film", viscosity = "1 Pa*s", thickness = "0.1 mm" }'


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            'laws = [{ type = "adhesion", stress = "1 kPa", on = "0.2 mm", off = "0.1 mm" }]',
            r"interfaces\[0\].laws.*off is 0.1 mm, below on, 0.2 mm",
        ),
        (
            'laws = [{ type = "adhesion", stress = "-1 kPa", on = "0.1 mm", off = "0.1 mm" }]',
            r"interfaces\[0\].laws\[0\].*stress.*positive",
        ),
        (
            'laws = [{ type = "shear_by_points", slip = "2 1 um", stress = "1 2 kPa" }]',
            r"interfaces\[0\].laws.*slip does not increase",
        ),
        (
            'laws = [{ type = "shear_by_points", slip = "1 2 um", stress = "1 3 kPa" }]',
            r"steeper before its point \[1\]",
        ),
        (
            'laws = [{ type = "friction_map", pressure = "1 2 kPa", speed = ["1 mm/s"], '
            "friction = [[0.1]] }]",
            r"friction has 1 rows for 2 pressures",
        ),
        (f"laws = [{FILM_TEXT}, {FILM_TEXT}]", 'has "viscous_film" twice'),
        (
            'friction = 0.1\nlaws = [{ type = "coulomb", friction = 0.2 }]',
            r'interfaces\[0\].friction.*beside a law "coulomb"',
        ),
        (
            'laws = [{ type = "glue" }]',
            r'interfaces\[0\].laws\[0\].type.*"glue".*"coulomb"',
        ),
        (
            'laws = [{ type = "viscous_film", viscosity = "1 Pa*s" }]',
            r"interfaces\[0\].laws\[0\].thickness.*is missing",
        ),
    ],
)
def test_wrong_laws_are_told_by_their_entries(text, message):
    with pytest.raises(InputError, match=message):
        scene_from_text(SCENE + text)
