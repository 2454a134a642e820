"""The choice of mesh, settings and time for a run that has to meet a requirement, from pilots.

The expected error of a choice has two parts. One is that of the mesh, by the law that the meshes of
pilots follow (:mod:`lcmchain.study.convergence`). The other is what cheaper settings change,
measured on a coarse mesh. Both are independent, so that their squares add up. Of the choices that
meet the requirement the quickest is taken.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

from lcmchain.errors import InputError
from lcmchain.quantities.units import ANGLE, LENGTH, TIME, QuantityError, parse_quantity
from lcmchain.study.comparison import BY_NAME, QUANTITIES, Quantity
from lcmchain.study.convergence import Convergence, Level, expected_seconds
from lcmchain.study.step_settings import AS_IT_IS, Candidate, StepSettings

# --- what a user requires of a run ----------------------------------------------------------------


_NUMBER = r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_ERROR = re.compile(rf"\s*({_NUMBER})\s*(%|°|[A-Za-z]+)\s+(?:of\s+|in\s+)?(.+?)\s*", re.ASCII)
_DIMENSIONS = {"°": ANGLE, "mm": LENGTH}
#: What a forming run has: no clamps.
REQUIRED = tuple(quantity for quantity in QUANTITIES if quantity.name != "clamp_force")


@dataclass(frozen=True)
class Requirement:
    """Errors allowed, by the names of ``QUANTITIES`` in SI or as parts, and solver time [s]."""

    errors: Mapping[str, float] = field(default_factory=dict)
    budget: float | None = None

    def in_words(self) -> str:
        """Return the requirement as a text."""
        told = [
            f"{q.text(self.errors[q.name])} {q.title}" for q in QUANTITIES if q.name in self.errors
        ]
        if self.budget is not None:
            told.append(f"{self.budget:.3g} s")
        return ", ".join(told)


def read_requirement(within: str | None, budget: str | None) -> Requirement:
    """Read the options ``--within`` and ``--budget``.

    Raises
    ------
    InputError : a text that is no list of errors, such as ``1 deg shear, 1 % thickness``, an
        unknown quantity, a unit that does not fit it, or a time that is not positive.
    """
    seconds = None
    if budget is not None:
        try:
            seconds = parse_quantity(budget, TIME)
        except QuantityError as error:
            raise InputError(str(error), key="--budget") from None
        if not seconds > 0.0:
            raise InputError(f"must be positive, is {budget}", key="--budget")
    return Requirement({} if within is None else _errors(within), seconds)


def _errors(text: str) -> dict[str, float]:
    errors: dict[str, float] = {}
    for part in text.split(","):
        match = _ERROR.fullmatch(part)
        if match is None:
            raise InputError(
                f'"{part.strip()}" is not an error and what it is of; for example '
                '--within "1 deg shear, 1 % thickness, 3 % force, 0.5 mm contour"',
                key="--within",
            )
        number, unit, words = match.groups()
        quantity = _quantity(words)
        if quantity.name in errors:
            raise InputError(f'"{quantity.title}" is given twice', key="--within")
        value = _value(number, unit, quantity)
        if not value > 0.0:
            raise InputError(f'"{part.strip()}" allows no error at all', key="--within")
        if not math.isfinite(value):
            raise InputError(f'"{part.strip()}" allows any error; leave it out', key="--within")
        errors[quantity.name] = value
    return errors


def _quantity(words: str) -> Quantity:
    wanted = " ".join(words.lower().replace("_", " ").split())
    for quantity in REQUIRED:
        names = (quantity.title, quantity.name.replace("_", " "), quantity.short, *quantity.aliases)
        if wanted in (name.lower().replace("_", " ") for name in names):
            return quantity
    known = ", ".join(quantity.title for quantity in REQUIRED)
    raise InputError(f'"{words}" is no quantity that runs are compared by; there is {known}',
                     key="--within")  # fmt: skip


def _value(number: str, unit: str, quantity: Quantity) -> float:
    if quantity.relative:
        if unit != "%":
            raise InputError(
                f"the error of the {quantity.title} is a part of it: give it in %, such as "
                f'"1 % {quantity.title}"',
                key="--within",
            )
        return 0.01 * float(number)
    if unit == "%":
        raise InputError(
            f"the error of the {quantity.title} is no part of it: give it in {quantity.unit}",
            key="--within",
        )
    try:
        return parse_quantity(f"{number} {'deg' if unit == '°' else unit}",
                              _DIMENSIONS[quantity.unit])  # fmt: skip
    except QuantityError as error:
        raise InputError(str(error), key="--within") from None


# --- what is chosen -------------------------------------------------------------------------------


#: Expected errors are to lie below the requirement by this factor; laws have their own caution.
MARGIN = 0.95
ROUNDING = 1e-6
#: The time of a mesh that was begun may exceed what is planned by this factor: less than a tenth of
#: the budget is kept back.
ABOUT = 1.06
#: A budget counts as kept up to this factor: what a run takes is known before to about a tenth, and
#: other work on the machine takes its part.
OVER_BUDGET = 1.25
#: Part of a requirement that is left to the mesh at least.
LEAST_ROOM = 0.2


@dataclass
class Choice:
    """What was chosen for a run, and what came of it.

    Parameters
    ----------
    requirement : in words. edge_length [m], settings : chosen; why : in words.
    settings_errors : what the settings beside the mesh are off by, as measured, by quantity.
    expected : errors by quantity that pilots led to expect; found : estimated after the run.
    meshes : edge lengths that these are estimated by [m], the coarsest first; unstated : quantities
    of which too few of them can be compared.
    run_seconds : solver time that the run was to take [s].
    pilot_seconds, seconds : solver time of the pilots, and of everything [s].
    expected_seconds : what everything was to take [s].
    budget : solver time that everything was allowed to take [s]; None for any.
    worse : checks of the program that the settings have made worse.
    kept : whether what was found meets the requirement, and the time that was taken the budget.
    notes : what a user should know.
    """

    requirement: str
    edge_length: float
    settings: StepSettings
    why: str
    settings_errors: dict[str, float] = field(default_factory=dict)
    expected: dict[str, float] = field(default_factory=dict)
    found: dict[str, float] = field(default_factory=dict)
    meshes: list[float] = field(default_factory=list)
    unstated: list[str] = field(default_factory=list)
    run_seconds: float = 0.0
    pilot_seconds: float = 0.0
    expected_seconds: float = 0.0
    seconds: float = 0.0
    budget: float | None = None
    worse: list[str] = field(default_factory=list)
    kept: bool = False
    notes: list[str] = field(default_factory=list)

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for ``summary.json``, where the requirement is the ``wish``."""
        values = asdict(self)
        return {"wish": values.pop("requirement"), **values}

    def settings_in_words(self) -> str:
        """Say what was chosen, and why."""
        parts = [f"edges of {mm(self.edge_length)}", *self.settings.in_words()]
        text = parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}"
        return f"{text}, since {self.why}"

    @property
    def is_over_budget(self) -> bool:
        """Tell whether everything took more than the budget, beyond what is known of times."""
        return self.budget is not None and self.seconds > OVER_BUDGET * self.budget

    def missed_errors(self, allowed: Mapping[str, float]) -> list[str]:
        """Return the quantities whose error was found to be larger than allowed, or not found."""
        return [
            name for name, most in allowed.items() if not self.found.get(name, math.inf) <= most
        ]

    def missed(self) -> str:
        """Say that the requirement is not met, and what to do."""
        if self.is_over_budget:
            return (
                f"the requirement, {self.requirement}, is not met: everything took "
                f"{self.seconds:.3g} s of solver time; allow that with --budget, or make the scene "
                "cheaper"
            )
        if self.worse:
            settings = " and ".join(self.settings.in_words())
            return (
                f"the requirement, {self.requirement}, is not met: {settings} made checks of the "
                f"run worse ({', '.join(self.worse)}); see the warnings and the report"
            )
        if not any(math.isfinite(error) for error in self.found.values()):
            return (
                f"whether the requirement, {self.requirement}, is met is not known: no error could "
                "be estimated; allow more time for finer meshes, or look at lcmchain study accuracy"
            )
        return (
            f"the requirement, {self.requirement}, is not met by the errors that are estimated; "
            "ask for less, allow more time, or look at lcmchain study accuracy"
        )

    def in_words(self) -> str:
        """Say what came of it, and which meshes the errors are estimated by."""
        spent = (
            f"{self.seconds:.3g} s of solver time, {self.pilot_seconds:.3g} s of them for pilots"
        )
        told = [
            f"{BY_NAME[name].title} {BY_NAME[name].text(error)}"
            for name, error in self.found.items()
            if math.isfinite(error)
        ]
        if not told:
            return (
                "No error can be stated: that takes two meshes at least that are fine enough to "
                f"be compared, and {_counted(self.meshes)}; {spent}"
            )
        text = f"Estimated errors, by {_counted(self.meshes)}: {', '.join(told)}"
        if self.unstated:
            names = ", ".join(BY_NAME[name].title for name in self.unstated)
            text += f"; too few of these can be compared to state that of {names}"
        return f"{text}; {spent}"


