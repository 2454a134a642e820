"""The same elastic plate by other programs, in one run: what ``lcmchain bench --peers`` prints.

::

    plate ─┬▶ calculix: C3D8R ──────────────────────────────┬─▶ comparison: ratios of one run
           └▶ kratos ─▶ kratos_run: in a process of its own ┘
"""

from lcmchain.bench.peers.comparison import run_peer_bench

__all__ = ["run_peer_bench"]
