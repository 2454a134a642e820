"""Closed-form relations of the coupon tests: what a fabric law means for force and shape.

``pure_shear`` (bias extension, picture frame), ``off_axis`` (strips at an angle to the fibres),
``plate_compaction``, ``strip_bending`` (cantilevers). Coupons are compared with them, and
identification fits them.
"""

from lcmchain.coupons.analytic.plate_compaction import (
    compaction_pressure,
    compaction_strain,
    power_law_fibre_volume_fraction,
    power_law_pressure,
)
from lcmchain.coupons.analytic.pure_shear import (
    BiasExtension,
    PictureFrame,
    ShearStress,
    shear_strain,
)
from lcmchain.coupons.analytic.strip_bending import (
    CANTILEVER_ANGLE,
    Elastica,
    MomentCurve,
    bending_stiffness_from_overhang,
    curve_elastica,
    curve_elastica_with_tip_slope,
    elastica,
    elastica_with_tip_slope,
    load_parameter_at_chord_angle,
    overhang_at_angle,
    overhang_by_curve,
    strip_stiffness,
)

__all__ = [
    "CANTILEVER_ANGLE",
    "BiasExtension",
    "Elastica",
    "MomentCurve",
    "PictureFrame",
    "ShearStress",
    "bending_stiffness_from_overhang",
    "compaction_pressure",
    "compaction_strain",
    "curve_elastica",
    "curve_elastica_with_tip_slope",
    "elastica",
    "elastica_with_tip_slope",
    "load_parameter_at_chord_angle",
    "overhang_at_angle",
    "overhang_by_curve",
    "power_law_fibre_volume_fraction",
    "power_law_pressure",
    "shear_strain",
    "strip_stiffness",
]
