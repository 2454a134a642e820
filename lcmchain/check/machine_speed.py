"""Computing time per element and step on this machine, as the fastest of the last runs was.

A small file in the user's cache folder, beside the compiled kernels, keeps the figures by
processor, threads, kind of element and size of the mesh. Runs of many steps add theirs at the end.
"""

from __future__ import annotations

import hashlib
import json
import math
from pathlib import Path
from typing import NamedTuple

from platformdirs import user_cache_path

from lcmchain.atomic import replacing
from lcmchain.compilation.cache import processor
from lcmchain.compilation.threads import worthwhile_threads
from lcmchain.errors import InputError, OutputError
from lcmchain.model import Model

#: Time per element and step that is assumed without a measurement, on one core.
ASSUMED = {"solid-shell": 0.09e-6, "partly curved solid-shell": 0.10e-6,
           "curved solid-shell": 0.14e-6, "membrane-shell": 0.05e-6,
           "membrane": 0.03e-6}  # fmt: skip
#: The same per node of plies that touch each other, of which about half do.
ASSUMED_BETWEEN_PLIES = 0.09e-6
# Part of a step that further threads share: two of them make it 1.6 times faster.
SHARED = 0.76
# Runs of fewer steps than this say little.
FEWEST_STEPS = 2000
# Of so many last runs the fastest counts: other work on the machine only ever adds to the time.
KEPT = 5
FILE = "speed.json"


class Speed(NamedTuple):
    """Computing time per element and step [s], and where it is known from, in words."""

    seconds_per_element_step: float
    source: str


def machine_speed(model: Model) -> Speed:
    """Return the time that the last runs of such a model took here, else what is assumed."""
    threads = worthwhile_threads(model.element_count)
    measured = kept_numbers(FILE).get(speed_key(model, threads))
    if measured:
        threads_used = f"{threads} thread{'s' if threads > 1 else ''}"
        return Speed(min(measured), f"as the fastest of the last runs here with {threads_used}")
    per_step = sum(body.mesh.element_count * ASSUMED[body.kernel] for body in model.bodies)
    if model.ply_contact is not None:
        per_step += model.node_count * ASSUMED_BETWEEN_PLIES
    per_step *= 1.0 - SHARED + SHARED / threads
    return Speed(per_step / model.element_count, "assumed")


def record_speed(model: Model, threads: int, step_count: int, wall_s: float) -> None:
    """Keep the time of a run for later estimates."""
    if step_count < FEWEST_STEPS:
        return
    time = wall_s / (step_count * model.element_count)
    keep_numbers(FILE, kept_numbers(FILE), speed_key(model, threads), time)


def keep_numbers(file: str, kept: dict[str, list[float]], key: str, value: float) -> None:
    """Add a value to the last ones under a key, and write all that is kept to a file."""
    kept[key] = [*kept.get(key, []), value][-KEPT:]
    try:
        with replacing(_path(file)) as temporary:
            temporary.write_text(json.dumps(kept, indent=1), encoding="utf-8")
    except (InputError, OutputError):
        pass  # a cache folder that cannot be written leaves the estimate as it is


def _path(file: str) -> Path:
    return user_cache_path("lcmchain", appauthor=False, opinion=False) / file


def speed_key(model: Model, threads: int) -> str:
    """Name of a machine, threads, kernels and size; sizes within a factor of two are one."""
    machine = hashlib.blake2b(processor().encode(), digest_size=6).hexdigest()
    kernels = ", ".join(sorted({body.kernel for body in model.bodies}))
    if model.ply_contact is not None:
        kernels += " in contact"
    size = 4 ** round(math.log(model.element_count, 4))
    return f"{machine}, {threads} threads, {kernels}, about {size} elements"


def kept_numbers(file: str) -> dict[str, list[float]]:
    """Return all that a file keeps; nothing where it is absent or not ours to read."""
    try:
        kept = json.loads(_path(file).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    if not isinstance(kept, dict):
        return {}
    return {key: values for key, values in kept.items() if _are_times(values)}


def _are_times(values: object) -> bool:
    return isinstance(values, list) and all(
        isinstance(value, float) and 0.0 < value < 1.0 for value in values
    )
