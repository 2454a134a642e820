"""Settings of a run that keep a wish: errors that it may have, or time that it may take.

Coarse meshes, the pilots, tell how the result depends on the edge length h: what it changes between
them gives the order p and the error at any h (:mod:`lcmchain.study.convergence`), and their times
what any h costs. One of half the process time tells what inertia and damping leave: errors that go
with one over the time. The mesh is the coarsest whose expected error, with a margin, lies within
the wish, or the finest that the time allows; as long as it lies far from the pilots, a finer pilot
is run first. The run itself is the check: what it differs from the finest pilot by shows its own
error, and where the wish turns out to be missed, a finer mesh is run.

It holds as far as errors follow an order. Where wrinkles appear only on fine meshes no coarse run
knows of them; the error that is reported after the run does, as far as its mesh resolves them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from lcmchain.errors import InputError
from lcmchain.scene import Scene
from lcmchain.study.comparison import BY_NAME, differences
from lcmchain.study.convergence import Convergence, observed, progress, with_order
from lcmchain.study.outcome import Outcome
from lcmchain.study.runs import Progress, Study, Workers
from lcmchain.study.source import Source
from lcmchain.study.variant import Variant
from lcmchain.study.wish import Wish

#: Elements along the edge of a square as large as the blank, of the pilots that are always run;
#: even numbers, so that the middle of a symmetric blank is a node. Coarser ones follow no order.
PILOTS = (20, 28, 40)
#: Elements along the edge grow by this factor from one pilot to the next.
PILOT_RATIO = math.sqrt(2.0)
#: Pilots in all, and how much finer than the finest of them a mesh may be that they speak of.
MOST_PILOTS = 6
FARTHEST = 1.6
#: Of a budget so much goes into pilots at most; the first one has so many elements along the edge.
PILOT_SHARE = 0.3
QUICK_PILOT = 8
#: Orders that are believed: what few meshes show beyond is chance.
LEAST_ORDER, MOST_ORDER = 0.8, 2.0
#: Changes from mesh to mesh that fall by less than this factor, at equal refinement, show no
#: convergence.
LEAST_PROGRESS = 1.1
#: Expected errors are to lie below the wish by this factor.
MARGIN = 0.8
#: Part of a wish that the process time may take, and what it leaves to the mesh at least.
TIME_SHARE = 0.4
LEAST_ROOM = 0.2
#: Process times by that of the scene that are chosen from.
TIME_FACTORS = (0.5, 1.0, 2.0, 4.0)
#: Solver time over h^-q, where pilots do not tell it.
COST_POWER = 3.0
#: A run is repeated at most so often, and with edges shorter by this factor at least.
MOST_RUNS = 3
NO_BETTER = 0.95


class Level(NamedTuple):
    """A mesh that was run: its edge length [m], solver time of the scene's process [s], result."""

    edge: float
    seconds: float
    outcome: Outcome


