"""Scenes of fibre families: what is refused, and what lay-ups, checks and pictures make of them."""

from __future__ import annotations

import math

import pytest

from lcmchain.errors import InputError
from lcmchain.scene import scene_from_text

HEAD = """
process = {{ time = "10 ms" }}
blank = {{ size = ["40 mm", "40 mm"], edge_length = "10 mm" }}
{extra}
[material]
law = "fibre-families"
thickness = "0.5 mm"
areal_mass = "300 g/m^2"
fibre_density = "1800 kg/m^3"
membrane = {{ C23 = "0.1 MPa", C13 = "0.1 MPa" }}
compaction = {{ c0 = "0.1 MPa", c1 = 50.0, c2 = 2.0 }}
bending = {{ C33 = "0.1 MPa", C23 = "0.1 MPa", C13 = "0.1 MPa" }}
"""
FAMILY = """
[[material.fibres]]
angle = "{} deg"
tension = "1000 MPa"
compression = "50 MPa"
bending = "30 MPa"
"""
ACROSS = """
[material.across]
tension = "2 MPa"
compression = "1 MPa"
bending = "1 MPa"
shear_polynomial = "0.3 0 0 0 0 MPa"
torsion = "1 MPa"
"""
PAIR = """
[[material.shear]]
between = [{}, {}]
shear_polynomial = "0.3 0 0 0 0 MPa"
torsion = "1 MPa"
"""


def scene(angles, *tables, extra=""):
    families = "".join(FAMILY.format(angle) for angle in angles)
    return scene_from_text(HEAD.format(extra=extra) + families + "".join(tables))


UD = ([0], ACROSS)
BIAXIAL = ([0, 50], PAIR.format(1, 2))
THREE = ([0, 60, -60], PAIR.format(1, 2), PAIR.format(2, 3))


@pytest.mark.parametrize("case", [UD, BIAXIAL, THREE, ([0, 60, -60],)])
def test_one_two_and_three_families_are_read(case):
    angles, *tables = case
    material = scene(angles, *tables).material.build()
    assert material.fibre_angles == pytest.approx([math.radians(angle) for angle in angles])
    assert len(material.pairs) == len(tables)