def _counted(meshes: Sequence[float]) -> str:
    """Name the meshes that errors are estimated by."""
    if not meshes:
        return "none is known"
    edges = [mm(edge) for edge in meshes]
    if len(edges) == 1:
        return f"one is known, of {edges[0]}"
    open_order = ", which leave the order open" if len(edges) == 2 else ""
    return f"meshes of {', '.join(edges[:-1])} and {edges[-1]}{open_order}"


@dataclass(frozen=True)
class Knowledge:
    """What is known from pilots: how errors depend on the mesh, and how long a mesh takes.

    Parameters
    ----------
    levels : meshes that were run, the coarsest first. laws : of errors over the edge length.
    own_edge : edge length of the scene [m]. shortest : that of the finest mesh that memory holds.
    left : solver time that may be spent on the run [s]; None for any.
    begun : seconds by edge length (:func:`lcmchain.study.convergence.expected_seconds`).
    settled : whether time allows no edge lengths but those: where the mesh has to fit the outline,
        others may have the elements of a finer or a coarser one.
    """

    levels: Sequence[Level]
    laws: Mapping[str, Convergence]
    own_edge: float = math.inf
    shortest: float = 0.0
    left: float | None = None
    begun: Mapping[float, float] = field(default_factory=dict)
    settled: bool = False

    def seconds(self, candidate: Candidate, edge: float) -> float:
        """Return the solver time of a run [s]."""
        return candidate.cost * expected_seconds(self.levels, edge, self.begun)

    def errors(self, candidate: Candidate, edge: float) -> dict[str, float]:
        """Return the expected errors of a run."""
        return {
            name: math.hypot(law.error(edge), candidate.errors.get(name, 0.0))
            for name, law in self.laws.items()
        }

    def affordable(self, candidate: Candidate) -> float:
        """Return the edge length [m] that the time allows; that of the coarsest level at most."""
        low, high = self.levels[-1].edge / 20.0, self.levels[0].edge
        if self.left is None:
            return 0.0
        if self.seconds(candidate, high) >= self.left:
            return high
        if self.settled:
            # what beginnings took while a mesh was looked for is little beside it
            most = ABOUT * self.left
            fitting = [edge for edge in self.begun if self.seconds(candidate, edge) <= most]
            if fitting:
                return min(fitting)
        for _ in range(60):
            middle = math.sqrt(low * high)
            slow = self.seconds(candidate, middle) > self.left
            low, high = (middle, high) if slow else (low, middle)
        return high


