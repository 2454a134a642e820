"""What a scene will simulate and why, what it costs, and whether it can start.

::

    Scene ─▶ large_mesh: the scene itself, or a coarser one in place of a very large mesh
               │
               ├─▶ tools_at_start: gaps and overlaps      ├─▶ effect_cost: which, why, how dear
               ├─▶ tool_strokes: ways of the tools        ├─▶ expected_cost: steps, time, memory
               ├─▶ judgements: is there time enough       └─▶ remarks: allowed, but hardly meant
               ▼
             report: CheckReport ─▶ tables ─▶ terminal
"""

import lazy_loader

# The names are those of the stub beside this file; each is imported when it is first asked for.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
