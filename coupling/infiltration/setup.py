"""Set-up of a filling: the places and materials of a case, found on the mesh of a formed part."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path

import numpy as np

from lcmchain.coupling.infiltration.cell_permeability import factor_of, require_permeable
from lcmchain.coupling.infiltration.filling import Filling, FillingOptions
from lcmchain.coupling.infiltration.flow.boundaries import (
    Gate,
    Schedule,
    TimeTable,
    Vent,
    largest_until,
)
from lcmchain.coupling.infiltration.flow.film import Film
from lcmchain.coupling.infiltration.flow.flow_medium import FlowMedium, Links, lead_length
from lcmchain.coupling.infiltration.flow.network import RaceTrack
from lcmchain.coupling.infiltration.flow.preform import FlowMesh, Preform
from lcmchain.coupling.infiltration.formed_part import (
    PERMEABILITIES,
    FormedPart,
    axes_in_plane,
    require_origin,
    with_own_permeability,
    with_permeability,
)
from lcmchain.coupling.infiltration.resin import resin_of
from lcmchain.coupling.infiltration.resin_temperature import temperature_of
from lcmchain.errors import InputError
from lcmchain.mapping.target import TargetMesh
from lcmchain.mesh.places import NamedPlace, Places, Where, place_text
from lcmchain.scene import infiltration as scene


@dataclass(frozen=True)
class FillingSetup:
    """A part with all that its filling needs.

    Parameters
    ----------
    part : with the thickness, fibre volume fraction and permeability of the regions.
    case : of the scene.
    mesh, preform, gates, vents, race_tracks : arguments of the filling.
    wetted : rows of nodes that are full at the start.
    film : resin on the preform, if there is any.
    warnings : for the user, before the filling.
    flow_medium : layer on the preform, if there is one; resin of gates on it enters it.
    """

    part: FormedPart
    case: scene.Infiltration
    mesh: FlowMesh
    preform: Preform
    gates: tuple[Gate, ...]
    vents: tuple[Vent, ...]
    race_tracks: tuple[RaceTrack, ...]
    wetted: np.ndarray
    film: Film | None
    warnings: tuple[str, ...]
    flow_medium: FlowMedium | None = None

    @property
    def resin_density(self) -> float:
        """Density of the resin [kg/m3]."""
        return self.case.resin.density

    def filling(self) -> Filling:
        """Return the filling at its start."""
        gravity = None if self.case.gravity is None else np.array(self.case.gravity)
        mesh, preform, links = self.layers()
        gates, vents, wetted = self.gates, self.vents, self.wetted
        if links is not None:
            gates, vents, wetted = _on_layer(gates, vents, wetted, links)
        return Filling(
            mesh,
            preform,
            resin_of(self.case.resin),
            gates,
            vents,
            temperature=temperature_of(self.case.resin),
            gravity=gravity,
            wetted=wetted if len(wetted) else None,
            film=self.film,
            edges=self.race_tracks,
            links=links,
            options=FillingOptions(trapped_air=self.case.trapped_air),
        )

    def layers(self) -> tuple[FlowMesh, Preform, Links | None]:
        """Return mesh and preform with the flow medium, and its links; without one as they are."""
        if self.flow_medium is None:
            return self.mesh, self.preform, None
        return self.flow_medium.layered(self.mesh, self.preform)


def _on_layer(
    gates: Sequence[Gate], vents: Sequence[Vent], wetted: np.ndarray, links: Links
) -> tuple[tuple[Gate, ...], tuple[Vent, ...], np.ndarray]:
    """Return gates moved into the layer where they are on it; vents and wetted nodes in both."""

    def above(nodes: np.ndarray) -> np.ndarray:
        return links.above[np.isin(links.below, nodes)]

    moved = tuple(
        replace(gate, nodes=np.union1d(np.setdiff1d(gate.nodes, links.below), above(gate.nodes)))
        for gate in gates
    )
    both = tuple(replace(vent, nodes=np.union1d(vent.nodes, above(vent.nodes))) for vent in vents)
    return moved, both, np.union1d(wetted, above(wetted))


def set_up(
    part: FormedPart,
    case: scene.Infiltration,
    directory: Path | None = None,
) -> FillingSetup:
    """Find the places of a case on a part, and give the cells their material.

    Parameters
    ----------
    directory : folder to which file names in the case are relative.

    Raises
    ------
    InputError : a place that is not on the mesh, a node that is in a gate and a vent, cells through
        which nothing can flow, or a loose piece of the mesh that no resin can reach.
    """
    require_origin(part, case.preform)
    mesh = FlowMesh.from_target(part.target)
    places = _places(mesh, part.target)
    part = _with_regions(part, case, places, directory)
    require_permeable(part)
    factor = factor_of(part, case.permeability, directory, pressed=case.closure is not None)
    preform = Preform.from_mapped(part.dataset, factor=factor)
    gates = tuple(_gate(gate, places, key) for key, gate in _keyed("gates", case.gates))
    vents = tuple(
        _vent(vent, case.vent_pressure, places, key, gates)
        for key, vent in _keyed("vents", case.vents)
    )
    _require_apart(gates, vents, places)
    wetted = [places.nodes(place, key) for key, place in _keyed("wetted", case.wetted)]
    wet = np.unique(np.concatenate(wetted)) if wetted else np.empty(0, dtype=np.int64)
    tracks = tuple(
        _race_track(track, preform.thickness, places, key)
        for key, track in _keyed("race_tracks", case.race_tracks)
    )
    film = _film(case.film, places)
    medium = _flow_medium(case.flow_medium, part, places)
    if medium is not None:
        medium.layered(mesh, preform)  # raises where an entry is missing
        _require_on_one(gates, medium.nodes(mesh))
    under_film = np.empty(0, dtype=np.int64)
    if film is not None:
        under_film = np.flatnonzero(np.asarray(film.thickness) > 0.0)
    _require_reached(mesh, gates, vents, np.union1d(wet, under_film), places)
    setup = FillingSetup(part, case, mesh, preform, gates, vents, tracks, wet, film, (), medium)
    return replace(setup, warnings=(*part.warnings, *mesh.warnings(), *_doubts(setup, places)))


def require_places(target: TargetMesh, case: scene.Infiltration) -> None:
    """Refuse an infiltration whose places are not on a mesh, before anything is computed.

    Raises
    ------
    InputError : as of :func:`set_up`.
    """
    mesh = FlowMesh.from_target(target)
    places = _places(mesh, target)
    gates = tuple(_gate(gate, places, key) for key, gate in _keyed("gates", case.gates))
    vents = tuple(
        _vent(vent, case.vent_pressure, places, key, gates)
        for key, vent in _keyed("vents", case.vents)
    )
    _require_apart(gates, vents, places)
    _film(case.film, places)
    for key, place in _keyed("wetted", case.wetted):
        places.nodes(place, key)
    for key, place in _keyed("race_tracks", case.race_tracks):
        places.edges(place, key)
    for key, place in _keyed("regions", case.regions):
        places.cells_of(place, key)
    if case.flow_medium is not None and case.flow_medium.over is not None:
        places.cells_of(case.flow_medium.over, "flow_medium.over")


def _places(mesh: FlowMesh, target: TargetMesh) -> Places:
    """Return the places of a mesh, with the numbers of the user's file."""
    used = np.unique(target.corners[target.corners >= 0])
    return Places(
        mesh.points, mesh.cells, mesh.node_sets, mesh.cell_sets, target.node_ids[used],
        target.cell_ids,
    )  # fmt: skip


