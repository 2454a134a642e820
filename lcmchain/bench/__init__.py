"""Speed of the solver on this machine: what ``lcmchain bench`` prints."""

from lcmchain.bench.tables import (
    run_bench,
    run_effect_bench,
    run_law_bench,
    run_part_bench,
    run_size_bench,
    run_stack_bench,
)

__all__ = [
    "run_bench",
    "run_effect_bench",
    "run_law_bench",
    "run_part_bench",
    "run_size_bench",
    "run_stack_bench",
]
