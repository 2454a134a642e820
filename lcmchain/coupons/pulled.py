"""Coupon tests in which the forming solver pulls on a specimen, by name.

Their scene can be any: a study varies its mesh, process and material like those of a scene file.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np

from lcmchain.coupons.bias_extension import BiasExtensionTest
from lcmchain.coupons.off_axis import OffAxisTest
from lcmchain.coupons.picture_frame import PictureFrameTest
from lcmchain.coupons.specimen import Recording
from lcmchain.effects.supports import Support
from lcmchain.mesh.blank import BlankMesh
from lcmchain.quantities.units import Dimension
from lcmchain.scene import Scene


class PulledTest(Protocol):
    """What a test does to the specimen of a scene.

    ``name`` is that of ``lcmchain coupon NAME``; ``driven_by`` names the one argument, how far the
    specimen is pulled, and its dimension.
    """

    @property
    def name(self) -> str:
        """Name of the coupon."""

    @property
    def driven_by(self) -> tuple[str, Dimension]:
        """Name of the argument and its dimension."""

    @property
    def text(self) -> str:
        """Scene of the usual specimen, as TOML."""

    def supports(self, scene: Scene) -> Callable[[BlankMesh], list[Support]]:
        """Return what holds and pulls the specimen of a scene."""

    def force(self, scene: Scene, recording: Recording) -> np.ndarray:
        """Return the force of the testing machine (M,) [N], over equal intervals."""


#: The tests by name.
PULLED: dict[str, Any] = {
    test.name: test for test in (BiasExtensionTest, PictureFrameTest, OffAxisTest)
}