def _keyed(table: str, entries: Sequence[NamedPlace]):
    """Return pairs of the key in the scene and the entry."""
    return [(f'{table}[{k}] "{entry.name}"', entry) for k, entry in enumerate(entries)]


def _with_regions(
    part: FormedPart, case: scene.Infiltration, places: Places, directory: Path | None
) -> FormedPart:
    """Give the cells of regions their thickness, fibre volume fraction and permeability."""
    cells = [places.cells_of(region, key) for key, region in _keyed("regions", case.regions)]
    dataset = part.dataset.copy()
    for name in ("thickness", "fibre_volume_fraction"):
        values = part.cell(name).copy()
        for region, rows in zip(case.regions, cells, strict=True):
            value = getattr(region, name)
            if value is not None:
                values[rows] = value
        for ply in part.ply_names if name == "fibre_volume_fraction" else ():
            of_ply = f"{ply}_{name}"  # all plies become denser by the same factor
            scaled = values / part.cell(name) * part.cell(of_ply)
            dataset[of_ply] = dataset[of_ply].copy(data=scaled)
        dataset[name] = dataset[name].copy(data=values)
    part = with_permeability(replace(part, dataset=dataset), case.permeability, directory)
    for (key, region), rows in zip(_keyed("regions", case.regions), cells, strict=True):
        if region.own_permeability is not None:
            own = region.own_permeability
            part = with_own_permeability(part, own, rows, f"{key}.own_permeability")
    dataset = part.dataset.copy()
    for name in PERMEABILITIES:
        if name in dataset:
            values = part.cell(name).copy()
            for region, rows in zip(case.regions, cells, strict=True):
                values[rows] *= region.permeability_factor
            dataset[name] = dataset[name].copy(data=values)
    return replace(part, dataset=dataset)


