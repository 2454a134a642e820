"""What a filling is given that can be computed, but was perhaps not meant."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from lcmchain.coupling.infiltration.flow_medium import lead_length
from lcmchain.mesh.places import Places, place_text

if TYPE_CHECKING:
    from lcmchain.coupling.infiltration.setup import FillingSetup

#: Longest extents [m] between which a part is taken for one.
SMALLEST_PART, LARGEST_PART = 5e-3, 100.0
#: A gate with a larger share of the nodes leaves little to flow through.
MOST_GATE = 0.5
#: A wider race track, in lengths of the mesh's edges, holds more resin than the cells beside it.
WIDEST_TRACK = 1.0


def doubts(setup: FillingSetup, places: Places) -> Iterator[str]:
    """Yield a sentence for each, with its remedy."""
    yield from _size(places)
    yield from _gates(setup, places)
    yield from _never_open(setup)
    yield from _regions(setup, places)
    yield from _flow_medium(setup, places)
    for track in setup.case.race_tracks:
        if track.width > WIDEST_TRACK * places.edge_length:
            yield (
                f'the race track "{track.name}" is {1e3 * track.width:.3g} mm wide, wider than the '
                f"cells of the mesh ({1e3 * places.edge_length:.3g} mm); check its unit"
            )
    if setup.case.gravity is not None and not np.any(setup.case.gravity):
        yield "gravity is zero; leave it out"


def _size(places: Places) -> Iterator[str]:
    extent = float(np.ptp(places.points[places.used], axis=0).max())
    if not SMALLEST_PART <= extent <= LARGEST_PART:
        yield (
            f"the part is {extent:.3g} m long; if its coordinates are not in metres, convert them, "
            "or name their unit with --length-unit where the mesh is mapped"
        )


def _gates(setup: FillingSetup, places: Places) -> Iterator[str]:
    for gate in setup.gates:
        if len(gate.nodes) == 1 and gate.radius is None and gate.flow_rate is None:
            yield (
                f'the gate "{gate.name}" is one node with a pressure: as large as a hole of about '
                f"{1e3 * 0.2 * places.edge_length:.2g} mm radius on this mesh; give its radius, "
                "or name a set, for an answer that does not depend on the mesh"
            )
        share = len(gate.nodes) / len(places.used)
        if share > MOST_GATE:
            yield f'the gate "{gate.name}" is {share:.0%} of all nodes; check its place'


def _never_open(setup: FillingSetup) -> Iterator[str]:
    """Gates and vents that open after the filling has ended."""
    end = setup.case.time
    for kind, entries in (("gate", setup.case.gates), ("vent", setup.case.vents)):
        for entry in entries:
            if entry.opens >= end:
                yield (
                    f'the {kind} "{entry.name}" opens at {entry.opens:g} s, but the filling ends '
                    f"at {end:g} s: it never does; give a longer time, or open it earlier"
                )


def _regions(setup: FillingSetup, places: Places) -> Iterator[str]:
    """Regions that share cells, and denser ones whose permeability stays that of the mapping."""
    regions = setup.case.regions
    rows = [places.cells_of(region, "regions") for region in regions]
    for (one, cells), (other, others) in combinations(zip(regions, rows, strict=True), 2):
        shared = np.intersect1d(cells, others)
        if len(shared):
            first = int(shared[0])
            yield (
                f'the regions "{one.name}" and "{other.name}" share {len(shared)} cells (the first '
                f"is cell {places.cell_number(first)} at {place_text(places.centroids[first])}): "
                "the later one holds there, and both factors of the permeability"
            )
    if setup.case.permeability is None:
        for region in regions:
            given = region.own_permeability is not None or region.permeability_factor != 1.0
            if region.fibre_volume_fraction is not None and not given:
                yield (
                    f'the region "{region.name}" changes the fibre volume fraction, but not the '
                    "permeability, which stays as mapped; give the whole infiltration a "
                    'permeability law, which follows it in every region (its entry "permeability" '
                    'stands beside "regions", not in a region), or the region a '
                    "permeability_factor"
                )


def _flow_medium(setup: FillingSetup, places: Places) -> Iterator[str]:
    """A layer that conducts less than the preform, or whose lead the mesh does not resolve."""
    layer, given, preform = setup.flow_medium, setup.case.flow_medium, setup.preform
    if layer is None or given is None or preform.through_permeability is None:
        return
    cells, best = layer.cells, given.permeability.k1 * max(1.0, given.permeability.ratio)
    largest = np.linalg.eigvalsh(preform.permeability[cells])[:, -1]
    if np.median(preform.thickness[cells] * largest) > layer.thickness * best:
        yield (
            "the preform below the flow medium conducts more than the layer, by thickness times "
            "permeability: resin will not run ahead in it; check both permeabilities"
        )
        return
    lead = lead_length(
        float(np.median(preform.thickness[cells])), float(np.median(preform.porosity[cells])),
        float(np.median(preform.through_permeability[cells])),
        layer.thickness, layer.porosity, best,
    )  # fmt: skip
    if lead < places.edge_length:
        yield (
            f"in the flow medium the front leads by about {1e3 * lead:.2g} mm, less than one edge "
            f"of the mesh ({1e3 * places.edge_length:.3g} mm): the lead is that of the mesh; make "
            "it finer where that matters"
        )