@dataclass
class Choice:
    """What was chosen for a run, and what came of it.

    Parameters
    ----------
    wish : in words. edge_length [m], time_factor : chosen; why : in words.
    expected : errors by quantity that pilots led to expect; found : estimated after the run.
    pilot_seconds, seconds : solver time of the pilots, and of everything [s].
    expected_seconds : what everything was to take [s].
    kept : whether the wish is kept by what was found; notes : what a user should know.
    """

    wish: str
    edge_length: float
    time_factor: float
    why: str
    expected: dict[str, float] = field(default_factory=dict)
    found: dict[str, float] = field(default_factory=dict)
    pilot_seconds: float = 0.0
    expected_seconds: float = 0.0
    seconds: float = 0.0
    kept: bool = False
    notes: list[str] = field(default_factory=list)

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for ``summary.json``."""
        return asdict(self)

    def settings_in_words(self) -> str:
        """Say what was chosen, and why."""
        text = f"edges of {_mm(self.edge_length)}"
        if self.time_factor != 1.0:
            text += f" and {self.time_factor:g} times the process time"
        return f"{text}, since {self.why}"

    def missed(self) -> str:
        """Say that the wish is not kept, and what to do."""
        return (
            f"the wish, {self.wish}, is not kept by the errors that are estimated; wish for "
            "less, allow more time, or look at lcmchain study accuracy"
        )

    def in_words(self) -> str:
        """Say what came of it."""
        told = [
            f"{BY_NAME[name].title} {BY_NAME[name].text(error)}"
            for name, error in self.found.items()
            if math.isfinite(error)
        ]
        return (
            f"Estimated errors: {', '.join(told) or 'none could be estimated'}; "
            f"{self.seconds:.3g} s of solver time, {self.pilot_seconds:.3g} s of them for pilots"
        )


class Chooser:
    """Chooses the settings of a run by pilots, and judges the run by them.

    Parameters
    ----------
    folder : where pilots are kept; those that lie there are not computed again.
    """

    def __init__(
        self,
        text: Source,
        folder: Path,
        wish: Wish,
        *,
        threads: int | None = None,
        progress: Progress | None = None,
    ) -> None:
        self.text, self.wish, self.progress = text, wish, progress
        self.scene = text.scene()
        self.study = Study(text, folder, Workers(1, threads))
        self.levels: list[Level] = []
        self.time_errors: dict[str, float] = {}
        self.time_factor = 1.0
        self.pilot_seconds = self.run_seconds = 0.0

    def run(self, make: Callable[[Scene], Outcome]) -> Choice:
        """Run pilots, then the scene by ``make`` until the wish is kept; return the last choice.

        Raises
        ------
        InputError : no pilot gave a result.
        """
        self._run_pilots()
        choice = self._choice()
        for _ in range(MOST_RUNS):
            outcome = make(self.text.scene(self._overrides(choice)))
            self.run_seconds += outcome.seconds
            self._judge(choice, outcome)
            if choice.kept or self.wish.budget is not None:
                break
            better = self._choice()
            if better.edge_length > NO_BETTER * choice.edge_length:
                break
            better.notes.append(f"edges of {_mm(choice.edge_length)} missed the wish")
            choice = better
        return choice

    # --- pilots -----------------------------------------------------------------------------------

    def _run_pilots(self) -> None:
        """Run the coarse meshes, then one of them for twice the process time."""
        failure = ""
        for edge in self._pilot_edges():
            outcome = self._pilot(edge)
            failure = outcome.failure or failure
            if not outcome.failure:
                self.levels.append(Level(edge, outcome.seconds, outcome))
        if not self.levels:
            raise InputError(
                f"no coarse mesh of the scene could be formed to choose from ({failure}); run it "
                "without --within and --budget"
            )
        if self.wish.errors and len(self.levels) > 1:
            self._choose_time()
            self._refine_pilots()

    def _refine_pilots(self) -> None:
        """Run finer pilots as long as the mesh that the wish needs lies far from all of them."""
        if self.wish.budget is not None:
            return
        while len(self.levels) < MOST_PILOTS:
            finest = self.levels[-1].edge
            if self._choice().edge_length * FARTHEST > finest:
                return
            outcome = self._pilot(finest / PILOT_RATIO, self.time_factor)
            if outcome.failure:
                return
            seconds = outcome.seconds / self.time_factor
            self.levels.append(Level(finest / PILOT_RATIO, seconds, outcome))

    def _pilot_edges(self) -> Iterator[float]:
        """Yield the edge lengths of the pilots [m]: of a budget no more than its part is used.

        What time allows is found by the first and coarsest, then the two finest that fit follow.
        """
        width, height = self.scene.blank.extent
        size = math.sqrt(width * height)
        if self.wish.budget is None:
            yield from (size / count for count in PILOTS)
            return
        first = size / QUICK_PILOT
        yield first
        seconds = self.pilot_seconds
        left = PILOT_SHARE * self.wish.budget - seconds
        part = 1.0 + PILOT_RATIO**-COST_POWER  # of both, by the finer one
        finest = first * (part * seconds / left) ** (1.0 / COST_POWER) if left > 0.0 else first
        finest = max(finest, size / PILOTS[-1])
        if finest * PILOT_RATIO < first / PILOT_RATIO:
            yield finest * PILOT_RATIO
        if finest < first / PILOT_RATIO:
            yield finest

    def _pilot(self, edge: float, time_factor: float = 1.0) -> Outcome:
        overrides = self._settings(edge, time_factor)
        name = f"pilot {_mm(edge)}" + (f", process x {time_factor:g}" if time_factor != 1 else "")
        outcome = self.study.outcome(Variant(name, "pilot", overrides, edge), self.progress)
        self.pilot_seconds += outcome.seconds
        return outcome

    def _choose_time(self) -> None:
        """Choose the process time by what half of it changes.

        Coarse meshes react to it more than fine ones: a longer process is only believed to be
        needed by the finest pilot. Resin that flows meanwhile has times of its own.
        """
        if self.scene.wet_forming is not None:
            return
        allowed = TIME_FACTORS if self.wish.budget is None else (1.0,)
        for level in self.levels[-2:]:
            shorter = self._pilot(level.edge, 0.5)
            if shorter.failure:
                return
            found = differences(shorter, level.outcome)
            errors = {name: found[name].typical for name in self.wish.errors}
            errors = {name: error for name, error in errors.items() if math.isfinite(error)}
            fitting = [
                factor
                for factor in allowed
                if all(e / factor <= TIME_SHARE * self.wish.errors[n] for n, e in errors.items())
            ]
            self.time_factor = fitting[0] if fitting else allowed[-1]
            self.time_errors = {n: error / self.time_factor for n, error in errors.items()}
            if self.time_factor <= 1.0:
                return

    # --- the choice -------------------------------------------------------------------------------

    def _choice(self) -> Choice:
        """Return the coarsest mesh that keeps the wish by what is known so far."""
        laws = self._laws()
        edge, why, notes = self.levels[0].edge, "the coarsest pilot will do", []
        for name, allowed in self.wish.errors.items():
            if name not in laws:
                notes.append(f"the pilots tell nothing of the {BY_NAME[name].title}")
                continue
            room = max(MARGIN * allowed - self.time_errors.get(name, 0.0), LEAST_ROOM * allowed)
            if laws[name].order == 0.0:
                if laws[name].factor > room:
                    notes.append(
                        f"the {BY_NAME[name].title} changes by "
                        f"{BY_NAME[name].text(laws[name].factor)} from mesh to mesh, and by no "
                        "less on finer ones: no mesh is chosen for it"
                    )
                continue
            needed = laws[name].size(room)
            if needed < edge:
                edge = needed
                why = f"the {BY_NAME[name].title} needs edges of {_mm(needed)}"
        finest = self.levels[-1].edge / FARTHEST
        if edge < finest and len(self.levels) >= MOST_PILOTS:
            notes.append(f"edges of {_mm(edge)} would be needed, far from any pilot")
            edge = finest
        if self.wish.budget is not None:
            affordable = self._affordable(self.wish.budget - self.pilot_seconds)
            if not self.wish.errors or affordable > edge:
                edge, why = affordable, f"edges of {_mm(affordable)} are what the time allows"
        if self.time_factor > 1.0:
            notes.append(
                f"the process takes {self.time_factor:g} times as long: inertia and damping would "
                "take too much of the wish"
            )
        if self.time_factor < 1.0:
            why += (
                f"; {self.time_factor:g} of the process time is enough for that, forces and work "
                "may be less accurate"
            )
        return Choice(
            wish=self.wish.in_words(),
            edge_length=edge,
            time_factor=self.time_factor,
            why=why,
            expected=self._errors(laws, edge),
            pilot_seconds=self.pilot_seconds,
            expected_seconds=self.pilot_seconds + self.run_seconds + self._seconds(edge),
            notes=notes,
        )

    def _judge(self, choice: Choice, outcome: Outcome) -> None:
        """Note in the choice what the run has shown.

        Of a run on the finest mesh so far the law tells the error; of another one, what it differs
        from the finest by, and the error of that one.
        """
        others = [
            level
            for level in self.levels
            if not NO_BETTER < level.edge / choice.edge_length < 1.0 / NO_BETTER
        ]
        run = Level(choice.edge_length, outcome.seconds / choice.time_factor, outcome)
        self.levels = sorted([*others, run], key=lambda level: -level.edge)
        finest = self.levels[-1]
        choice.found = self._errors(self._laws(), finest.edge)
        if finest is not run:
            beside = differences(outcome, finest.outcome)
            choice.found = {n: e + beside[n].typical for n, e in choice.found.items()}
        choice.seconds = self.pilot_seconds + self.run_seconds
        choice.kept = all(
            choice.found.get(name, math.inf) <= allowed
            for name, allowed in self.wish.errors.items()
        )

    def _laws(self) -> dict[str, Convergence]:
        """Return how the quantities depend on the edge length, by the finest levels.

        What changes from mesh to mesh by no less than before has the order 0: its error is taken
        for as large as that change, from one pilot to the next, on any mesh (Eça, Hoekstra, "A
        procedure for the estimation of the numerical uncertainty of CFD calculations", J. Comput.
        Phys. 262 (2014), take the range of the data where no order is seen).
        """
        if len(self.levels) < 2:
            return {}
        *_, coarse, fine = self.levels
        last = differences(coarse.outcome, fine.outcome)
        before = None
        if len(self.levels) > 2:
            before = differences(self.levels[-3].outcome, coarse.outcome)
        laws = {}
        for name in BY_NAME:
            step, order = last[name].typical, 1.0
            if not (math.isfinite(step) and step > 0.0):
                continue
            if before is not None:
                sizes = (self.levels[-3].edge, coarse.edge, fine.edge)
                if progress(sizes, (before[name].typical, step)) < LEAST_PROGRESS:
                    once = math.log(PILOT_RATIO) / math.log(coarse.edge / fine.edge)
                    laws[name] = Convergence(0.0, step * once)
                    continue
                seen = observed(sizes, (before[name].typical, step)).order
                order = LEAST_ORDER if math.isnan(seen) else seen
            order = min(max(order, LEAST_ORDER), MOST_ORDER)
            laws[name] = with_order(order, (coarse.edge, fine.edge), step)
        return laws

    def _errors(self, laws: Mapping[str, Convergence], edge: float) -> dict[str, float]:
        return {n: law.error(edge) + self.time_errors.get(n, 0.0) for n, law in laws.items()}

    # --- time -------------------------------------------------------------------------------------

    def _seconds(self, edge: float) -> float:
        """Return the expected solver time of a run with the chosen process time [s]."""
        last, power = self.levels[-1], COST_POWER
        if len(self.levels) > 1:
            before = self.levels[-2]
            power = math.log(last.seconds / before.seconds) / math.log(before.edge / last.edge)
            power = min(max(power, COST_POWER - 0.5), COST_POWER + 0.5)
        return self.time_factor * last.seconds * (last.edge / edge) ** power

    def _affordable(self, seconds: float) -> float:
        """Return the edge length of a run that takes so long [s]; the coarsest pilot's at most."""
        low, high = self.levels[-1].edge / 20.0, self.levels[0].edge
        if self._seconds(high) >= seconds:
            return high
        for _ in range(60):
            middle = math.sqrt(low * high)
            low, high = (middle, high) if self._seconds(middle) > seconds else (low, middle)
        return high

    def _overrides(self, choice: Choice) -> tuple[str, ...]:
        return self._settings(choice.edge_length, choice.time_factor)

    def _settings(self, edge: float, time_factor: float) -> tuple[str, ...]:
        """Return what an edge length and a longer process change of the scene."""
        changed = [f'blank.edge_length="{1e3 * edge:.9g} mm"']
        if time_factor != 1.0:
            changed.append(f'process.time="{1e3 * time_factor * self.scene.process.time:.9g} ms"')
        return tuple(changed)


def _mm(length: float) -> str:
    return f"{1e3 * length:.3g} mm"