def _schedule(opening, places: Places, key: str) -> Schedule:
    def rows(where: Where | None, name: str) -> np.ndarray:
        empty = np.empty(0, dtype=np.int64)
        return empty if where is None else places.nodes(where, f"{key}.{name}")

    return Schedule(
        opening.opens,
        np.inf if opening.closes is None else opening.closes,
        rows(opening.opens_on_arrival, "opens_on_arrival"),
        rows(opening.closes_on_arrival, "closes_on_arrival"),
    )


def _gate(gate: scene.Gate, places: Places, key: str) -> Gate:
    nodes = places.nodes(gate, key)

    def over_time(values: tuple[float, ...] | None) -> float | TimeTable | None:
        if values is None or gate.times is None:
            return None if values is None else values[0]
        return TimeTable(np.array(gate.times), np.array(values))

    pressure = over_time(gate.pressure) if gate.flow_rate is None else gate.pressure_limit
    radius = None if gate.point is None else gate.radius
    return Gate(
        gate.name, nodes, pressure, over_time(gate.flow_rate), _schedule(gate, places, key), radius
    )


def _vent(vent: scene.Vent, least: float, places: Places, key: str, gates: Sequence[Gate]) -> Vent:
    pressure = least if vent.pressure is None else vent.pressure
    nodes = places.nodes(vent, key)
    if vent.except_gates:
        for gate in gates:
            nodes = np.setdiff1d(nodes, gate.nodes)
        if not len(nodes):
            raise InputError("leaves no node: gates lie on all of it", key=f"{key}.except_gates")
    return Vent(vent.name, nodes, pressure, _schedule(vent, places, key), not vent.bleeds)


def _film(film: scene.ResinFilm | None, places: Places) -> Film | None:
    """Return the film on the nodes of a place, or on all nodes."""
    if film is None:
        return None
    thickness = np.zeros(len(places.points))
    thickness[slice(None) if film.over is None else places.nodes(film.over, "film.over")] = (
        film.thickness
    )
    pressure: float | TimeTable = film.pressure[0]
    if film.times is not None:
        pressure = TimeTable(np.array(film.times), np.array(film.pressure))
    return Film(thickness, pressure, film.capillary_pressure)


def _flow_medium(
    entry: scene.FlowMedium | None, part: FormedPart, places: Places
) -> FlowMedium | None:
    """Return the flow medium on the cells of a place, or on all cells."""
    if entry is None:
        return None
    cells = np.arange(part.target.cell_count)
    if entry.over is not None:
        cells = places.cells_of(entry.over, "flow_medium.over")
    permeability = entry.permeability
    first, second = axes_in_plane(part, cells, permeability, "flow_medium.permeability")
    k1, k2 = permeability.k1, permeability.ratio * permeability.k1
    tensor = np.einsum("ci,cj->cij", first, first) * k1
    tensor += np.einsum("ci,cj->cij", second, second) * k2
    return FlowMedium(cells, entry.thickness, entry.porosity, tensor)


def _require_on_one(gates: Sequence[Gate], covered: np.ndarray) -> None:
    """Refuse a round gate that is partly on the flow medium and partly beside it."""
    for number, gate in enumerate(gates):
        inside = np.isin(gate.nodes, covered)
        if gate.radius is not None and inside.any() and not inside.all():
            raise InputError(
                f"lies with {int(inside.sum())} of {len(gate.nodes)} nodes on the flow medium, and "
                "a round hole has one field around it; move it, or cover all of it",
                key=f'gates[{number}] "{gate.name}"',
            )


def _race_track(
    track: scene.RaceTrack, thickness: np.ndarray, places: Places, key: str
) -> RaceTrack:
    """Return a slit of the stated width w, as high as the thickness h of the cells: w³ h / 12."""
    edges = places.edges(track, key)
    height = np.bincount(
        places.cells[places.cells >= 0],
        weights=np.repeat(thickness, (places.cells >= 0).sum(axis=1)),
        minlength=len(places.points),
    ) / np.maximum(np.bincount(places.cells[places.cells >= 0], minlength=len(places.points)), 1)
    h = height[edges].mean(axis=1)
    smaller, larger = np.minimum(h, track.width), np.maximum(h, track.width)
    return RaceTrack(track.name, edges, smaller**3 * larger / 12.0, track.width * h)


def _require_apart(gates: Sequence[Gate], vents: Sequence[Vent], places: Places) -> None:
    keyed: list[tuple[str, Gate | Vent]] = [
        *((f'gates[{number}] "{gate.name}"', gate) for number, gate in enumerate(gates)),
        *((f'vents[{number}] "{vent.name}"', vent) for number, vent in enumerate(vents)),
    ]
    for (key, one), (_, other) in combinations(keyed, 2):
        shared = np.intersect1d(one.nodes, other.nodes)
        if len(shared) and not one.schedule.is_apart_from(other.schedule):
            raise InputError(
                f"shares {len(shared)} node{'s' * (len(shared) > 1)} with "
                f'{"the vent" if isinstance(other, Vent) else "the gate"} "{other.name}" '
                f"(node {places.node_number(shared[0])} at "
                f"{place_text(places.points[shared[0]])}); a node is one of them at a time: "
                "let one close before the other opens, or move it",
                key=key,
            )