CURVED = ACROSS.replace('tension = "2 MPa"', "tension_curve = {{ strain = {}, stress = {} }}")
WRONG = {
    "no family": (([], ACROSS), "material.fibres", "is missing"),
    "four families": (
        ([0, 45, 90, 135],), "material.fibres", "has 4 families; a fabric has 1 to 3"
    ),
    "families that coincide": (
        ([0, 60, 182],), "material.fibres", "families 1 and 3 at 0 and 182 deg"
    ),
    "nothing across": (([0],), "material.across", "is needed for a single family"),
    "across of two": (([0, 90], PAIR.format(1, 2), ACROSS), "material.across", "leave it out"),
    "no shear": (([0, 90],), "material.shear", "nothing resists shear"),
    "shear of one": (([0], ACROSS, PAIR.format(1, 2)), "material.shear", "there is one"),
    "a pair of one": (([0, 90], PAIR.format(1, 1)), "material.shear", "between = [1, 1]"),
    "a third of two": (([0, 90], PAIR.format(1, 3)), "material.shear", "between = [1, 3]"),
    "a pair twice": (
        ([0, 90], PAIR.format(1, 2), PAIR.format(2, 1)), "material.shear", "[2, 1] twice"
    ),
    "no compression": (
        ([0], ACROSS.replace('compression = "1 MPa"', "")),
        "material.across.compression", "fibres that buckle",
    ),
    "neither modulus nor curve": (
        ([0], ACROSS.replace('tension = "2 MPa"', "")), "material.across.tension", "tension_curve"
    ),
    "modulus and curve": (
        ([0], ACROSS + 'tension_curve = { strain = [0.1], stress = ["1 MPa"] }'),
        "material.across.tension_curve", "stands beside tension",
    ),
    "a curve that falls": (
        ([0], CURVED.format("[0.1, 0.2]", '"2 1 MPa"')),
        "material.across.tension_curve.stress", "does not rise at point 2",
    ),
    "a strain twice": (
        ([0], CURVED.format("[0.1, 0.1]", '"1 2 MPa"')),
        "material.across.tension_curve.strain", "does not rise at point 2",
    ),
    "points of one kind alone": (
        ([0], CURVED.format("[0.1, 0.2]", '["1 MPa"]')),
        "material.across.tension_curve.stress", "1 stresses for 2 strains",
    ),
    "too many points": (
        ([0], CURVED.format("[0.1, 0.2, 0.3, 0.4, 0.5, 0.6]", '"1 2 3 4 5 6 MPa"')),
        "material.across.tension_curve.strain", "has 6 points; at most 5",
    ),
    "a curve slower than the section": (
        ([0], CURVED.format("[0.1, 0.9]", '"1 1.01 MPa"')),
        "material.across.tension_curve", "falls; check the points",
    ),
    "locking below zero": (
        ([0, 90], PAIR.format(1, 2) + 'locking_angle = "-5 deg"\nlocking_stiffness = "9 MPa"'),
        "material.shear[0].locking_angle", "above 0 and below 90",
    ),
    "locking where families meet": (
        ([0, 40], PAIR.format(1, 2) + 'locking_angle = "45 deg"\nlocking_stiffness = "9 MPa"'),
        "material.shear", "lie on each other after 40 deg",
    ),
    "locking without a stiffness": (
        ([0, 90], PAIR.format(1, 2) + 'locking_angle = "45 deg"'),
        "material.shear[0].locking_stiffness", "needed together with locking_angle",
    ),
    "falling shear": (
        ([0, 90], PAIR.format(1, 2).replace("0.3 0 0", "0.3 -1 0")),
        "material.shear", "falling shear stress from a shear strain of 0.3",
    ),
    "no torsion": (
        ([0], ACROSS.replace('torsion = "1 MPa"', "")), "material.across", "needs torsion"
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_wrong_input_names_its_key(name):
    (angles, *tables), key, words = WRONG[name]
    with pytest.raises(InputError) as caught:
        scene(angles, *tables)
    message = str(caught.value)
    assert f"{key}: " in message or f"{key} " in message
    assert words in message


def test_plies_of_single_families_are_laid_by_one_angle_each():
    found = scene(*UD, extra='layup = "[0, 90, 45]"')
    angles = [math.degrees(ply.blank.fibre_angle) for ply in found.stack]
    assert angles == pytest.approx([0.0, 90.0, 45.0])
    for code in ("[0/90]", "[±45]", "[0, (0/90)]"):
        with pytest.raises(InputError, match="layup.*two families at a right angle"):
            scene(*UD, extra=f'layup = "{code}"')
    assert len(scene([0, 90], PAIR.format(1, 2), extra='layup = "[0/90]2"').stack) == 2


def test_switches_and_overrides_reach_the_families():
    """A modulus by its number, and effects switched off by [effects]."""
    angles, table = BIAXIAL
    locks = table + 'locking_angle = "20 deg"\nlocking_stiffness = "9 MPa"\n'
    own = scene(angles, locks).material
    assert own.locks and own.compacts and own.bends_in_plane
    assert not own.without_locking().build().locks
    assert not own.without_compaction().build().compacts
    assert own.without_in_plane_bending().build().fibre_bending == (0.0, 0.0)
    # fibres at 50 degrees follow no lines of the mesh: those at 0 alone bend within the plane
    inertia = 0.1 * 0.5e-3**3 / 12.0
    assert own.build().fibre_bending == pytest.approx((30e6 * inertia, 0.0))
    changed = scene_from_text(
        HEAD.format(extra="") + "".join(FAMILY.format(angle) for angle in angles) + locks,
        overrides=["material.fibres.1.tension=700 MPa"],
    )
    assert changed.material.fibres[1].tension == 700e6


def test_a_net_is_not_laid_for_other_families():
    assert scene([0, 90], PAIR.format(1, 2)).material.is_biaxial
    for case in (UD, BIAXIAL, THREE):
        assert not scene(case[0], *case[1:]).material.is_biaxial
