"""A forming run with resin in its sheet: both parts, their exchanges, and the record."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from lcmchain.coupling.filling_part import FillingPart
from lcmchain.coupling.infiltration.files import read_checkpoint, write_checkpoint
from lcmchain.coupling.infiltration.filling import Filling
from lcmchain.coupling.infiltration.flow.medium import OpenFaces
from lcmchain.coupling.infiltration.flow.preform import Preform
from lcmchain.coupling.infiltration.formed_part import FormedPart
from lcmchain.coupling.infiltration.results import FilledPart, FillingRecord
from lcmchain.coupling.infiltration.setup import FillingSetup, set_up
from lcmchain.coupling.iteration import (
    CoupledSystem,
    Exchange,
    History,
    NotConverged,
    Tolerance,
    WindowControl,
    fixed_stress_exchanges,
    iqn_ils,
)
from lcmchain.coupling.iteration.interface import (
    POINTS,
    PRESSURE_AT_REST,
    RESISTANCE,
    VOLUME,
)
from lcmchain.coupling.solids.explicit import ExplicitForming
from lcmchain.coupling.solids.stack import StackForming, forming_of_scene
from lcmchain.coupling.solids.tool_loads import tool_loads
from lcmchain.coupling.wet_forming.sheet import (
    MovingPermeability,
    MovingStack,
    WithinWindow,
    fibre_fractions,
    law_of_scene,
    part_of_sheet,
    part_of_stack,
)
from lcmchain.errors import InputError, SimulationError
from lcmchain.provenance import run_fingerprint
from lcmchain.scene import Infiltration, Scene
from lcmchain.scene.resin_stages import ResinStage, resin_stages
from lcmchain.solver.simulation import Simulation, Snapshot
from lcmchain.tools.motion import FIXED

#: Default number of windows of a process, and the factors by which windows may shrink and grow.
WINDOWS = 400
SHORTEST = 1.0 / 64.0
LONGEST = 4.0
#: Excess of resin over the pores of a control volume when its last air leaves: tools press whole
#: regions full at once.
LARGEST_EXCESS = 0.01
#: Difference of pressures [Pa] that does not move a textile: a tenth of a millibar.
NO_PRESSURE = 10.0
#: Shift of a saved state in time where the clock of the resin has not gone on, over its whole time.
STANDING_CLOCK = 1e-9
#: Relative difference between the clocks of sheet and resin that is rounding.
ROUNDING = 1e-9


def _remedies(case: Infiltration) -> str:
    """Say what keeps the windows of sheet and resin together, by the entries of a scene."""
    gates = [gate.name for gate in case.gates if gate.pressure is not None]
    film = case.film is not None
    remedies = [
        *(["a film with less infiltration.film.pressure"] if film else []),
        *(
            [f"a pressure of the gate {' or '.join(gates)} that grows, as "
             'pressure = "0 3 bar" with times = "0 60 s"'] if gates else []
        ),
        "a longer time of forming for the same time of the resin",
        "a larger infiltration.with_forming.tolerance",
    ]  # fmt: skip
    return (
        "Likely cause: the pressure of the resin changes faster than the sheet can follow, or "
        f"lifts plies that no tool holds. Remedies: {', '.join(remedies[:-1])}, or {remedies[-1]}"
    )


class WetForming:
    """The forming of a scene and the filling of its sheet, advanced together.

    Parameters
    ----------
    scene : with an infiltration that goes on while the blank is formed.
    simulation : of the scene, at its start.

    Raises
    ------
    InputError : places that are not on the blank, cells through which nothing can flow.
    """

    def __init__(self, scene: Scene, simulation: Simulation) -> None:
        case = _case_of(scene)
        self.scene, self.case, self.simulation = scene, case, simulation
        self.forming = forming_of_scene(scene, simulation, surroundings=case.vent_pressure)
        self._law = law = law_of_scene(scene)
        part = self._part([simulation.snapshot()], self.forming.points())
        self.setup = set_up(part, case, scene.source.directory)
        if isinstance(self.forming, StackForming):
            factor = WithinWindow(law, part, scene.source.directory)
            preform = replace(self.setup.preform, factor=factor)
            self.setup = replace(self.setup, preform=preform)
        self.filling: Filling = self.setup.filling()
        self.filling.options = replace(self.filling.options, largest_excess=LARGEST_EXCESS)
        preform, directory = self.setup.preform, scene.source.directory
        self._permeability: MovingPermeability | MovingStack
        if isinstance(self.forming, StackForming):
            self._permeability = MovingStack(
                self.forming, law, preform, directory, fibre_fractions(simulation)
            )
        else:
            self._permeability = MovingPermeability(simulation, law, preform, directory)
        #: The stages on both clocks, one that is the whole process where the scene has none.
        self.stages = resin_stages(scene) or (
            ResinStage("", 0.0, scene.process.time, 0.0, case.time),
        )
        flowing = [stage for stage in self.stages if stage.flows]
        self._resin = FillingPart(self.filling, pace=flowing[0].pace)
        time = math.fsum(stage.end - stage.start for stage in flowing)
        self._system = coupled(self.forming, self._resin, case, time)
        with_forming = case.with_forming
        self._faces_are_open = with_forming is not None and with_forming.open_faces == "air"
        self._fingerprint = run_fingerprint(scene)._asdict()
        self.record = FillingRecord.empty()
        self._permeability.begin(self.filling)
        self._open_faces()

    def _part(self, snapshots: list[Snapshot], points: np.ndarray) -> FormedPart:
        """Return the sheet or stack in the last of saved states, which is the present."""
        if isinstance(self.forming, StackForming):
            return part_of_stack(self.scene, self.forming, snapshots, points, self._law)
        return part_of_sheet(self.scene, self.simulation, snapshots, points)

    @property
    def history(self) -> History:
        """Convergence of the windows."""
        return self._system.history

    def advance_to(
        self, time: float, on_window: Callable[[Simulation], None] | None = None
    ) -> None:
        """Go on to a time of the process [s]; ``on_window`` is called after every window.

        Raises
        ------
        NotConverged : sheet and resin do not agree in the shortest window.
        SimulationError : a guard stopped the forming, or the filling cannot do its step.
        """

        def after_window(_: CoupledSystem) -> None:
            self._permeability.renew(self.filling)
            self._open_faces()
            self._note()
            if on_window is not None:
                on_window(self.simulation)

        if not self.record.time:
            self._note()
        while self._now < time:
            stage = self._next_stage
            if self._is_behind and self._now == stage.start:
                self._join()  # the run was stopped at the end of a stage without flow
            until = min(time, stage.end)
            if stage.flows:
                if self._now == stage.start:
                    self._resin.go_on_at(stage.pace, stage.start)
                try:
                    self._system.advance_to(until, after_window)
                except NotConverged as error:
                    raise error.with_remedies(_remedies(self.case)) from error
            else:
                self.forming.drain()
                self.simulation.advance_to(until, on_window)
                self._join()
        if self._is_behind:
            self._join()

    def _open_faces(self) -> None:
        """Tell the filling which nodes are open to the air at present, not covered by tools."""
        if not self._faces_are_open:
            return
        cells = self.filling.mesh.cells[~self.forming.covered()]
        beside = np.zeros(self.filling.mesh.node_count, dtype=bool)
        beside[cells[cells >= 0]] = True
        self.filling.open_faces = OpenFaces(beside, float(self.case.vent_pressure))

    @property
    def _is_behind(self) -> bool:
        """Whether the sheet is ahead of the resin, after a stage without flow."""
        now = self.simulation.time
        return now - self._system.time > ROUNDING * now

    @property
    def _now(self) -> float:
        return self.simulation.time if self._is_behind else self._system.time

    @property
    def _next_stage(self) -> ResinStage:
        """Stage of the next step; the last one at the end."""
        now = self._now
        return next((stage for stage in self.stages if now < stage.end), self.stages[-1])

    @property
    def _stage_number(self) -> int:
        """Number of the present stage; at a border the one that ends there."""
        now = self._now
        ended = sum(stage.end < now for stage in self.stages)
        return min(ended, len(self.stages) - 1)

    def _join(self) -> None:
        """Move the resin with the sheet after a stage without flow; its own clock stands.

        In a stage that ends at rest the resin has the pressure of the surroundings and stays with
        the textile. A second call changes nothing.

        Raises
        ------
        SimulationError : the sheet is pressed together.
        """
        now, stage = self.simulation.time, self.stages[self._stage_number]
        self._permeability.place(self.filling)
        try:
            self._resin.follow(self.forming.volume(), self.forming.points())
        except SimulationError as error:
            raise SimulationError(
                f"in the stage {stage.name}, after {1e3 * now:.4g} ms, {error}: no resin flows in "
                f"a stage with rest = true. Open the tools before stages.{stage.name} begins, or "
                "give it mass_damping instead of rest = true, so that its time is one of the "
                "process"
            ) from error
        self._permeability.begin(self.filling)
        self.forming.start_anew()
        self._open_faces()
        self._system.go_on_from(now)
        if now == stage.end:
            self._note()

    def keep_frame(self) -> None:
        """Record the present fields of the filling; of a stage without flow those at its end."""
        if not self.record.time:
            self._note()
        stage, now = self._next_stage, self._now
        if stage.flows or now == stage.start or now == stage.end:
            self.record.add_frame(self.filling, self._stage_number)
            set_apart(self.record.frame_time, self.case.time)

    def force(self) -> tuple[float, ...]:
        """Return the force of moving tools along their directions, and its shares [N].

        In the order of :data:`~lcmchain.coupling.infiltration.results.FORCES`.
        """
        tools = self.simulation.model.tools
        total = np.zeros(5)
        for number, load in enumerate(tool_loads(self.simulation).values()):
            if tools.motion_kind[number] != FIXED:
                parts = (load.total, load.fibres, load.fluid, load.friction, load.rest)
                total -= np.array(parts) @ tools.direction[number]
        return tuple(float(value) for value in total)

    def write_checkpoint(self, folder: Path, step_count: int) -> None:
        """Write the whole state and the record so far."""
        path = checkpoint_file(folder, step_count)
        write_checkpoint(path, self._fingerprint, self._system.save(), self.record)

    def forget_checkpoints(self, folder: Path, *, but: int | None) -> None:
        """Remove the states of other step counts."""
        for path in folder.glob(checkpoint_file(Path(), "*").name):
            if but is None or path != checkpoint_file(folder, but):
                path.unlink(missing_ok=True)

    def restore_checkpoint(self, folder: Path, step_count: int) -> None:
        """Go back to the state in a file; going on from it is bit-identical.

        Raises
        ------
        InputError : there is none, it is damaged, or it is that of another scene.
        """
        path = checkpoint_file(folder, step_count)
        saved, self.record = read_checkpoint(path, self._fingerprint)
        self._system.restore(saved)
        self._permeability.begin(self.filling)
        self._open_faces()

    def filled(self, snapshots: list[Snapshot]) -> FilledPart:
        """Return the results of the filling, on the shape of the last saved state."""
        points = self.filling.mesh.points
        part = self._part([snapshots[0], snapshots[-1]], points)
        state, medium = self.filling.state, self.filling.medium
        fraction = medium.fibre_fraction(state.thickness)
        preform = Preform(
            state.thickness, 1.0 - fraction, medium.preform.permeability,
            medium.preform.through_permeability,
        )  # fmt: skip
        setup: FillingSetup = replace(self.setup, part=part, mesh=medium.mesh, preform=preform)
        outcome, message = "reached", f"the process ends after {self.filling.time:.6g} s"
        if state.full.all():
            outcome, message = "filled", "all pores are full at the end of the process"
        return FilledPart.of_record(
            setup, self.record, self.filling.save(), outcome, message, self.history,
            [stage.name for stage in self.stages] if self.scene.stages else (),
        )  # fmt: skip

    def _note(self) -> None:
        areas = self.filling.medium.node_area
        self.record.add_step(self.filling, areas, self.force(), self._stage_number)
        set_apart(self.record.time, self.case.time)


def coupled(
    forming: ExplicitForming, fluid: FillingPart, case: Infiltration, time: float
) -> CoupledSystem:
    """Return the system of a sheet and its resin, for a process of this time [s].

    The equations of the resin contain the compliance of the sheet (fixed-stress split), those of
    the sheet the reaction of the resin as a resistance. A quasi-Newton iteration finds the rest.
    """
    with_forming = case.with_forming
    assert with_forming is not None
    first = min(time / WINDOWS if with_forming.window is None else with_forming.window, time)
    tolerance = with_forming.tolerance
    exchanges = [
        Exchange("sheet", "resin", VOLUME, tolerance=None, within="held"),
        *(
            Exchange("sheet", "resin", name, tolerance=None, iterated=False, within="held")
            for name in (POINTS, RESISTANCE)
        ),
        Exchange("resin", "sheet", PRESSURE_AT_REST,
                 tolerance=Tolerance(tolerance, absolute=NO_PRESSURE)),
        *fixed_stress_exchanges("sheet", "resin"),
    ]  # fmt: skip
    control = WindowControl(
        first, smallest=SHORTEST * first, largest=LONGEST * first, few_iterations=4
    )
    return CoupledSystem(
        {"sheet": forming, "resin": fluid}, exchanges, iqn_ils(relaxation=1.0), window=control,
        prediction=1,
    )  # fmt: skip


def set_apart(times: list[float], whole: float) -> None:
    """Shift the last of times [s] by a negligible part, where it equals the one before.

    whole : time of the whole infiltration [s].
    """
    if len(times) > 1 and times[-1] <= times[-2]:
        times[-1] = times[-2] + STANDING_CLOCK * whole


def checkpoint_file(folder: Path, step_count: int | str) -> Path:
    """Return the file with the state of a wet forming after so many steps."""
    return folder / f"wet_forming_checkpoint_{step_count}.npz"


def _case_of(scene: Scene) -> Infiltration:
    case = scene.wet_forming
    if case is None:
        raise InputError("is missing", key="infiltration.with_forming")
    return case
