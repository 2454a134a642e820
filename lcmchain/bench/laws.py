"""Speed of the element kernel with what the law of a fabric may know beside the published one.

Each on the blank of the hemisphere, formed a little: kernels of different laws in turn, several
times, so that phases of the machine meet all of them.
"""

from __future__ import annotations

from statistics import median
from typing import NamedTuple

from lcmchain.bench import hemisphere
from lcmchain.bench.measure import KERNEL_CALLS, kernel_work, measure
from lcmchain.compilation.threads import use_threads
from lcmchain.scene import scene_from_text
from lcmchain.solver.simulation import Simulation

_CURVE = (
    "material.bending.curve_1.curvature=2 3 5 10 20 1/m",
    "material.bending.curve_1.moment=2.4 3.0 3.2 3.5 3.8 mN",
)
_TABLE = (
    "material.compaction.table=["
    '{shear_angle = "0 deg", stretch = [1.0, 0.9, 0.75], pressure = "0 0.02 0.4 MPa"},'
    '{shear_angle = "30 deg", stretch = [1.1, 0.99, 0.82], pressure = "0 0.02 0.4 MPa"},'
    '{shear_angle = "50 deg", stretch = [1.4, 1.25, 1.0], pressure = "0 0.02 0.4 MPa"}]',
)
# A dashpot and two Maxwell elements: six numbers that each element remembers.
_VISCOUS = (
    "material.viscous.viscosity=200 Pa*s",
    'material.viscous.maxwell=[{ modulus = "0.03 MPa", relaxation_time = "20 ms" }, '
    '{ modulus = "0.01 MPa", relaxation_time = "0.5 s" }]',
)
# One family, by the round numbers of examples/hemisphere_unidirectional.
_UNIDIRECTIONAL = """material={ law = "fibre-families", thickness = "1.004 mm",
areal_mass = "600 g/m^2", fibre_density = "1810 kg/m^3",
membrane = { C23 = "0.1 MPa", C13 = "0.1 MPa" },
compaction = { c0 = "0.1563 MPa", c1 = 60.4653, c2 = 2.4528 },
bending = { C33 = "0.1 MPa", C23 = "0.1 MPa", C13 = "0.1 MPa" },
fibres = [{ angle = "0 deg", tension = "1000 MPa", compression = "50 MPa", bending = "80 MPa" }],
across = { tension = "4 MPa", compression = "20 MPa", bending = "4 MPa", torsion = "4 MPa",
shear_polynomial = "1.5 0 4 0 0 MPa" } }""".replace("\n", " ")
#: Overrides of the scene by what they add.
LAWS: dict[str, tuple[str, ...]] = {
    "as published": (),
    "locking": (
        "material.membrane.locking_angle=50 deg",
        "material.membrane.locking_stiffness=80 MPa",
    ),
    "permanent set": ("material.law=fabric-with-set", "material.compaction.permanent_set=0.3"),
    "shear-compaction coupling": ("material.compaction.shear_coupling=1.0",),
    "pressures by a table": _TABLE,
    "bending by curves": _CURVE,
    "viscous shear, two Maxwell elements": _VISCOUS,
    "one fibre family": (_UNIDIRECTIONAL,),
}
ROUNDS = 5
FORMED = 0.3  # of the way to the middle of the stroke


class LawSpeed(NamedTuple):
    """Time of the kernel per element [µs], and over that of the published law."""

    name: str
    time: float
    ratio: float


def measure_laws(*overrides: str) -> list[LawSpeed]:
    """Measure the kernel of every law on one core; overrides : of the scene, for tests."""
    calls = []
    for own in LAWS.values():
        scene = scene_from_text(hemisphere.SCENE, overrides=(*own, *overrides))
        simulation = Simulation.from_scene(scene)
        simulation.advance_to(FORMED * hemisphere.MID_STROKE)
        work = kernel_work(simulation, simulation.model.only_body().data)
        calls.append((work, KERNEL_CALLS * simulation.model.element_count))
    use_threads(1)
    times: list[list[float]] = [[] for _ in LAWS]
    for _ in range(ROUNDS):
        for kept, (work, count) in zip(times, calls, strict=True):
            kept.append(measure("kernel", 1, count, work).median)
    use_threads(None)
    found = [median(kept) for kept in times]
    return [LawSpeed(name, time, time / found[0]) for name, time in zip(LAWS, found, strict=True)]
