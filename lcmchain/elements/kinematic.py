"""Scene table of the lowest rung of the model ladder: a pin-jointed net, laid without forces."""

from __future__ import annotations

from typing import ClassVar, Literal

from lcmchain.quantities.entry_types import SceneModel


class KinematicElement(SceneModel):
    """Kinematic draping: a net of inextensible fibres, laid as ``[draping]`` says."""

    has_thickness: ClassVar[bool] = True
    has_forces: ClassVar[bool] = False
    remarks: ClassVar[tuple[str, ...]] = (
        'element = "kinematic" lays a net of inextensible fibres: it predicts no forces, no '
        "wrinkles, no slip and no draw-in by equilibrium, knows neither friction nor holder nor "
        "the stiffness of the fabric, and takes the thickness from constant volume",
    )

    type: Literal["kinematic"] = "kinematic"
