"""Does an effect that a scene does not call for cost anything? Against sources without its code.

    python examples/without_code/compare.py [--turns N]

A free plate of 4,000 elements has no tools, supports, pressures or pores, and its fibres do not
resist bending in the plane. Its steps are timed with the package as it is and with a copy of the
sources in which the code of all that it does not have is deleted from the time loop, the contact
and the element kernel. Both take turns, each run in a process of its own; medians of the
processor time per element and step, the arrays of the solver, and the largest memory of the
process are compared, and whether both give the same bits.
"""

from __future__ import annotations

import argparse
import ast
import hashlib
import importlib.util
import json
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

# Arguments that are None in the plate's scene.
ABSENT = {
    "fibre_bending", "pore", "face_pressure", "supports", "pressed", "free", "averaging", "tools",
    "director", "curved", "general", "enhanced", "reference_bending",
}  # fmt: skip
SOURCES = (
    "solver/loop.py", "solver/contact_forces.py", "elements/solid_shell/kernel.py",
)  # fmt: skip
OUTER = ("mapping", "coupling", "fmu")
SCENE_OVERRIDES = ("material.bending.in_plane=0.0",)
STEPS = 2_000
REPETITIONS = 7


class WithoutAbsent(ast.NodeTransformer):
    """Takes out what is done only where something absent is there, and counts the places."""

    def __init__(self) -> None:
        self.places = 0

    @staticmethod
    def _is_absent(test: ast.expr) -> bool:
        return (
            isinstance(test, ast.Compare)
            and isinstance(test.ops[0], ast.IsNot)
            and ast.unparse(test.comparators[0]) == "None"
            and ast.unparse(test.left).rpartition(".")[2] in ABSENT
        )

    def visit_If(self, node: ast.If) -> ast.AST | list[ast.stmt]:
        self.generic_visit(node)
        if not self._is_absent(node.test):
            return node
        self.places += 1
        return node.orelse or ast.Pass()


def strip(root: Path) -> int:
    """Delete the code in a copy of the package; return in how many places."""
    places = 0
    for name in SOURCES:
        file, transformer = root / "lcmchain" / name, WithoutAbsent()
        tree = transformer.visit(ast.parse(file.read_text(encoding="utf-8")))
        file.write_text(ast.unparse(ast.fix_missing_locations(tree)), encoding="utf-8")
        places += transformer.places
    return places


def copy_package(root: Path) -> Path:
    """Copy the package as it is installed into ``root``, with the folders beside it inside."""
    ignore = shutil.ignore_patterns("__pycache__")
    for name in ("lcmchain", *(f"lcmchain.{outer}" for outer in OUTER)):
        spec = importlib.util.find_spec(name)
        assert spec is not None and spec.submodule_search_locations
        source = Path(next(iter(spec.submodule_search_locations)))
        shutil.copytree(source, root.joinpath(*name.split(".")), ignore=ignore, dirs_exist_ok=True)
    return root


def measure() -> dict:
    """Time the plate in this process."""
    import resource

    from lcmchain.bench.sizes import free_plate
    from lcmchain.compilation.threads import use_threads

    use_threads(1)
    plate = free_plate(4_000, *SCENE_OVERRIDES)
    model = plate.model
    assert model.fibre_bending is None and model.nodes.free is None and not model.tool_names
    step, start, samples = plate.prepare_steps(), plate.state.copy(), []
    for turn in range(REPETITIONS + 1):
        plate.restore(start)
        begin = time.process_time()
        plate.make_steps(STEPS, step)
        if turn > 0:  # the first one compiles
            samples.append(time.process_time() - begin)
    arrays = {**plate.model.nodes._asdict(), **plate.state.as_dict()}
    return {
        "ns": 1e9 * statistics.median(samples) / (STEPS * plate.model.element_count),
        "arrays": sum(getattr(array, "nbytes", 0) for array in arrays.values()),
        "memory": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss,
        "position": hashlib.blake2b(plate.state.position.tobytes()).hexdigest(),
    }


def measured(root: Path) -> dict:
    """Time the plate with the sources in a folder, in a process of its own."""
    environment = {**os.environ, "PYTHONPATH": str(root), "NUMBA_CACHE_DIR": str(root / "cache")}
    command = [sys.executable, __file__, "--measure"]
    done = subprocess.run(command, env=environment, stdout=subprocess.PIPE, check=True)
    return json.loads(done.stdout)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--turns", type=int, default=7)
    parser.add_argument("--measure", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.measure:
        print(json.dumps(measure()))
        return
    with tempfile.TemporaryDirectory(prefix="lcmchain-without-") as folder:
        whole = copy_package(Path(folder, "whole"))
        without = copy_package(Path(folder, "without"))
        print(f"deleted in {strip(without)} places; both are compiled first")
        found: dict[str, list[dict]] = {"whole": [], "without": []}
        for turn in range(arguments.turns + 1):
            for name, root in (("whole", whole), ("without", without)):
                result = measured(root)
                if turn > 0:  # the first one has compiled
                    found[name].append(result)
    for name, results in found.items():
        ns, memory = (statistics.median(r[key] for r in results) for key in ("ns", "memory"))
        print(
            f"{name:8} {ns:7.2f} ns, arrays {results[0]['arrays']}, process {memory / 1024:.1f} MiB"
        )
    ratios = [w["ns"] / o["ns"] for w, o in zip(found["whole"], found["without"], strict=True)]
    memory = [statistics.median(r["memory"] for r in results) for results in found.values()]
    same = len({r["position"] for results in found.values() for r in results}) == 1
    print(
        f"time {statistics.median(ratios):.4f}, memory {memory[0] / memory[1]:.4f} of that without"
    )
    print("same bits" if same else "OTHER BITS")


if __name__ == "__main__":
    main()
