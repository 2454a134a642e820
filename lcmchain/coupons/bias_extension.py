"""Bias-extension test: a strip with fibres at ±45° is pulled along its length.

Source: Schäfer, Mitsch, Kärger, section 3.2.1 (320 mm x 160 mm, 60 mm). The reference is the
pin-jointed net of inextensible fibres (:class:`lcmchain.coupons.analytic.BiasExtension`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np

from lcmchain.coupons.analytic import BiasExtension
from lcmchain.coupons.result import CouponResult, compared, finish, two_panels
from lcmchain.coupons.specimen import (
    FRAMES,
    Progress,
    PulledStrip,
    clamped_ends,
    effort_of,
    element_centres,
    mean_field,
    record,
    require_fabric,
    shear_stress_of,
)
from lcmchain.effects.supports import Support, translation
from lcmchain.fields import FrameSeries, build_datasets
from lcmchain.materials.fabric import FabricMaterial
from lcmchain.mesh.blank import BlankMesh
from lcmchain.report.style import INK, SERIES
from lcmchain.scene import Element, Scene

# The specimen is pulled at both ends, so that mass and damping load both clamps alike. Inertia and
# damping then add 0.1 N to 6.5 N at 30 mm (measured against the rate of the stored energy).
DURATION = 0.2  # [s] for 60 mm
MASS_DAMPING = 50.0  # [1/s]
# The shear angle is averaged over a square of this size at the centre, as by image correlation.
CENTRE = 0.04  # [m]
COMPARED_AT = 0.03  # displacement up to which the pin-jointed net holds (paper, Fig. 4) [m]


@dataclass(frozen=True)
class BiasExtensionTest(PulledStrip):
    """The test as the forming solver runs it, of whatever strip."""

    displacement: float = 0.06

    name: ClassVar[str] = "bias-extension"

    @property
    def duration(self) -> float:
        """Duration at the speed of the test [s]."""
        return DURATION * self.displacement / 0.06

    @property
    def text(self) -> str:
        """The scene of the published strip, as TOML."""
        return f"""
title = "Bias extension, {1e3 * self.displacement:g} mm"
process = {{ time = "{self.duration:.9g} s", mass_damping = "{MASS_DAMPING} 1/s" }}
blank = {{ size = ["320 mm", "160 mm"], edge_length = "5 mm", fibre_angle = "45 deg" }}
material = {{ preset = "MD600" }}
"""

    def supports(self, scene: Scene) -> Callable[[BlankMesh], list[Support]]:
        """Return what holds the strip: its short sides, each pulled by half the travel."""
        pull, length = self.pull(scene), scene.only_ply("a coupon").blank.extent[0]

        def clamps(blank: BlankMesh) -> list[Support]:
            def half(time: float) -> float:
                return 0.5 * pull.travel(time)

            return clamped_ends(blank, length, lambda side: translation([side, 0, 0], half))

        return clamps


def bias_extension(
    material: FabricMaterial,
    element: Element | None = None,
    *,
    length: float = 0.32,
    width: float = 0.16,
    displacement: float = 0.06,
    edge_length: float = 5e-3,
    progress: Progress | None = None,
) -> CouponResult:
    """Simulate a bias-extension test.

    Parameters
    ----------
    material : material of a scene; element : its element options.
    length, width : free length l0 and width w0 [m].
    displacement : of the clamps at the end [m]; edge_length : of the elements [m].

    Raises
    ------
    InputError : the material is no fabric, l0 < 2 w0, or wrong sizes.
    """
    require_fabric(material)
    analytic = BiasExtension(length, width, material.thickness)
    test = BiasExtensionTest(displacement)
    scene = Scene(
        title=f"Bias extension of {material.name}, {1e3 * displacement:g} mm",
        material=material,
        element=element or Element(),
        process={"time": test.duration, "frames": FRAMES, "mass_damping": MASS_DAMPING},
        blank={
            "size": (length, width),
            "edge_length": edge_length,
            "fibre_angle": fibre_angle_of(material),
        },
    )

    simulation, recording = record(scene, test.supports(scene), progress=progress)
    (body,) = simulation.model.bodies
    centre = element_centres(body.mesh)[:, :2]
    inside = (np.abs(centre) < 0.5 * CENTRE).all(axis=1)
    angle = mean_field(simulation, recording.snapshots[1::2], "shear_angle", inside)
    force, pull = test.force(scene, recording), test.pull(scene)
    u = np.array([pull.travel(t) for t in recording.time[1::2]])

    expected_angle = analytic.shear_angle(u)
    expected_force = analytic.force(expected_angle, shear_stress_of(body.material))
    curves = {
        "displacement [mm]": 1e3 * u,
        "force [N]": force,
        "shear angle [deg]": np.degrees(angle),
        "pin-joint force [N]": expected_force,
        "pin-joint shear angle [deg]": np.degrees(expected_angle),
    }
    at = min(COMPARED_AT, u[-1])
    frames = FrameSeries.from_snapshots(recording.snapshots[::4], ())
    return CouponResult(
        name="bias-extension",
        settings={
            "specimen": f"{1e3 * length:g} mm x {1e3 * width:g} mm",
            "elements": f"{simulation.model.element_count} elements of {1e3 * edge_length:g} mm",
            "duration": f"{1e3 * test.duration:g} ms",
        },
        curves=curves,
        comparisons=tuple(
            compared(
                curves, 1e3 * where, name, unit, reference="pin-joint", origin="pin-jointed net"
            )
            for where in sorted({0.5 * at, at, u[-1]})
            for name, unit in (("shear angle", "deg"), ("force", "N"))
        ),
        draw=lambda path: _draw(path, curves, scene.title),
        datasets=build_datasets(scene, body.mesh, frames, material=body.material),
        shown="shear_angle",
        figures=effort_of(simulation, recording),
    )


def fibre_angle_of(material: FabricMaterial) -> float:
    """Return the angle of fibres 1 to the pull [rad].

    At -45 degrees a strip is sheared to the positive side, as in the picture frame. A fabric that
    is alike to both sides is pulled at 45 degrees, as published.
    """
    return math.copysign(0.25 * math.pi, 1.0 if material.membrane.unlike_sides is None else -1.0)


def _draw(path: Path, curves: dict[str, np.ndarray], title: str) -> None:
    with two_panels(path, "Bias-extension test", title) as (left, right):
        u = curves["displacement [mm]"]
        for axis, name in ((left, "force [N]"), (right, "shear angle [deg]")):
            axis.plot(u, curves[name], "o-", ms=3, lw=1.2, color=SERIES[0], label="simulated")
            axis.plot(u, curves[f"pin-joint {name}"], "--", lw=1.2, color=INK,
                      label="pin-jointed net")  # fmt: skip
            axis.axvline(1e3 * COMPARED_AT, color="#8a929c", lw=0.8, ls=":")
            axis.set_ylabel(name if axis is left else "shear angle at the centre [deg]")
            axis.set_xlabel("displacement [mm]")
            finish(axis)
        left.legend(loc="upper left")
