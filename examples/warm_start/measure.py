"""How long does `lcmchain run` take to its first step, with compiled kernels and without?

    python examples/warm_start/measure.py [SCENE] [--turns N] [--cold]

Every turn starts the command in a process of its own and ends it as soon as the first chunk of
steps has been made. The time is that from the start of the process. `--cold` compiles in a new
cache folder first, and says how long that took. Python keeps the byte code of the sources only
where PYTHONDONTWRITEBYTECODE is not set; it is ignored here.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

SCENE = Path(__file__).resolve().parents[1] / "hemisphere_holder" / "scene.toml"
STARTED = "LCMCHAIN_STARTED"

# The command line imports the same modules, only later.
UNTIL_FIRST_STEP = f"""
import gc, os, sys, time
import lcmchain.cli
gc.set_threshold(lcmchain.cli.OBJECTS_PER_COLLECTION)  # what main() begins with
from lcmchain.solver.simulation import Simulation

make_chunk = Simulation._make_chunk

def make_first_chunk(self, count, step):
    make_chunk(self, count, step)
    print(time.time() - float(os.environ["{STARTED}"]), flush=True)
    os._exit(0)

Simulation._make_chunk = make_first_chunk
lcmchain.cli.main(["run", sys.argv[1], "--out", sys.argv[2], "--quiet"])
"""


def time_to_first_step(scene: Path, environment: dict[str, str]) -> float:
    """Return the time from the start of a process to the end of its first chunk of steps [s]."""
    with tempfile.TemporaryDirectory() as folder:
        result = subprocess.run(
            [sys.executable, "-c", UNTIL_FIRST_STEP, str(scene.resolve()), "out"],
            cwd=folder,  # and not a checkout, whose folders Python would take for the package
            env={**environment, STARTED: repr(time.time())},
            stdout=subprocess.PIPE,
            encoding="utf-8",
            check=True,
        )
    return float(result.stdout.split()[-1])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("scene", nargs="?", type=Path, default=SCENE)
    parser.add_argument("--turns", type=int, default=9)
    parser.add_argument("--cold", action="store_true", help="time the first compilation too")
    arguments = parser.parse_args()
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    with tempfile.TemporaryDirectory() as cache:
        if arguments.cold:
            environment["NUMBA_CACHE_DIR"] = cache
        first = time_to_first_step(arguments.scene, environment)
        print(f"{'compiling' if arguments.cold else 'first'}: {first:.2f} s")
        times = [time_to_first_step(arguments.scene, environment) for _ in range(arguments.turns)]
    spread = f"{min(times):.2f} to {max(times):.2f} s"
    print(f"then {statistics.median(times):.2f} s (median of {len(times)}, {spread})")


if __name__ == "__main__":
    main()
