"""Runs that meet a requirement: errors that they may have, or time that they may take.

1. Pilots are runs on coarse meshes. They show how the result depends on the edge length, and what
   any mesh costs (:mod:`lcmchain.study.convergence`).
2. Cheaper settings are tried on the coarsest pilot: added mass, softer fibres, a cheaper model. The
   error of a setting is what it changes, its price the time that it takes. Errors of inertia and
   damping depend on the speed of the process. Runs with more mass therefore show those of the
   scene's own process too, also where only a time is required. Settings that make a check of the
   program worse are not taken, neither on the coarse mesh nor after the run.
3. Pilots on finer meshes follow with the cheap settings, as long as they cost little beside the
   run.
4. :func:`lcmchain.study.choice.choose` takes mesh and settings. The first steps of that run tell
   before how long it takes (:mod:`lcmchain.study.runs`).
5. The run is the check. Its difference from the pilots shows its own error. Where it misses the
   requirement, a finer mesh is run.

This holds as far as errors follow an order. Coarse runs know nothing of wrinkles that appear only
on fine meshes. The error that is reported after the run does, as far as its mesh resolves them.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from lcmchain.check.large_mesh import shortest_edges
from lcmchain.errors import InputError
from lcmchain.scene import Scene
from lcmchain.study.choice import Choice, Knowledge, Requirement, choose, mm
from lcmchain.study.comparison import BY_NAME, differences, quantities_of
from lcmchain.study.convergence import (
    COUNTED,
    SCATTER,
    Convergence,
    Level,
    error_laws,
    expected_seconds,
    fitted,
)
from lcmchain.study.outcome import Outcome
from lcmchain.study.runs import DURATION, Beginning, Progress, Study, Workers, begin_run
from lcmchain.study.sources import SceneText, Variant
from lcmchain.study.step_settings import (
    AS_IT_IS,
    LONGER,
    SOFTER_FIBRES,
    Candidate,
    StepSettings,
    cheaper_rungs,
    inertia_trials,
    slower,
    why_time_stays,
)

#: Elements along the edge of a square as large as the blank, of the pilots; even numbers, so that
#: the middle of a symmetric blank is a node. Coarser ones follow no order.
PILOTS = (14, 20, 28, 40)
#: Elements along the edge grow by these factors at least and at most from one pilot to the next.
LEAST_RATIO, PILOT_RATIO = 1.15, math.sqrt(2.0)
#: Most pilots, and how much finer than the finest of them the mesh of a run may be. Two meshes
#: alone only tell whether the coarser one will do.
MOST_PILOTS = 6
FARTHEST = 2.0
#: A pilot takes at most a third of the time of the run: its edges are longer by this factor.
COARSER = 1.45
#: Largest share of a budget, or of the time of the run, for pilots that are not always made.
PILOT_SHARE = 0.3
#: Time of the trials of settings within a budget, over that of a run with the settings of the
#: scene: of all trials, and of the quick ones, which are always made.
TRIALS, QUICK_TRIALS = 1.25, 0.375
#: Elements along the edge of the first pilot within a budget, which tells times alone.
QUICK_PILOT = 8
#: Meshes with fewer elements along the edge tell nothing of errors, neither of the mesh nor of the
#: settings.
LEAST_COUNTED = 14
#: Solver time over h^-q, before pilots tell it.
COST_POWER = 3.0
#: Usual order by which errors fall with the speed of a process: 2 those of inertia, 1 of damping.
ORDER_OF_SPEED = 1.5
#: Part of a requirement that the settings of pilots may be off by. More would pass for an error of
#: meshes.
PILOTS_OFF = 0.1
#: A model is tried if the trial takes less than this part of the run's time.
RUNG_SHARE = 0.1
#: Without a budget no run is begun that takes longer than both this [s] and this many times the
#: scene.
LONGEST_RUN, TIMES_THE_SCENE = 600.0, 3.0
#: Part of a budget that is planned: the time of a run is known to about a tenth.
PLANNED = 0.92
#: At most so many choices are timed by the first steps on their mesh, each for at most this part of
#: a budget, until a choice has about the edge length of one that was timed.
MOST_BEGINNINGS, BEGINNING_SHARE = 4, 0.01
ABOUT_TIMED = 0.97
#: A slower process is taken where the time left is more than this factor of that of the run.
SPARE = 1.2
#: A run is repeated at most so often, and with edges shorter by this factor at least.
MOST_RUNS = 3
NO_BETTER = 0.95


class Chooser:
    """Chooses the settings of a run by pilots, and judges the run by them.

    Parameters
    ----------
    folder : where pilots are kept; those that lie there are not computed again.
    announce : told in words what is about to be run, and how long that takes.
    """

    def __init__(
        self,
        text: SceneText,
        folder: Path,
        requirement: Requirement,
        *,
        threads: int | None = None,
        progress: Progress | None = None,
        announce: Callable[[str], None] | None = None,
    ) -> None:
        self.text, self.requirement, self.progress = text, requirement, progress
        self.announce = announce or (lambda _: None)
        self.scene = text.scene()
        self.blank = self.scene.shared_blank("lcmchain run with --within or --budget")
        self.is_laid = self.scene.element.type == "kinematic"
        self.time_stays = why_time_stays(self.scene)
        self.threads, self.study = threads, Study(text, folder, Workers(1, threads))
        self.levels: list[Level] = []
        self.candidates = [Candidate(AS_IT_IS)]
        self.measured: dict[StepSettings, Candidate] = {}
        self.laws_of_speed: dict[str, Convergence] = {}
        self.pilots_as = Candidate(AS_IT_IS)
        self.tried_at = math.inf
        self.pilots: dict[tuple[float, StepSettings], Outcome] = {}
        self.beginnings: dict[float, Beginning] = {}
        self.run_seconds = 0.0

    @property
    def pilot_seconds(self) -> float:
        """Solver time of all pilots and beginnings [s]."""
        pilots = sum(outcome.seconds for outcome in self.pilots.values())
        return pilots + sum(begun.spent for begun in self.beginnings.values())

    def run(self, make: Callable[[Choice], Outcome]) -> Choice:
        """Run pilots, then the scene by ``make`` until it meets the requirement; return the choice.

        Parameters
        ----------
        make : makes the run that was chosen (:meth:`scene_of`, :meth:`variant_of`).

        Raises
        ------
        InputError : no pilot gave a result, or the requirement takes far longer than the scene and
            no budget allows it.
        """
        self._run_pilots()
        choice = self._timed_choice()
        for _ in range(MOST_RUNS):
            self._announce(choice)
            outcome = make(choice)
            self.run_seconds += outcome.seconds
            self._judge(choice, outcome)
            if choice.kept or self.requirement.budget is not None:
                break
            if choice.worse:
                choice = self._without_settings(choice)
                continue
            better = self._timed_choice()
            finer = NO_BETTER * choice.edge_length
            if better.edge_length > finer and self._converge(choice):
                better.edge_length = finer  # less would tell nothing new
            if better.edge_length > finer or self._too_long(better):
                break
            better.notes.append(f"edges of {mm(choice.edge_length)} missed the requirement")
            choice = better
        return choice

    def _converge(self, choice: Choice) -> bool:
        """Tell whether finer meshes have less of all errors that were missed."""
        laws = error_laws(self._counted)
        missed = choice.missed_errors(self.requirement.errors)
        return all(name in laws and laws[name].order > 0.0 for name in missed)

    def _without_settings(self, choice: Choice) -> Choice:
        """Return what is chosen once settings have made a check worse on the mesh of the run.

        Other settings that are as fast or as soft are not taken either.
        """
        taken = choice.settings
        self.candidates = [
            candidate
            for candidate in self.candidates
            if candidate.settings == AS_IT_IS
            or (
                (taken.speed <= 1.0 or candidate.settings.speed < taken.speed)
                and (taken.fibres == 1.0 or candidate.settings.fibres > taken.fibres)
                and (not taken.model or candidate.settings.model != taken.model)
            )
        ]
        better = self._timed_choice()
        checks = ", ".join(choice.worse)
        settings = " and ".join(taken.in_words())
        better.notes.append(f"{settings} made checks of the run worse ({checks}), and were left")
        return better

    # --- pilots -----------------------------------------------------------------------------------

    def _run_pilots(self) -> None:
        """Run coarse meshes, and on one of them cheaper settings."""
        failure = ""
        for edge in self._pilot_edges():
            outcome = self._pilot(edge, self.pilots_as.settings)
            failure = outcome.failure or failure
            if outcome.failure:
                continue
            tries = self.requirement.errors and not math.isfinite(self.tried_at)
            if tries and self._counts(edge):
                self._try_settings(edge)
                outcome = self._pilot(edge, self.pilots_as.settings)
            self._add(edge, outcome, self.pilots_as)
        if not self.levels:
            remedy = "run it without --within and --budget"
            if self.requirement.budget is not None:
                remedy = f"allow a larger --budget, which finer ones fit into, or {remedy}"
            raise InputError(
                f"no coarse mesh of the scene could be formed to choose from ({failure}); {remedy}"
            )
        if not self.requirement.errors:
            self._measure_inertia()
        elif len(self.levels) > 1:
            if self.requirement.budget is None:
                self._refine_pilots()
            self._try_settings_again()
            self._try_models()

    def _pilot_edges(self) -> Iterator[float]:
        """Yield the edge lengths of the first pilots [m], two that give a result.

        Within a budget they use no more than its part for pilots. A first and coarse pilot shows
        what time allows, and the two finest that fit follow. More is spent on finer ones only where
        none of these can be formed at all.
        """
        if self.requirement.budget is None:
            for count in PILOTS:
                if len(self.levels) < 2:
                    yield self._size / count
            return
        first = self._size / QUICK_PILOT
        yield first
        seconds = self.pilot_seconds
        left = PILOT_SHARE * self.requirement.budget - seconds
        coarser, finest = self._two_that_count(first, seconds, left)
        if not finest:
            # time of all pilots over that of the finer one
            part = 1.0 + PILOT_RATIO**-COST_POWER * (1.0 + TRIALS)
            finest = first * (part * seconds / left) ** (1.0 / COST_POWER) if left > 0.0 else first
            finest = max(finest, self._size / PILOTS[-1])
            coarser = finest * PILOT_RATIO
        if coarser < first / PILOT_RATIO:
            yield coarser
        if finest < first / PILOT_RATIO:
            yield finest
        yield from self._finer_than_failures()

    def _two_that_count(self, first: float, seconds: float, left: float) -> tuple[float, float]:
        """Return edge lengths of two pilots that tell of errors [m], zeros where time is short.

        Without two of them no error of a mesh is known, and softer fibres are not taken. The
        coarser one has the fewest elements that count.

        Parameters
        ----------
        first : edge length of a pilot that took so many ``seconds``. left : time for both and for
            trials on the coarser one [s].
        """
        coarser = self._size / LEAST_COUNTED
        at_coarser = seconds * (first / coarser) ** COST_POWER
        at_finer = left - (1.0 + QUICK_TRIALS) * at_coarser
        if at_finer <= LEAST_RATIO**COST_POWER * at_coarser:
            return 0.0, 0.0
        ratio = (at_finer / at_coarser) ** (1.0 / COST_POWER)
        if ratio > PILOT_RATIO:
            return 0.0, 0.0  # two with more elements count as well
        return coarser, coarser / ratio

    def _allows_pilot(self, seconds: float) -> bool:
        """Tell whether a budget leaves so much of the part that goes into pilots."""
        budget = self.requirement.budget
        return budget is None or self.pilot_seconds + seconds <= PILOT_SHARE * budget

    def _finer_than_failures(self) -> Iterator[float]:
        """Yield ever finer edge lengths [m] until one gives a result, as far as a budget goes.

        Meshes that are too coarse for the radii of the tools are stopped by a guard. A finer one
        takes at least as long as such a mesh did before, times its elements and steps.
        """
        while not self.levels:
            edge, settings = min(self.pilots, key=lambda made: made[0])
            left = self._time_left() or 0.0
            if self.pilots[edge, settings].seconds * LEAST_RATIO**COST_POWER > left:
                return
            if edge < NO_BETTER * self._size / PILOTS[-1]:
                return
            yield edge / LEAST_RATIO

    def _refine_pilots(self) -> None:
        """Run finer pilots as long as the mesh that is required lies far from all of them."""
        while len(self.levels) < MOST_PILOTS:
            choice, finest = self._choice(), self.levels[-1].edge
            needed, tell_an_order = choice.edge_length, len(self.levels) > 2
            if needed * FARTHEST > finest if tell_an_order else needed >= self.levels[0].edge:
                return
            if tell_an_order and self._too_long(choice):
                return  # a requirement that is refused is refused before it has cost minutes
            halves = 0.5 * self._size / max(needed * COARSER, finest / PILOT_RATIO)
            least = 0.5 * LEAST_RATIO * self._size / finest
            edge = 0.5 * self._size / round(max(halves, least))
            outcome = self._pilot(edge, self.pilots_as.settings)
            if outcome.failure:
                return
            self._add(edge, outcome, self.pilots_as)

    def _pilot(self, edge: float, settings: StepSettings) -> Outcome:
        """Return the outcome of a pilot; its time counts once.

        Raises
        ------
        InputError : the scene refuses the settings.
        """
        if (edge, settings) not in self.pilots:
            name = ", ".join([f"pilot {mm(edge)}", *settings.in_words()])
            overrides = self._overrides(edge, settings)
            variant = Variant(name, "pilot", overrides, edge, settings.model or None)
            self.pilots[edge, settings] = self.study.outcome(variant, self.progress)
        return self.pilots[edge, settings]

    def _add(self, edge: float, outcome: Outcome, made_as: Candidate) -> None:
        """Keep a run as what is known of its mesh, in place of one on about the same mesh."""
        others = [level for level in self.levels if not self._same_mesh(level.edge, edge)]
        level = Level(
            edge, outcome.seconds / made_as.cost, outcome, made_as.errors, made_as.settings
        )
        self.levels = sorted([*others, level], key=lambda level: -level.edge)

    @staticmethod
    def _same_mesh(edge: float, other: float) -> bool:
        """Tell whether two edge lengths are about the same."""
        return NO_BETTER < edge / other < 1.0 / NO_BETTER

    def _counts(self, edge: float) -> bool:
        """Tell whether a mesh is fine enough to tell something of errors."""
        return edge <= 1.001 * self._size / LEAST_COUNTED

    @property
    def _counted(self) -> list[Level]:
        """Known meshes that tell something of errors, the coarsest first.

        The errors of their settings are those known now. Some meshes were run before these errors
        were measured, or before they were measured on a finer mesh.
        """
        off = {settings: candidate.errors for settings, candidate in self.measured.items()}
        return [
            level._replace(off=off.get(level.settings, level.off))
            for level in self.levels
            if self._counts(level.edge)
        ]

    # --- settings ---------------------------------------------------------------------------------

    def _measure_inertia(self) -> None:
        """Measure the errors by speed and fibre modulus, where no error is required.

        They are stated after the run as those of any other one. The pace of the scene stays. Softer
        fibres are taken where the finer mesh that they leave time for is better.
        """
        if self._counted and not self.is_laid:
            edge = self._counted[0].edge
            fastest = self._try_inertia(edge)
            takes = math.sqrt(SOFTER_FIBRES) * self._pilot(edge, AS_IT_IS).seconds
            self._try_fibres(edge, AS_IT_IS if self._allows_pilot(takes) else fastest)
            self.measured |= {candidate.settings: candidate for candidate in self.candidates}
            self.candidates = [c for c in self.candidates if c.settings.speed == 1.0]

    def _try_settings(self, edge: float) -> None:
        """Measure on a mesh what added mass and softer fibres change, and what they save."""
        self.tried_at = edge
        if self.is_laid:  # without mass and steps
            return
        base = self._try_inertia(edge)
        self.pilots_as = self.measured.get(base, Candidate(AS_IT_IS))
        self._try_fibres(edge, base)
        self.measured |= {candidate.settings: candidate for candidate in self.candidates}

    def _try_inertia(self, edge: float) -> StepSettings:
        """Measure on a mesh what added mass changes and saves.

        Settings that make a check of the program worse are no candidates. Return those for pilots:
        the fastest that change little of what is required.
        """
        plain = self._pilot(edge, AS_IT_IS)
        trials: list[StepSettings] = []
        for settings in inertia_trials(self.scene):
            # with the fastest alone the law of speed has its usual order
            allowed = not trials or self._allows_pilot(plain.seconds / settings.speed)
            if allowed and not self._pilot(edge, settings).failure:
                trials.append(settings)
        self.candidates = [Candidate(AS_IT_IS)]
        if not trials:
            return AS_IT_IS
        laws = self.laws_of_speed = self._laws_of_speed(edge, [*trials, AS_IT_IS])
        tried = [
            Candidate(
                settings,
                {name: law.error(settings.speed) for name, law in laws.items()},
                settings.time
                if settings.speed < 1.0
                else self._pilot(edge, settings).seconds / plain.seconds,
            )
            for settings in (*trials, AS_IT_IS, *slower(self.scene))
        ]
        self.measured |= {candidate.settings: candidate for candidate in tried}
        self.candidates = [
            candidate
            for candidate in tried
            if candidate.settings.speed <= 1.0
            or not self._pilot(edge, candidate.settings).worse_than(plain)
        ]
        for settings in trials:
            off = self._off(self._pilot(edge, settings), plain)
            if all(
                off.get(n, 0.0) <= PILOTS_OFF * most for n, most in self.requirement.errors.items()
            ):
                return settings
        return AS_IT_IS

    def _laws_of_speed(
        self, edge: float, settings: Sequence[StepSettings]
    ) -> dict[str, Convergence]:
        """Return how errors depend on the speed of the process, by runs on one mesh.

        As with meshes, the differences become smaller, the slower the runs are.
        """
        runs = [self._pilot(edge, one) for one in settings]
        between = {
            (i, j): differences(runs[i], runs[j])
            for i, j in itertools.combinations(range(len(runs)), 2)
        }
        laws = {}
        for name in BY_NAME:
            distances = {pair: found[name].typical for pair, found in between.items()}
            law = fitted([one.speed for one in settings], distances, ORDER_OF_SPEED, (SCATTER,))
            if math.isfinite(law.order):
                laws[name] = law
        return laws

    def _try_fibres(self, edge: float, base: StepSettings) -> None:
        """Measure what softer fibres change beside other settings, and add both together."""
        if self.scene.process.fibre_modulus_factor != 1.0:
            return
        before, soft = self._pilot(edge, base), replace(base, fibres=SOFTER_FIBRES)
        try:
            outcome = self._pilot(edge, soft)
        except InputError:  # a law without fibres
            return
        if outcome.failure or self._stretched(outcome, soft) or outcome.worse_than(before):
            return
        off, cost = self._off(outcome, before), outcome.seconds / before.seconds
        self.candidates += [_with(c, replace(c.settings, fibres=SOFTER_FIBRES), off, cost)
                            for c in self.candidates]  # fmt: skip

    def _stretched(self, outcome: Outcome, settings: StepSettings) -> list[str]:
        """Return the name of the check that softer fibres fail, where they stretch too far."""
        strain = outcome.numbers.get("fibre_strain_max", math.inf)
        allowed = settings.fibres == 1.0 or strain <= self.scene.process.fibre_strain_allowed
        return [] if allowed else ["strain of softer fibres"]

    def _try_settings_again(self) -> None:
        """Measure settings on the finest pilot as well, where that costs little beside the run.

        Coarse meshes react to them more than fine ones, which may keep cheap ones from being taken.
        """
        finest, choice = self.levels[-1], self._choice()
        if finest.edge > NO_BETTER * self.tried_at:
            return
        cheapest = min(candidate.cost for candidate in self.candidates)
        chosen = next(c for c in self.candidates if c.settings == choice.settings)
        if chosen.cost > cheapest and finest.seconds < PILOT_SHARE * choice.run_seconds:
            pilots_as = self.pilots_as
            if not self._pilot(finest.edge, AS_IT_IS).failure:
                self._try_settings(finest.edge)
                self.pilots_as = pilots_as  # what the other levels were run with

    def _try_models(self) -> None:
        """Measure what cheaper rungs of the model ladder change that leave out nothing of a scene.

        The net of fibres takes milliseconds and is tried on the finest pilot; others on the
        coarsest one, where that costs little beside the run.
        """
        if self.text.model is not None:
            return
        for rung in cheaper_rungs(self.scene, self.requirement.errors):
            settings = StepSettings(model=rung)
            level, laid = (self._counted or self.levels)[0], rung == "kinematic"
            if laid:
                level = self.levels[-1]
            elif level.seconds > RUNG_SHARE * self._choice().run_seconds:
                continue
            try:
                if self.text.scene((), rung).source.left_out:
                    continue
                outcome = self._pilot(level.edge, settings)
            except InputError:  # not every rung knows the law, or has a tool to drape on
                continue
            if not outcome.failure:
                off = self._off(outcome, level.outcome)
                cost = outcome.seconds / level.seconds
                self.candidates.append(Candidate(settings, off, cost))

    def _off(self, outcome: Outcome, other: Outcome) -> dict[str, float]:
        """Return the difference of two runs in every quantity that both have."""
        off = {name: found.typical for name, found in differences(outcome, other).items()}
        return {name: error for name, error in off.items() if math.isfinite(error)}

    # --- the choice -------------------------------------------------------------------------------

    def _timed_choice(self) -> Choice:
        """Return what meets the requirement, timed by the first steps on its mesh."""
        choice = self._choice()
        for _ in range(MOST_BEGINNINGS):
            if self._is_timed(choice):
                return self._with_a_slower_process(choice)
            for edge in (self.levels[-1].edge, choice.edge_length):
                if edge not in self.beginnings:
                    self.beginnings[edge] = self._begin(edge)
            choice = self._choice()
        return self._with_a_slower_process(self._choice(settled=True))

    def _is_timed(self, choice: Choice) -> bool:
        """Tell whether a choice was timed on about its mesh; a net takes no time."""
        if self.is_laid or choice.settings.model == "kinematic":
            return True
        known = [*self.beginnings, *(level.edge for level in self.levels)]
        near = NO_BETTER if self.requirement.budget is None else ABOUT_TIMED
        return any(near <= edge / choice.edge_length <= 1.0 / near for edge in known)

    def _with_a_slower_process(self, choice: Choice) -> Choice:
        """Return a choice with a slower process, where no finer mesh fits into the time left.

        Where the mesh has to fit the outline, the next finer one may have twice the elements.
        """
        left = self._time_left()
        if (
            left is None
            or self.requirement.errors
            or self.time_stays
            or choice.settings != AS_IT_IS
        ):
            return choice
        times = math.floor(20.0 * min(left / choice.run_seconds, LONGER[-1])) / 20.0
        if times < SPARE:
            return choice
        choice.settings = StepSettings(time=times)
        choice.why += "; a slower process takes what is left, for less inertia"
        choice.run_seconds *= times
        choice.expected_seconds += (1.0 - 1.0 / times) * choice.run_seconds
        errors = {n: law.error(choice.settings.speed) for n, law in self.laws_of_speed.items()}
        self.candidates.append(Candidate(choice.settings, errors, times))
        return choice

    def _begin(self, edge: float) -> Beginning:
        """Begin the scene with an edge length for a moment."""
        variant = Variant(f"beginning {mm(edge)}", "pilot", self._overrides(edge, AS_IT_IS), edge)
        return begin_run(self.text.job(variant).scene, self.threads, self._begun_for)

    @property
    def _begun_for(self) -> float:
        """How long the first steps of a mesh are made [s]."""
        if self.requirement.budget is None:
            return DURATION
        return min(DURATION, BEGINNING_SHARE * self.requirement.budget)

    def _expected_seconds(self, edge: float) -> float:
        """Return the solver time of the scene with an edge length [s]."""
        return expected_seconds(self.levels, edge, self._begun_seconds())

    def _begun_seconds(self) -> dict[float, float]:
        return {edge: begun.seconds for edge, begun in self.beginnings.items()}

    def _time_left(self) -> float | None:
        """Return the solver time that is planned for the run [s]; None for any."""
        if self.requirement.budget is None:
            return None
        return PLANNED * self.requirement.budget - self.pilot_seconds - self.run_seconds

    def _choice(self, *, settled: bool = False) -> Choice:
        """Return what meets the requirement by what is known so far."""
        laws, left = error_laws(self._counted), self._time_left()
        own_edge = self.blank.edge_length
        shortest = shortest_edges(self.scene)
        known = Knowledge(
            self.levels, laws, own_edge, shortest, left, self._begun_seconds(), settled
        )
        choice, worst = choose(self.requirement, self.candidates, known)
        if self.time_stays and not self.is_laid:
            choice.why += f"; the process time stays, since {self.time_stays}"
        finest = self.levels[-1].edge / FARTHEST
        if len(self.levels) >= MOST_PILOTS and choice.edge_length < finest:
            choice.notes.append(
                f"edges of {mm(choice.edge_length)} would be needed, far from any pilot"
            )
            choice.edge_length = finest
        if worst > 1.0 and self.requirement.budget is not None:
            choice.notes.append("the time allows less than the requirement needs")
        choice.pilot_seconds = self.pilot_seconds
        choice.expected_seconds = self.pilot_seconds + self.run_seconds + choice.run_seconds
        return choice

    def _too_long(self, choice: Choice) -> bool:
        """Tell whether a run would take longer than anybody expects who has set no budget."""
        as_it_is = self._expected_seconds(self.blank.edge_length)
        longest = max(LONGEST_RUN, TIMES_THE_SCENE * as_it_is)
        return self.requirement.budget is None and choice.run_seconds > longest

    def _announce(self, choice: Choice) -> None:
        """Say what is about to be run.

        Raises
        ------
        InputError : it takes far longer than the scene, and no budget allows that.
        """
        if self._too_long(choice):
            minutes = math.ceil(choice.expected_seconds / 60.0)
            raise InputError(
                f"{self.requirement.in_words()} would take {choice.settings_in_words()}, and about "
                f'{minutes} minutes; allow them with --budget "{minutes} min", or ask for less',
                key="--within",
            )
        self.announce(
            f"Running {choice.settings_in_words()}; about {choice.run_seconds:.2g} s of solver time"
        )

    def _judge(self, choice: Choice, outcome: Outcome) -> None:
        """Note in the choice what the run has shown, as one more mesh that is known."""
        chosen = next(c for c in self.candidates if c.settings == choice.settings)
        # another model tells nothing of the meshes of this one, and other settings on the mesh of
        # a pilot no more than that pilot
        known_mesh = any(self._same_mesh(lv.edge, choice.edge_length) for lv in self.levels)
        like_pilots = chosen.settings == self.pilots_as.settings
        if not choice.settings.model and (like_pilots or not known_mesh):
            self._add(choice.edge_length, outcome, chosen)
        known = Knowledge(self.levels, error_laws(self._counted))
        choice.found = known.errors(chosen, choice.edge_length)
        choice.meshes = [level.edge for level in self._counted[-COUNTED:]]
        choice.unstated = [name for name in quantities_of(outcome) if name not in choice.found]
        choice.seconds = self.pilot_seconds + self.run_seconds
        choice.budget = self.requirement.budget
        if choice.is_over_budget:
            choice.notes.append(
                f"all runs together took {choice.seconds:.3g} s of solver time, more than the "
                f"budget of {self.requirement.budget:.3g} s"
            )
        plain = self.pilots.get((self.tried_at, AS_IT_IS))
        if plain is not None and choice.settings != AS_IT_IS:
            choice.worse = outcome.worse_than(plain) + self._stretched(outcome, choice.settings)
        missed = choice.missed_errors(self.requirement.errors)
        choice.kept = not (choice.is_over_budget or choice.worse or missed)

    # --- the scene --------------------------------------------------------------------------------

    @property
    def _size(self) -> float:
        """Edge of a square as large as the blank [m]."""
        width, height = self.blank.extent
        return math.sqrt(width * height)

    def scene_of(self, choice: Choice) -> Scene:
        """Return the scene with what was chosen, and all of its output."""
        variant = self.variant_of(choice)
        return self.text.scene(variant.overrides, variant.model)

    def variant_of(self, choice: Choice) -> Variant:
        """Return what was chosen as a setting of a study."""
        edge, settings = choice.edge_length, choice.settings
        name = ", ".join([mm(edge), *settings.in_words()])
        overrides = self._overrides(edge, settings)
        return Variant(name, "chosen", overrides, edge, settings.model or None)

    def _overrides(self, edge: float, settings: StepSettings) -> tuple[str, ...]:
        """Return what an edge length and settings change of the scene."""
        return (f'blank.edge_length="{1e3 * edge:.9g} mm"', *settings.overrides(self.scene))


def _with(
    candidate: Candidate, settings: StepSettings, off: dict[str, float], cost: float
) -> Candidate:
    """Return a candidate with one more setting, its error and its cost."""
    errors = {n: math.hypot(candidate.errors.get(n, 0.0), error) for n, error in off.items()}
    return Candidate(settings, {**candidate.errors, **errors}, cost * candidate.cost)
