"""Forming results with the permeability of the formed textile, which a fluid needs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lcmchain.coupling.permeability import principal_permeabilities
from lcmchain.fields import FrameSeries, Histories, add_face_variables, model_datasets
from lcmchain.fields.sheet import face_normals, families_of, vector
from lcmchain.fields.stages import with_stages
from lcmchain.quantities.fields import FIELDS
from lcmchain.results import COMPLETE
from lcmchain.scene import Scene
from lcmchain.scene.infiltration.laws import Permeability
from lcmchain.solver.simulation import Simulation, Snapshot

if TYPE_CHECKING:
    import xarray as xr


def forming_datasets(
    scene: Scene, simulation: Simulation, snapshots: Sequence[Snapshot], *, state: str = COMPLETE
) -> dict[str, xr.Dataset]:
    """Return the groups of ``forming.nc``, as a run and a unit of a co-simulation write them.

        Parameters
        ----------
        snapshots : saved frames, the first of them the start.
    state : of the run (:mod:`lcmchain.results.folder`), written as the global attribute ``state``.
    """
    model = simulation.model
    frames = FrameSeries.from_snapshots(snapshots, model.tool_names)
    histories = Histories.from_state(model, simulation.state)
    datasets = model_datasets(scene, model, frames, histories, attributes={"state": state})
    return with_permeability(scene, with_stages(scene, datasets))


def with_permeability(scene: Scene, datasets: dict[str, xr.Dataset]) -> dict[str, xr.Dataset]:
    """Return the groups of ``forming.nc`` with the permeabilities of the scene's law, if any."""
    if scene.permeability is None:
        return datasets
    fields = permeability_fields(scene.permeability, datasets["/"], scene.source.directory)
    return add_face_variables(datasets, fields)


def permeability_fields(
    law: Permeability, sheet: xr.Dataset, directory: Path | None = None
) -> dict[str, np.ndarray | tuple[np.ndarray, dict[str, str]]]:
    """Return principal permeabilities (F, E) [m2] and their axes (F, E, 3), in all saved states.

    They are not a number where the fibre volume fraction is outside the range of the law.

    Parameters
    ----------
    directory : folder to which a file that the law names is relative.
    """
    fraction = sheet["fibre_volume_fraction"].values
    families = [
        vector(sheet, f"fibre_direction_{family}").reshape(-1, 3) for family in families_of(sheet)
    ]
    frames = range(len(fraction))
    normal = np.stack([face_normals(sheet, frame) for frame in frames]).reshape(-1, 3)
    principal = principal_permeabilities(
        law, fraction.ravel(), *families, normal=normal, out_of_range="nan", directory=directory
    )
    fields: dict[str, np.ndarray | tuple[np.ndarray, dict[str, str]]] = {}
    for number in (1, 2, 3):
        values = getattr(principal, f"k{number}").reshape(fraction.shape)
        field = FIELDS[f"permeability_{number}"]
        attributes = field.attributes(field.name) | {"long_name": f"{field.long_name} ({law.law})"}
        axes = getattr(principal, f"direction_{number}").reshape(*fraction.shape, 3)
        fields[field.name] = values, attributes
        fields[f"permeability_direction_{number}"] = axes
    return fields
