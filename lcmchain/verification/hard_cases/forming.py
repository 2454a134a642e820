"""Hard forming: hemispheres at ten times the speed, on perturbed and on coarse meshes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from lcmchain.effects.fibre_bending import AREA_ROW, CONSTANT_ROWS, FibreBending
from lcmchain.elements.blocks import LANES
from lcmchain.solver.simulation import Simulation
from lcmchain.tools import gaps
from lcmchain.verification.hard_cases.case import CaseResult, guarded, hard_case, stopped
from lcmchain.verification.hard_cases.sheets import MD600, fields, simulation

THEME = "Forming"
# Times what tells the area between two fibres from that of a fold: no fold is as sharp.
NEVER = 1e12


def hemisphere(
    *,
    time: float = 0.1,
    edge: float = 5.0,
    fillet: float | None = None,
    holder: bool = True,
    element: str = "",
    perturbation: float = 0.0,
    seed: int = 0,
) -> Simulation:
    """Return the main job at half its size: blank 150 mm, punch of 37.5 mm.

    The fillets of die and holder have twice the edge length of the elements where none is given, as
    in the main job: elements resolve them.
    """
    radius = 2.0 * edge if fillet is None else fillet
    plate = (
        f'{{ type = "plate_with_hole", hole_radius = "38.5 mm", fillet_radius = "{radius} mm", '
        'side = "%s" }'
    )
    held = f"""
        [[tools]]
        name = "holder"
        shape = {plate % "above"}
        position = ["0 mm", "0 mm", "1.004 mm"]
        motion = {{ type = "guided", direction = [0, 0, -1], mass = "425 g", ramp = "5 ms" }}
        """
    return simulation(
        f"""
        process = {{ time = "{time} s", mass_damping = "200 1/s" }}
        blank = {{ size = ["150 mm", "150 mm"], edge_length = "{edge} mm", height = "0.502 mm" }}
        contact = {{ friction = 0.157 }}
        element = {{ {element} }}
        [material]
        {MD600}
        [[tools]]
        name = "punch"
        shape = {{ type = "sphere_capped_punch", radius = "37.5 mm" }}
        position = ["0 mm", "0 mm", "1.004 mm"]
        motion = {{ type = "stroke", direction = [0, 0, -1], distance = "37.5 mm" }}
        [[tools]]
        name = "die"
        shape = {plate % "below"}
        {held if holder else ""}
        """,
        perturbation=perturbation,
        seed=seed,
    )


class Formed:
    """A run of :func:`hemisphere` to its end, with what is compared."""

    def __init__(self, sim: Simulation, time: float) -> None:
        self.sim, energies = sim, []
        for part in np.linspace(0.0, 1.0, 21)[1:]:
            sim.advance_to(float(part * time))
            energies.append(sim.energy())
        self.work = max(abs(energy["external"]) for energy in energies)
        self.balance = max(abs(energy["balance_error"]) for energy in energies) / self.work
        face = fields(sim)
        self.least_thickness = float(face["thickness"].min())
        self.mean_shear = float(np.abs(face["shear_angle"]).mean())

    @property
    def draw_in(self) -> float:
        """Mean way of the middles of the four sides towards the axis [m]."""
        X, x = self.sim.model.only_body().mesh.node_positions, self.sim.state.position.T
        way = np.linalg.norm(X[:, :2], axis=1) - np.linalg.norm(x[:, :2], axis=1)
        on_axis = (np.abs(X[:, :2]) < 1e-9).any(axis=1)
        return float(way[on_axis & (np.abs(X[:, :2]).max(axis=1) > 0.075 - 1e-9)].mean())

    def balance_result(self, name: str, what: str) -> CaseResult:
        return CaseResult(
            name, f"{what}energy balance error over the work", 100.0 * self.balance, 1.0, "%"
        )


@hard_case("fast_punch", THEME)
def fast_punch(name: str, full: bool) -> Iterator[CaseResult]:
    """The hemisphere formed in 10 ms instead of 100: the punch reaches 7 m/s.

    Hard because inertia carries the sheet: the holder is thrown up, the sheet hits the tools, and
    a node may travel half a millimetre between two searches for contact.
    """
    time = 0.01
    formed = Formed(hemisphere(time=time), time)
    yield formed.balance_result(name, "")
    yield CaseResult(
        name,
        "least thickness over the initial one",
        formed.least_thickness / 1.004e-3,
        0.7,
        at_least=True,
    )
    deepest = 1e3 * float(formed.sim.state.penetration_max.max())
    blind = hemisphere(time=time)
    blind.prepare_steps()
    blind.find_contact = lambda: None  # type: ignore[method-assign]
    message = stopped(lambda: blind.advance_to(time))
    inside = max(
        -gaps(blind.model.tools, tool, blind.state.position.T, blind.state.tool_travel[tool]).min()
        for tool in range(3)
    )
    yield CaseResult(
        name,
        "deepest penetration of a tool",
        deepest,
        0.1,
        "mm",
        without="contact searched at the start only: "
        + (f"stopped ({message.split('. Likely')[0]}), " if message else "")
        + f"nodes {1e3 * inside:.1f} mm inside a tool",
    )


@hard_case("sharp_folds", THEME)
def sharp_folds(name: str, full: bool) -> Iterator[CaseResult]:
    """The hemisphere without holder as a membrane, which folds at no cost, as sharply as the mesh.

    Hard because fibres come to lie on themselves and on each other in the folds: there is no plane
    for them to bend in, and the forces of their bending within it grow without bound.
    """
    time = 0.1
    folding, unbounded = (
        hemisphere(time=time, holder=False, element='type = "membrane-shell", bending = false')
        for _ in range(2)
    )
    assert unbounded.model.fibre_bending is not None
    never_folded(unbounded.model.fibre_bending)
    message = stopped(lambda: unbounded.advance_to(time))
    energy = unbounded.energy()
    found = f"balance error {100.0 * abs(energy['balance_error'] / energy['external']):.2g} %"
    if message:
        found = f"stopped ({message.split(': motion')[0]})"
    worst, work = 0.0, 0.0
    for part in np.linspace(0.0, 1.0, 11)[1:]:
        folding.advance_to(float(part * time))
        energy = folding.energy()
        worst = max(worst, abs(energy["balance_error"]))
        work = max(work, abs(energy["external"]))
    yield CaseResult(
        name,
        "energy balance error over the work",
        100.0 * worst / work,
        1.0,
        "%",
        without=f"fibres that bend at full cost in folds: {found}",
    )


def never_folded(table: FibreBending) -> None:
    """Let fibres resist bending within the plane at full cost in folds of any sharpness."""
    assert table.data is not None
    table.per_area2[:] *= NEVER
    table.data.constants.reshape(-1, CONSTANT_ROWS, LANES)[:, AREA_ROW] *= NEVER


@hard_case(
    "perturbed_mesh",
    THEME,
    reduced="4 mm, 50 ms, one seed; --full: 2.5 mm, 100 ms, three seeds, and without",
)
def perturbed_mesh(name: str, full: bool) -> Iterator[CaseResult]:
    """The hemisphere on a mesh whose inner nodes are shifted at random by up to 10 % of the edge.

    Hard because fibres then cross the elements' edges at any angle: a bilinear element whose edges
    cross stiff fibres cannot change its shear angle without stretching them (tension locking), and
    its stabilisation, Eq. (16), has the full fibre stiffness. With ``fibre_hourglass`` 0.03 the
    result must stay within 5 %.
    """
    edge, time = (2.5, 0.1) if full else (4.0, 0.05)
    unlocked = "fibre_hourglass = 0.03"
    regular = Formed(hemisphere(time=time, edge=edge, element=unlocked), time)
    without = ""
    if full:
        locked = [
            Formed(hemisphere(time=time, edge=edge, perturbation=part, seed=1), time)
            for part in (0.0, 0.1)
        ]
        change = locked[1].work / locked[0].work - 1.0
        without = f"full fibre stiffness in the hourglass terms: work {100.0 * change:+.1f} %"
    for seed in (1, 2, 3) if full else (1,):
        sim = hemisphere(time=time, edge=edge, element=unlocked, perturbation=0.1, seed=seed)
        other = Formed(sim, time)
        for what in ("draw_in", "work", "mean_shear", "least_thickness"):
            change = abs(getattr(other, what) / getattr(regular, what) - 1.0)
            words = "draw-in" if what == "draw_in" else what.replace("_", " ")
            yield CaseResult(
                name,
                f"seed {seed}: change of {words}",
                100.0 * change,
                5.0,
                "%",
                without=without if what == "work" and seed == 1 else "",
            )
        yield other.balance_result(name, f"seed {seed}: ")


@hard_case("coarse_mesh", THEME)
def coarse_mesh(name: str, full: bool) -> Iterator[CaseResult]:
    """The hemisphere with elements up to five times the radius of the fillets (5 mm).

    Hard because such a mesh cannot resolve the fillet: elements bridge it, jam between punch and
    die, lift the holder, and the force comes out several times too high. The elements bear it by
    their hourglass terms, by which the guard knows it.
    """
    time = 0.1
    for edge in (10.0, 25.0):
        yield guarded(
            name,
            f"{edge:g} mm elements on 5 mm fillets: ends in the guard's words",
            lambda edge=edge: _form_as_a_run(hemisphere(time=time, edge=edge, fillet=5.0), time),  # type: ignore[misc]
            "hourglass",
            "blank.edge_length",
        )
    sim = hemisphere(time=time)
    parts = []
    for part in np.linspace(0.5, 1.0, 6):
        sim.advance_to(float(part * time))
        energy = sim.energy()
        parts.append(energy["hourglass"] / energy["internal"])
    yield CaseResult(
        name, "5 mm elements on 10 mm fillets: hourglass over strain energy", 100.0 * max(parts),
        15.0, "%",
    )  # fmt: skip


def _form_as_a_run(sim: Simulation, time: float) -> None:
    """Advance as a run of a scene does, with the guard of the hourglass energy."""
    sim.advance_to(time, Simulation.require_resolved)


@hard_case("published_compaction", THEME)
def published_compaction(name: str, full: bool) -> Iterator[CaseResult]:
    """The hemisphere with the compaction strain as published, the length of the director.

    Outside what that strain can do: directors tilt on the die fillet, elements fold over. It must
    end in the words of the guard, which name the element, the place and the option.
    """
    yield guarded(
        name,
        "director strain: ends in the guard's words",
        lambda: hemisphere(
            time=0.05, fillet=5.0, element='compaction_strain = "director"'
        ).advance_to(0.05),
        "collapsed",
        'compaction_strain = "normal"',
    )


@hard_case("fine_mesh", THEME, reduced="elements of 3.75 mm; --full: 2.5 mm, and without")
def fine_mesh(name: str, full: bool) -> Iterator[CaseResult]:
    """The hemisphere with elements half as large as the fillet's radius.

    Hard because elements are compacted, warped and sheared at once where they run over the fillet:
    the hourglass forces as published have no potential there, and feed energy to them.
    """
    edge, time = (2.5, 0.1) if full else (3.75, 0.05)
    without = ""
    if full:
        published = hemisphere(time=time, edge=edge, element='hourglass = "published"')
        message = stopped(lambda: published.advance_to(time))
        error = abs(published.energy()["balance_error"] / published.energy()["external"])
        without = f"hourglass as published: balance error {100.0 * error:.2g} %"
        if message:
            without = f"hourglass as published: stopped ({message.split(': kinetic')[0]})"
    formed = Formed(hemisphere(time=time, edge=edge), time)
    yield CaseResult(
        name,
        f"{edge:g} mm: energy balance error over the work",
        100.0 * formed.balance,
        1.0,
        "%",
        without=without,
    )