def _require_reached(
    mesh: FlowMesh, gates: Sequence[Gate], vents: Sequence[Vent], wet: np.ndarray, places: Places
) -> None:
    """Refuse loose pieces of the mesh that no resin can enter, or no air can leave."""
    piece = mesh.part_of_node
    count = int(piece.max()) + 1
    if count == 1:
        return
    sources = np.unique(piece[np.concatenate([wet, *(gate.nodes for gate in gates)])])
    leaves = np.unique(piece[np.concatenate([vent.nodes for vent in vents])])
    of_cell = piece[mesh.cells[:, 0]]
    for what, served, remedy in (
        ("gate or wetted place, so that they can never fill", sources, "a gate"),
        ("vent, so that their air cannot leave", leaves, "a vent"),
    ):
        missing = np.setdiff1d(np.arange(count), served)
        if len(missing):
            cells = np.flatnonzero(np.isin(of_cell, missing))
            first = int(cells[0])
            raise InputError(
                f"the mesh has {count} pieces that do not hang together, and {len(missing)} of "
                f"them have no {what} ({len(cells)} cells, the first is cell "
                f"{places.cell_number(first)} at {place_text(places.centroids[first])}); give "
                f"each piece {remedy}, or join the nodes where the pieces meet"
            )


# --- warnings: what can be computed, but is perhaps a mistake -------------------------------------


#: Plausible range of the largest extent of a part [m].
SMALLEST_PART, LARGEST_PART = 5e-3, 100.0
#: Largest plausible share of the nodes in a gate; a larger one leaves little to flow through.
MOST_GATE = 0.5
#: Largest plausible width of a race track over an edge of the mesh; a wider one holds more resin
#: than the cells beside it.
WIDEST_TRACK = 1.0


def _doubts(setup: FillingSetup, places: Places) -> Iterator[str]:
    """Yield warnings, each a sentence with its remedy."""
    yield from _size_doubts(places)
    yield from _gate_doubts(setup, places)
    yield from _never_open(setup)
    yield from _region_doubts(setup, places)
    yield from _layer_doubts(setup, places)
    for track in setup.case.race_tracks:
        if track.width > WIDEST_TRACK * places.edge_length:
            yield (
                f'the race track "{track.name}" is {1e3 * track.width:.3g} mm wide, wider than the '
                f"cells of the mesh ({1e3 * places.edge_length:.3g} mm); check its unit"
            )
    if setup.case.gravity is not None and not np.any(setup.case.gravity):
        yield "gravity is zero; leave it out"


def _size_doubts(places: Places) -> Iterator[str]:
    extent = float(np.ptp(places.points[places.used], axis=0).max())
    if not SMALLEST_PART <= extent <= LARGEST_PART:
        yield (
            f"the part is {extent:.3g} m long; if its coordinates are not in metres, convert them, "
            "or name their unit with --length-unit where the mesh is mapped"
        )


def _gate_doubts(setup: FillingSetup, places: Places) -> Iterator[str]:
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
    """Yield warnings on gates and vents that open after the end of the filling."""
    end = setup.case.time
    for kind, entries in (("gate", setup.case.gates), ("vent", setup.case.vents)):
        for entry in entries:
            if entry.opens >= end:
                yield (
                    f'the {kind} "{entry.name}" opens at {entry.opens:g} s, but the filling ends '
                    f"at {end:g} s: it never does; give a longer time, or open it earlier"
                )
    for gate, entry in zip(setup.gates, setup.case.gates, strict=True):
        drive, name, least = gate.flow_rate, "flow rate", 0.0
        if drive is None:
            drive, name, least = gate.pressure, "pressure", setup.case.least_pressure
        if drive is None or entry.stages is not None or entry.opens >= end:
            continue
        if largest_until(drive, end) <= least:
            yield (
                f'the {name} of the gate "{gate.name}" rises after {end:g} s only, the end of the '
                "filling: no resin enters there; give a longer time, or earlier times"
            )


def _region_doubts(setup: FillingSetup, places: Places) -> Iterator[str]:
    """Yield warnings on regions that share cells, or change the density alone."""
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


def _layer_doubts(setup: FillingSetup, places: Places) -> Iterator[str]:
    """Yield warnings on a layer that conducts less than the preform, or with an unresolved lead."""
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
