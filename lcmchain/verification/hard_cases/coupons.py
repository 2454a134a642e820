"""Hard coupons: bias extension to the locking angle, fibres a million times stiffer than shear."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from lcmchain.effects.supports import Support, translation
from lcmchain.verification.hard_cases.case import CaseResult, hard_case
from lcmchain.verification.hard_cases.sheets import (
    MD600,
    fields,
    linear_fabric,
    nodes_at,
    simulation,
    smooth,
)

THEME = "Coupons"


class BiasExtension:
    """A quarter of a bias-extension test, length = 2 width, fibres at 45 degrees [m].

    With inextensible fibres and D = length - width the centre shears by
    γ = π/2 - 2 arccos((D + u)/(√2 D)) at the travel u.
    """

    def __init__(
        self,
        material: str,
        travel: float,
        time: float,
        *,
        size: tuple[float, float] = (0.32, 0.16),
        edge: float = 5e-3,
        damping: float = 200.0,
    ) -> None:
        self.length, self.width = size
        self.travel, self.time = travel, time
        a, b = 0.5e3 * self.length, 0.5e3 * self.width
        corners = ", ".join(f'["{x} mm", "{y} mm"]' for x, y in ((0, 0), (a, 0), (a, b), (0, b)))
        self.sim = simulation(
            f"""
            process = {{ time = "{time} s", mass_damping = "{damping} 1/s" }}
            blank = {{ outline = [{corners}], edge_length = "{edge} m", fibre_angle = "45 deg" }}
            [material]
            {material}
            """,
            supports=self._supports,
        )

    def _supports(self, X):
        left, lower = nodes_at(X, 0, 0.0), nodes_at(X, 1, 0.0)
        grip = nodes_at(X, 0, 0.5 * self.length)
        pull = translation([1, 0, 0], lambda t: 0.5 * self.travel * smooth(t, self.time))
        return [
            Support("centre", np.intersect1d(left, lower), "xy"),
            Support("x = 0", np.setdiff1d(left, lower), "x"),
            Support("y = 0", np.setdiff1d(lower, np.union1d(left, grip)), "y"),
            Support("grip", grip, motion=pull),
        ]

    def run(self) -> None:
        self.sim.advance_to(self.time)

    @property
    def travelled(self) -> float:
        """Present travel of the grip [m]."""
        return self.travel * smooth(self.sim.time, self.time)

    @property
    def kinematic_angle(self) -> float:
        """Present shear angle of the centre for inextensible fibres [rad]."""
        D = self.length - self.width
        return 0.5 * math.pi - 2.0 * math.acos((D + self.travelled) / (math.sqrt(2.0) * D))

    def centre_angle(self) -> float:
        """Mean shear angle [rad] of the elements within a tenth of the width of the centre."""
        blank = self.sim.model.only_body().mesh
        centre = blank.mid_surface_positions[blank.faces].mean(axis=1)
        near = np.linalg.norm(centre[:, :2], axis=1) < 0.1 * self.width
        return float(np.abs(fields(self.sim)["shear_angle"][near]).mean())


# At 71 degrees the fibres of MD600 fill all space and the guard stops a run. These cases ask about
# the numerics beyond that: a tenth of the fibre in the same sheet.
LITTLE_FIBRE = MD600 + '\nfibre_density = "18100 kg/m^3"'


@hard_case("bias_extension", THEME, reduced="in 100 ms; --full: in 200 ms")
def bias_extension(name: str, full: bool) -> Iterator[CaseResult]:
    """Bias extension of MD600, 320 mm x 160 mm, pulled until the centre is sheared by 77 degrees.

    Hard because of the softening and stiffening shear law, fibres that end free, triangles along
    all edges, and the locking angle: beyond 66 mm of travel only fibre stretch can give way.
    """
    time = 0.2 if full else 0.1
    test = BiasExtension(LITTLE_FIBRE, 0.070, time, damping=50.0)
    sim, errors, followed = test.sim, [], None
    largest = 0.0
    for part in np.linspace(0.0, 1.0, 41)[1:]:
        sim.advance_to(float(part * time))
        energy = sim.energy()
        errors.append(abs(energy["balance_error"]))
        largest = max(largest, test.centre_angle())
        if followed is None and test.travelled > 0.040:
            followed = test.centre_angle() - test.kinematic_angle
    yield CaseResult(
        name, "largest shear angle of the centre", math.degrees(largest), 77.0, "°", at_least=True
    )
    yield CaseResult(
        name,
        "centre angle against inextensible fibres at 40 mm",
        math.degrees(abs(followed)),  # type: ignore[arg-type]
        2.0,
        "°",
    )
    yield CaseResult(
        name,
        "energy balance error over the work",
        100.0 * max(errors) / sim.energy()["external"],
        0.1,
        "%",
    )


@hard_case("fibre_to_shear_stiffness", THEME)
def fibre_to_shear_stiffness(name: str, full: bool) -> Iterator[CaseResult]:
    """Bias extension with C11/C12 = 1e4 and 1e6 to a shear angle of 34 degrees.

    Hard because the soft mode must come out right beside a stiffness a million times larger: any
    parasitic fibre strain of the element adds a multiple of the true energy (tension locking). The
    energy of the three zones of the ideal test is known.
    """
    for ratio, time in ((1e4, 0.1), (1e6, 0.4)):
        C12 = 1000.0 / ratio
        material = linear_fabric(C12=C12, B11=40.0, B12=4.0, B33=0.1, B13=0.1)
        test = BiasExtension(material, 0.010, time, size=(0.08, 0.04), damping=100.0)
        test.run()
        gamma, width = test.kinematic_angle, test.width
        density = [0.5e6 * C12 * math.sin(angle) ** 2 for angle in (gamma, 0.5 * gamma)]
        ideal = 1.004e-3 * width**2 * (0.5 * density[0] + density[1]) / 4.0
        yield CaseResult(
            name,
            f"C11/C12 = {ratio:.0e}: stored energy against inextensible fibres",
            100.0 * abs(test.sim.stored_energy() / ideal - 1.0),
            1.0,
            "%",
        )
