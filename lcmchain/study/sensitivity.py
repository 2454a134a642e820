"""Sensitivity: which inputs the results of a scene depend on.

Every input is lowered and raised by the same part of its value, the others as they are. The
elasticity of a result R with respect to an input x, (dR/R)/(dx/x), follows from the two runs by
the central difference. The second difference, by which the result bends between them, says how far
the elasticity can be believed. An input at a bound is changed to the other side alone.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.table import Table

from lcmchain.atomic import replacing
from lcmchain.errors import InputError
from lcmchain.scene import Scene
from lcmchain.study.results import RESULTS, plain_table, results_of
from lcmchain.study.runs import Progress, Study, Workers
from lcmchain.study.sources import Source, Variant
from lcmchain.study.sweep import NUMBER

#: Part by which inputs are lowered and raised.
PART = 0.1
#: Names of the two runs of an input, with the sign of its change.
SIDES = {"lower": -1.0, "higher": 1.0}
#: Elasticities below this are not shown as dependence.
LEAST_SHOWN = 0.01
#: Beginnings of the entries whose numbers are inputs where a user names none.
TABLES = ("material.", "materials.", "contact.friction", "interfaces.")
# a unit may begin with 1, as in "200 1/s"
_NUMBERS = re.compile(rf"({NUMBER}(?:[\s,]+{NUMBER})*?)(?:\s+(1\s*/.*)|\s*([^\d\s.,+-].*))?")
_FROM_PRESET = re.compile(r" \(preset .*\)$")
#: Entries that a default is a copy of (:mod:`lcmchain.scene.reading.read`).
_COPY = re.compile(r" \((?:contact\.friction|process\.time)\)$")


@dataclass(frozen=True)
class Dependence:
    """How one result depends on one input.

    Parameters
    ----------
    elasticity : (dR/R)/(dx/x), not a number where runs failed that it would follow from.
    bend : second difference over the first, 0 for a result that is linear in between, not a number
        where one side alone is known.
    """

    key: str
    result: str
    elasticity: float
    bend: float


@dataclass(frozen=True)
class Sensitivity:
    """All dependences of a scene; ``value`` is the value of each input as text, by key.

    ``failures`` says which runs gave no result, and which inputs could not be changed.
    """

    title: str
    part: float
    value: dict[str, str]
    dependences: tuple[Dependence, ...]
    failures: tuple[str, ...] = ()

    def of(self, result: str) -> list[Dependence]:
        """Return the dependences of a result, the strongest first."""
        dependences = [d for d in self.dependences if d.result == result]
        known = [d for d in dependences if math.isfinite(d.elasticity)]
        return sorted(known, key=lambda d: -abs(d.elasticity))


def default_inputs(scene: Scene) -> dict[str, str]:
    """Return the numbers of a scene that its results may depend on, as texts by key.

    They are those of the materials, presets included, and the friction; zeros are left out, which
    no part of their value changes, and the friction of tools that take ``contact.friction``.
    """
    inputs = {}
    for key, text in (*scene.source.given, *scene.source.defaulted):
        of_tool = key.startswith("tools.") and key.endswith(".friction") and not _COPY.search(text)
        if (of_tool or key.startswith(TABLES)) and _is_numeric(scene, key):
            value = _plain(text)
            if _can_be_scaled(value):
                inputs[key] = value
    return inputs


def _plain(text: str) -> str:
    """Return the value of an entry without where it is from."""
    return _COPY.sub("", _FROM_PRESET.sub("", text)).strip('"')


def _can_be_scaled(value: str) -> bool:
    return _scaled(value, 2.0) not in (None, _scaled(value, 1.0))


def _is_numeric(scene: Scene, key: str) -> bool:
    """Tell whether an entry is a number or a row of them, and not a name such as "600 shore"."""
    node: Any = scene
    for part in key.split("."):
        if isinstance(node, tuple):
            names = [getattr(entry, "name", str(number)) for number, entry in enumerate(node)]
            node = node[names.index(part)] if part in names else None
        elif isinstance(node, dict):
            node = node.get(part)
        else:
            node = getattr(node, part, None)
    numbers = node if isinstance(node, tuple) else (node,)
    return all(isinstance(n, int | float) and not isinstance(n, bool) for n in numbers)


def _scaled(value: str, factor: float) -> str | None:
    """Return a number or a row of numbers, with their unit, times a factor; None for any other.

    A row, such as the coefficients of a polynomial, is scaled as a whole.
    """
    match = _NUMBERS.fullmatch(value)
    if match is None:
        return None
    each = [f"{factor * float(number):.9g}" for number in re.split(r"[\s,]+", match[1])]
    numbers, unit = " ".join(each), match[2] or match[3]
    if unit:
        return f'"{numbers} {unit}"'
    return numbers if len(each) == 1 else f'"{numbers}"'


def run_sensitivity(
    text: Source,
    folder: Path,
    keys: Sequence[str] = (),
    *,
    part: float = PART,
    workers: Workers | None = None,
    progress: Progress | None = None,
) -> Sensitivity:
    """Vary inputs of a scene one at a time.

    Parameters
    ----------
    keys : scene entries with numbers; by default those of the material and the friction.
    part : by which each is lowered and raised, between 0 and 1.

    Raises
    ------
    InputError : an entry that has no number or is zero, a part outside 0 to 1, or no inputs that
        the scene lets be changed.
    SimulationInterrupted : Ctrl-C; the same call goes on from what is there.
    """
    if not 0.0 < part < 1.0:
        raise InputError(f"must lie between 0 and 1, is {part:g}", key="--part")
    scene = text.scene()
    values = {key: _value_of(scene, key) for key in keys} if keys else default_inputs(scene)
    if not values:
        raise InputError("the scene has no numbers to vary; name entries", key="--vary")
    base = Variant("as it is", "sensitivity")
    changed, refused = allowed_changes(text, values, part)
    values = {key: value for key, value in values.items() if changed[key]}
    if not values:
        raise InputError(f"no input can be changed; {'; '.join(refused)}", key="--vary")
    variants = [base, *(variant for key in values for variant in changed[key].values())]
    outcomes = Study(text, folder, workers).outcomes(variants, progress)
    if outcomes[base.name].failure:
        raise InputError(f"the scene itself fails: {outcomes[base.name].failure}")
    results = {name: results_of(outcome) for name, outcome in outcomes.items()}

    def result(key: str, side: str, name: str) -> float:
        return results[changed[key][side].name][name] if side in changed[key] else math.nan

    failed = (f"{n}: no result, {o.failure}" for n, o in outcomes.items() if o.failure)
    return Sensitivity(
        scene.title,
        part,
        values,
        tuple(
            _dependence(key, r.name, part, results[base.name][r.name],
                        *(result(key, side, r.name) for side in SIDES))
            for key in values for r in RESULTS
        ),
        (*refused, *failed),
    )  # fmt: skip


def allowed_changes(
    text: Source, values: Mapping[str, str], part: float
) -> tuple[dict[str, dict[str, Variant]], list[str]]:
    """Return the variants of each input by side that the scene allows, and what it refuses.

    A Poisson's ratio of 0.47 cannot be raised by a tenth; it is lowered alone.
    """
    changed: dict[str, dict[str, Variant]] = {key: {} for key in values}
    told = []
    for key, value in values.items():
        reasons = {}
        for side, sign in SIDES.items():
            override = f"{key}={_scaled(value, 1.0 + sign * part)}"
            variant = Variant(f"{key} {side}", "sensitivity", (override,))
            try:
                text.job(variant)
            except InputError as error:
                reasons[side] = str(error)
            else:
                changed[key][side] = variant
        if reasons:
            done = f"changed to one side alone, not {next(iter(reasons))}"
            done = done if changed[key] else "left out"
            told.append(f"{key} = {value}: {done}: {next(iter(reasons.values()))}")
    return changed, told


def _value_of(scene: Scene, key: str) -> str:
    """Return the value of an entry as text.

    Raises
    ------
    InputError : the scene has no such entry, it is no single number, or zero.
    """
    known = dict((*scene.source.given, *scene.source.defaulted))
    if key not in known:
        raise InputError(f'the scene has no entry "{key}" with a value', key="--vary")
    value = _plain(known[key])
    if not _is_numeric(scene, key) or not _can_be_scaled(value):
        raise InputError(f"{key} is {value}, which is no number other than zero", key="--vary")
    return value


def _dependence(
    key: str, result: str, part: float, middle: float, low: float, high: float
) -> Dependence:
    if (
        not math.isfinite(middle)
        or middle == 0.0
        or not (math.isfinite(low) or math.isfinite(high))
    ):
        return Dependence(key, result, math.nan, math.nan)
    if not (math.isfinite(low) and math.isfinite(high)):
        change = high - middle if math.isfinite(high) else middle - low
        return Dependence(key, result, change / middle / part, math.nan)
    elasticity = (high - low) / middle / (2.0 * part)
    bend = abs(high - 2.0 * middle + low)
    first = 0.5 * abs(high - low)
    return Dependence(key, result, elasticity, bend / first if first > 0.0 else 0.0)


def sensitivity_table(sensitivity: Sensitivity) -> Table:
    """Return a table for the terminal: what 1 % more of an input changes of each result."""
    shown = [r for r in RESULTS if sensitivity.of(r.name)]
    table = plain_table(
        f"Elasticities: {sensitivity.title}",
        "input", *(result.short for result in shown),
        caption="percent that a result changes by when the input grows by one percent; ~ bends by "
        "more than half\nof that between the two runs",
    )  # fmt: skip
    by_pair = {(d.key, d.result): d for d in sensitivity.dependences}
    strength = {
        key: max(
            (abs(by_pair[key, r.name].elasticity) for r in shown
             if math.isfinite(by_pair[key, r.name].elasticity)), default=0.0,
        )
        for key in sensitivity.value
    }  # fmt: skip
    for key in sorted(sensitivity.value, key=lambda k: -strength[k]):
        table.add_row(_last_two(key), *(_cell(by_pair[key, r.name]) for r in shown))
    return table


def _last_two(key: str) -> str:
    return ".".join(key.split(".")[-2:])


def _cell(dependence: Dependence) -> str:
    if math.isnan(dependence.elasticity):
        return "-"
    if abs(dependence.elasticity) < LEAST_SHOWN:
        return ""
    return f"{dependence.elasticity:+.2f}{'~' if dependence.bend > 0.5 else ''}"


def write_sensitivity(path: Path, sensitivity: Sensitivity) -> None:
    """Write a row per input and result."""
    with replacing(path) as temporary, open(temporary, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["input", "value", "result", "elasticity", "bend"])
        for d in sensitivity.dependences:
            writer.writerow(
                [d.key, sensitivity.value[d.key], d.result, f"{d.elasticity:.6g}", f"{d.bend:.3g}"]
            )
