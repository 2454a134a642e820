"""The entry ``stages`` of what may be at work in some stages of a process alone."""

from __future__ import annotations

from typing import Annotated

from lcmchain.quantities.entry_types import AbsentMeans, Name, Row

#: Most stages of a process.
MOST_STAGES = 50

#: Names of stages, or None for all of them.
AtWork = Annotated[
    Annotated[
        tuple[Annotated[str, Name("draw")], ...],
        Row('["draw", "close"]', entries="names", units=False, minimum_count=1,
            maximum_count=MOST_STAGES),
    ]
    | None,
    AbsentMeans(""),
]  # fmt: skip

#: What the entry means.
AT_WORK = "The stages of [[stages]] in which it is at work; left out, all of them."


def share_a_stage(one: tuple[str, ...] | None, other: tuple[str, ...] | None) -> bool:
    """Tell whether two entries are at work in a stage together; None is at work in all."""
    return one is None or other is None or bool(set(one) & set(other))