def choose(
    requirement: Requirement, candidates: Sequence[Candidate], known: Knowledge
) -> tuple[Choice, float]:
    """Return the quickest choice that meets a requirement, else the one that comes nearest to it.

    Returns
    -------
    The choice, and the largest expected error over what is required.
    """
    own = next((c.errors for c in candidates if c.settings == AS_IT_IS), {})
    plans = [_plan(requirement, candidate, known, own) for candidate in candidates]
    if not requirement.errors:
        return min(plans, key=lambda plan: _over_the_scene(plan[0], plans))
    keeping = [plan for plan in plans if plan[1] <= MARGIN * (1.0 + ROUNDING)]
    if keeping:
        return min(keeping, key=lambda plan: plan[0].run_seconds)
    # what comes about as near is taken for the same
    nearest = min(worst for _, worst in plans)
    near = [plan for plan in plans if plan[1] <= 1.1 * nearest]
    return min(near, key=lambda plan: plan[0].run_seconds)


def _over_the_scene(choice: Choice, plans: Sequence[tuple[Choice, float]]) -> float:
    """Return the largest of the errors of a choice over those of the scene's settings.

    Nobody has said which errors matter: other settings have to be better in all that is known.
    """
    scene = next((plan for plan, _ in plans if plan.settings == AS_IT_IS), choice)
    if scene is choice:
        return MARGIN
    return max(
        (choice.expected[name] / error for name, error in scene.expected.items() if error > 0.0),
        default=1.0,
    )


