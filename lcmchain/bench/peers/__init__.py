"""The same elastic plate by other programs, in one run: what ``lcmchain bench --peers`` prints."""

from lcmchain.bench.peers.comparison import run_peer_bench

__all__ = ["run_peer_bench"]
