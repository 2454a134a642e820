"""Speed of the solver on this machine: what ``lcmchain bench`` prints.

    hemisphere (kernel, whole steps) ─┬▶ parts: those of a step ◀── operations: counted in the code
    sizes: free plates                ├▶ laws: what a fabric may know
                                      └▶ stacks: plies on each other
          all of them, by measure: medians, and limits of a core ─▶ tables: terminal and JSON

``peers`` measures the same plate with other programs.
"""

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