def _plan(
    requirement: Requirement, candidate: Candidate, known: Knowledge, own: Mapping[str, float]
) -> tuple[Choice, float]:
    """Return the coarsest mesh on which settings meet a requirement, and the worst error over it.

    Where an error is beyond every mesh, nothing is saved at its expense: the mesh is not coarser
    than the scene's, and its settings are to be off by no more than the scene's ``own``. The mesh
    is not coarser either where pilots tell nothing of an error.
    """
    edge, why, notes = known.levels[0].edge, "the coarsest pilot will do", []
    given_up, untold = [], ""
    for name, allowed in requirement.errors.items():
        title = BY_NAME[name].title
        if name not in known.laws:
            untold = f"the pilots tell nothing of the {title}"
            notes.append(untold)
            continue
        law = known.laws[name]
        left = (MARGIN * allowed) ** 2 - candidate.errors.get(name, 0.0) ** 2
        room = max(math.sqrt(max(left, 0.0)), LEAST_ROOM * allowed)
        if law.order == 0.0:
            if law.factor > room:
                given_up.append(name)
                notes.append(
                    f"the {title} changes by {BY_NAME[name].text(law.factor)} from mesh to mesh, "
                    "and by no less on finer ones: no mesh is chosen for it"
                )
            continue
        needed = law.size(room)
        if needed < edge:
            edge, why = needed, f"the {title} needs edges of {mm(needed)}"
    if given_up and known.own_edge < edge:
        edge, why = known.own_edge, "no mesh meets the requirement, and these are the scene's"
    if untold and known.own_edge < edge:
        edge, why = known.own_edge, f"{untold}, and these are the scene's"
    affordable = known.affordable(candidate)
    if affordable > edge or (known.left is not None and not requirement.errors):
        edge, why = affordable, f"edges of {mm(affordable)} are what the time allows"
    if edge < known.shortest:
        edge, why = known.shortest, "finer meshes do not fit into the memory of this machine"
    errors = known.errors(candidate, edge)
    counted = dict(errors)
    for name in given_up:
        of_settings = candidate.errors.get(name, 0.0)
        if of_settings <= own.get(name, 0.0):
            counted[name] = of_settings
    worst = max(
        (
            counted[name] / allowed
            for name, allowed in requirement.errors.items()
            if name in counted
        ),
        default=0.0,
    )
    choice = Choice(
        requirement=requirement.in_words(),
        edge_length=edge,
        settings=candidate.settings,
        why=why + _of_settings(requirement, candidate),
        settings_errors=dict(candidate.errors),
        expected=errors,
        run_seconds=known.seconds(candidate, edge),
        notes=notes,
    )
    return choice, worst


def _of_settings(requirement: Requirement, candidate: Candidate) -> str:
    """Say what settings cost and save, where they are not those of the scene."""
    if candidate.settings == AS_IT_IS:
        return ""
    off = [
        f"{BY_NAME[n].text(candidate.errors[n])} {BY_NAME[n].title}"
        for n in requirement.errors or candidate.errors  # of a budget nobody has said which matter
        if n in candidate.errors
    ]
    return (
        f"; {' and '.join(candidate.settings.in_words())} take {candidate.cost:.2g} of the time "
        f"and are off by {', '.join(off) or 'nothing required'}"
    )


def mm(length: float) -> str:
    """Return a length [m] as a text."""
    return f"{1e3 * length:.3g} mm"
