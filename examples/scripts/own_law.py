"""A law of your own: a fabric with a binder that resists shear.

To the shear stress of the fabric comes k g, with g = 2 E12 and the binder's modulus k. The compiled
part answers stress and tangent; the plain part says the same in NumPy, with the energy ½ k g².
`examples/tension_shear` has a law with memory and friction.
Usage: python examples/scripts/own_law.py [FOLDER]
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lcmchain import read_scene, run
from lcmchain.jit import equation
from lcmchain.materials.fabric import (
    Fabric,
    FabricLaw,
    FabricMaterial,
    fabric_bending_stiffness,
    fabric_hourglass_tangent,
    fabric_response,
    fabric_tangent_curvature,
    fabric_tangent_slope,
)
from lcmchain.materials.law import (
    bending_stiffness,
    hourglass_tangent,
    implements,
    membrane_response,
    tangent_curvature,
    tangent_slope,
)
from lcmchain.quantities.entry_types import PositiveStiffness

SCENE = Path(__file__).with_name("dome.toml")
BoundLaw = NamedTuple("BoundLaw", [*FabricLaw.__annotations__.items(), ("binder", float)])  # type: ignore[misc]


@implements(membrane_response, BoundLaw)
@equation
def response(law, E, history):
    S, C = fabric_response(law, E, history)
    shear = S[3] + law.binder * E[3]
    return (S[0], S[1], S[2], shear, S[4], S[5]), (C[0], C[1], C[2], C[3] + law.binder, C[4], C[5])


implements(bending_stiffness, BoundLaw)(fabric_bending_stiffness)
implements(hourglass_tangent, BoundLaw)(fabric_hourglass_tangent)
implements(tangent_slope, BoundLaw)(fabric_tangent_slope)
implements(tangent_curvature, BoundLaw)(fabric_tangent_curvature)


class BoundFabric(Fabric):
    """The fabric with its binder, in plain NumPy."""

    def stress_and_tangent(self, E):
        S, C = super().stress_and_tangent(E)
        S[..., 3] += self.law.binder * np.asarray(E)[..., 3]
        C[..., 3, 3] += self.law.binder
        return S, C

    def membrane_energy(self, E, history=None):
        return (
            super().membrane_energy(E, history) + 0.5 * self.law.binder * np.asarray(E)[..., 3] ** 2
        )


class BoundMaterial(FabricMaterial):
    """Scene entries of the fabric, and the binder."""

    binder: PositiveStiffness

    def build(self) -> BoundFabric:
        law = BoundLaw(*self.law_parameters(), self.binder)
        return BoundFabric(law, **self.sheet_parameters())


def main(folder: Path) -> None:
    """Form the dome without and with a binder of 20 kPa."""
    scene = read_scene(SCENE)
    fabric = run(scene, folder / "fabric").summary
    material = BoundMaterial(**scene.material.model_dump(), binder="20 kPa")
    bound = run(scene.model_copy(update={"material": material}), folder / "bound").summary
    for name, summary in (("fabric", fabric), ("with binder", bound)):
        angle = np.degrees(summary["shear_angle_max_rad"])
        print(f"{name:12s} {angle:5.1f} ° at most, punch {summary['punch_force_max_N']:.2f} N")
    assert bound["punch_force_max_N"] > 1.1 * fabric["punch_force_max_N"]
    assert bound["balance_error_max"] < 0.005  # the energy fits the stress


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "results/scripts/own_law"))
