"""Off-axis tension: a strip whose first fibres lie at 30, 45 or 60 degrees to the pull.

The clamps are oblique: they hold the ends along the pull alone, on the tilted lines on which the
ends of an evenly stretched strip lie. The whole strip is then in the state of
:mod:`lcmchain.coupons.analytic.off_axis`, whatever its length. Between straight clamps it is not,
and fibres carry what the clamps do to its ends far into it.

Source: off-axis tests of a unidirectional fabric at 30, 45 and 60 degrees: Karlsruhe,
doi 10.5445/IR/1000174521; oblique clamps: Sun, Chung, Composites 24 (1993) 619.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np

from lcmchain.coupons.analytic.off_axis import affine_tension, lines_of
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
    require_no_friction,
    require_solid_shell,
)
from lcmchain.effects.supports import Support
from lcmchain.errors import InputError
from lcmchain.fields import FrameSeries, build_datasets
from lcmchain.materials.laws import AnyMaterial
from lcmchain.mesh.blank import BlankMesh
from lcmchain.report.style import INK, SERIES
from lcmchain.scene import Element, Scene

DURATION = 0.2  # [s], whatever the displacement
MASS_DAMPING = 50.0  # [1/s]
#: The shear angle is averaged over the middle of the strip, this part of length and width.
MIDDLE = 0.5
#: The tabulated states between which the motion of the ends is interpolated.
STATES = 201


@dataclass(frozen=True)
class OffAxisTest(PulledStrip):
    """The test as the forming solver runs it."""

    displacement: float = 0.01

    name: ClassVar[str] = "off-axis"

    @property
    def text(self) -> str:
        """The scene of a strip at 45 degrees, as TOML."""
        return f"""
title = "Off-axis tension, {1e3 * self.displacement:g} mm"
process = {{ time = "{DURATION} s", mass_damping = "{MASS_DAMPING} 1/s" }}
blank = {{ size = ["160 mm", "40 mm"], edge_length = "5 mm", fibre_angle = "45 deg" }}
material = {{ preset = "MD600" }}
"""

    def supports(self, scene: Scene) -> Callable[[BlankMesh], list[Support]]:
        """Return what holds the strip: its short sides, along the pull on a line that tilts."""
        ply = scene.only_ply("a coupon")
        length = ply.blank.extent[0]
        pull = self.pull(scene)
        travel = np.linspace(0.0, self.displacement, STATES)
        states = affine_tension(ply.built_material(), ply.blank.fibre_angle, 1.0 + travel / length)

        def tilted(time: float) -> np.ndarray:
            u = pull.travel(time)
            motion = np.eye(3, 4)
            motion[0, :2] = 1.0 + u / length, np.interp(u, travel, states.tilt)
            return motion

        def clamps(blank: BlankMesh) -> list[Support]:
            return clamped_ends(blank, length, lambda side: tilted, "x")

        return clamps


def off_axis(
    material: AnyMaterial,
    element: Element | None = None,
    *,
    angle: float = 0.25 * math.pi,
    length: float = 0.16,
    width: float = 0.04,
    displacement: float = 0.01,
    edge_length: float = 5e-3,
    progress: Progress | None = None,
) -> CouponResult:
    """Simulate off-axis tension.

    Parameters
    ----------
    material : material of a scene, with fibres; element : its element options.
    angle : of the first family of fibres from the pull [rad], between 0 and 90 degrees.
    length, width : of the strip between the clamps [m].
    displacement : of the clamps at the end [m]; edge_length : of the elements [m].

    Raises
    ------
    InputError : a material without fibres or with friction in shear, an angle that is no off-axis
        angle, or a strip that locks before the end.
    """
    require_solid_shell(element)
    _require_off_axis(material, angle)
    first, apart = lines_of(material.build())
    test = OffAxisTest(displacement)
    turn = angle - first
    scene = Scene(
        title=f"Off-axis tension of {material.name} at {math.degrees(angle):g}°",
        material=material,
        element=element or Element(),
        process={"time": DURATION, "frames": FRAMES, "mass_damping": MASS_DAMPING},
        blank={"size": (length, width), "edge_length": edge_length, "fibre_angle": turn},
    )
    simulation, recording = record(scene, test.supports(scene), progress=progress)
    (body,) = simulation.model.bodies
    centre = np.abs(element_centres(body.mesh)[:, :2])
    inside = (centre < 0.5 * MIDDLE * np.array([length, width])).all(axis=1)
    sheared = mean_field(simulation, recording.snapshots[1::2], "shear_angle", inside)
    pull = test.pull(scene)
    u = np.array([pull.travel(t) for t in recording.time[1::2]])
    states = affine_tension(body.material, turn, 1.0 + u / length)
    curves = {
        "displacement [mm]": 1e3 * u,
        "force [N]": test.force(scene, recording),
        "shear angle [deg]": np.degrees(sheared),
        "affine force [N]": states.force(width, material.thickness),
        "affine shear angle [deg]": np.degrees(np.abs(states.shear_angle(angle, apart))),
    }
    frames = FrameSeries.from_snapshots(recording.snapshots[::4], ())
    return CouponResult(
        name="off-axis",
        settings={
            "specimen": f"{1e3 * length:g} mm x {1e3 * width:g} mm",
            "fibres": f"at {math.degrees(angle):g} deg",
            "elements": f"{simulation.model.element_count} elements of {1e3 * edge_length:g} mm",
            "duration": f"{1e3 * DURATION:g} ms",
        },
        curves=curves,
        comparisons=tuple(
            compared(
                curves,
                1e3 * where,
                name,
                unit,
                reference="affine",
                origin="even state of the strip",
            )
            for where in (0.5 * u[-1], u[-1])
            for name, unit in (("force", "N"), ("shear angle", "deg"))
        ),
        draw=lambda path: _draw(path, curves, scene.title),
        datasets=build_datasets(scene, body.mesh, frames, material=body.material),
        shown="shear_angle",
        figures=effort_of(simulation, recording),
    )


def _require_off_axis(material: AnyMaterial, angle: float) -> None:
    """Refuse materials without fibres or with friction in shear, and angles along or across."""
    require_no_friction(material)
    if not material.has_fibres:
        raise InputError(
            f'is "{material.law}", which has no fibres; off-axis tension needs law = "fabric" '
            'or "fibre-families"',
            key="material.law",
        )
    if not 0.0 < angle < 0.5 * math.pi:
        raise InputError(
            f"is {math.degrees(angle):.4g} deg; off-axis tension is at more than 0 and less than "
            "90 deg, usually 30, 45 or 60",
            key="angle",
        )


def _draw(path: Path, curves: dict[str, np.ndarray], title: str) -> None:
    with two_panels(path, "Off-axis tension", title) as (left, right):
        u = curves["displacement [mm]"]
        for axis, name in ((left, "force [N]"), (right, "shear angle [deg]")):
            axis.plot(u, curves[name], "o-", ms=3, lw=1.2, color=SERIES[0], label="simulated")
            axis.plot(u, curves[f"affine {name}"], "--", lw=1.2, color=INK, label="even state")
            axis.set_ylabel(name)
            axis.set_xlabel("displacement [mm]")
            finish(axis)
        left.legend(loc="upper left")
