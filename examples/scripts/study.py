"""Study what friction does to the force of the punch.

Usage: python examples/scripts/study.py [FOLDER]
"""

from __future__ import annotations

import sys
from pathlib import Path

from lcmchain.study import read_source
from lcmchain.study.sweep import read_entry, run_sweep, write_sweep

SCENE = Path(__file__).with_name("dome.toml")


def main(folder: Path) -> None:
    """Run the dome with three coefficients of friction."""
    source = read_source(SCENE)
    runs = run_sweep(source, folder, [read_entry("contact.friction=0.05|0.15|0.25")])
    write_sweep(folder, "Friction", runs)
    forces = [run.results["punch_force"] for run in runs]
    for run, force in zip(runs, forces, strict=True):
        print(f"friction {run.entries['contact.friction']}: {force:.2f} N")
    assert not any(run.failure for run in runs)
    assert forces == sorted(forces)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "results/scripts/study"))
