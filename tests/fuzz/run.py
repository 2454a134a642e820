"""Fuzzer of everything that a user may give: scenes, overrides, coupon files, meshes,
infiltrations, checkpoints.

    python tests/fuzz/run.py --scenes 10000 --overrides 2000 --csvs 500 --meshes 600 \
        --fillings 1000 --checkpoints 200 --seed 0 --jobs 2 --out fuzz-failures

Every case is made from its kind, the seed and its number alone, so that one case can be made again:
`--only scenes:1234`. Prints a table; what failed lies in the folder of ``--out`` with its inputs.
Ends with 1 if anything failed.
"""

from __future__ import annotations

import argparse
import importlib
import json
import multiprocessing
import os
import queue
import random
import shutil
import sys
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path

#: Name on the command line -> module that makes the cases.
KINDS = {
    "scenes": "scenes",
    "overrides": "overrides",
    "csvs": "coupon_files",
    "meshes": "meshes",
    "fillings": "fillings",
    "checkpoints": "checkpoints",
}
#: A worker that says nothing for so long hangs in compiled code, where no timer reaches it [s].
SILENCE = 300.0
#: Cases that one worker does in a row; a new process then starts afresh.
BATCH = 50


class Fuzzer:
    """Makes and judges the cases of one kind in a folder of its own."""

    def __init__(self, kind: str, seed: int, folder: Path) -> None:
        self.kind, self.seed, self.folder = kind, seed, folder
        self.module = importlib.import_module(KINDS[kind])
        folder.mkdir(parents=True, exist_ok=True)
        if hasattr(self.module, "prepare"):
            self.module.prepare(folder)
        if hasattr(self.module, "sound_calls"):
            self._compile()

    def _compile(self) -> None:
        """Make calls that are right: what they compile is not to count for the first case."""
        from contract import WALL_LIMIT, Case, judge

        for arguments in self.module.sound_calls(self.folder):
            outcome = judge(Case(arguments, "a sound call"), limit=10.0 * WALL_LIMIT)
            if outcome.verdict.value != "valid":
                raise RuntimeError(f"{arguments} ends as {outcome}")
            shutil.rmtree(self.folder / "out", ignore_errors=True)

    def run(self, number: int, failures: Path | None = None):
        """Judge one case; return the case and its outcome, and keep the inputs of a failed one."""
        from contract import judge

        case = self.module.make(random.Random(f"{self.kind} {self.seed} {number}"), self.folder)
        outcome = judge(case)
        if outcome.failed and failures is not None:
            keep(failures / f"{self.kind}-{number}", case, outcome)
        shutil.rmtree(self.folder / "out", ignore_errors=True)
        return case, outcome


def keep(folder: Path, case, outcome) -> None:
    """Copy the inputs of a failed case, and write down what happened."""
    folder.mkdir(parents=True, exist_ok=True)
    for file in case.files:
        if file.is_file():
            shutil.copy(file, folder / file.name)
    lines = [outcome.verdict.value, case.what, " ".join(map(str, case.arguments)), outcome.detail]
    (folder / "what.txt").write_text("\n\n".join(lines), encoding="utf-8", errors="replace")


def work(tasks, results, done, seed: int, failures: Path) -> None:
    """Judge batches of cases until all are done."""
    from scenes import drawn_rarely

    from lcmchain.check import report

    report.draw_start = drawn_rarely(report.draw_start)
    folder = Path(tempfile.mkdtemp(prefix="lcmchain-fuzz-"))
    fuzzers: dict[str, Fuzzer] = {}
    try:
        while not done.is_set():
            try:
                kind, first, last = tasks.get(timeout=1.0)
            except queue.Empty:
                continue
            if kind not in fuzzers:
                fuzzers[kind] = Fuzzer(kind, seed, folder / kind)
            for number in range(first, last):
                results.put(("begin", os.getpid(), kind, number, "", "", 0.0))
                case, outcome = fuzzers[kind].run(number, failures)
                results.put(("end", os.getpid(), kind, number, outcome.verdict.value, case.what,
                             outcome.seconds))  # fmt: skip
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def batches(counts: dict[str, int]) -> Iterator[tuple[str, int, int]]:
    """Cut the cases of every kind into batches, the slow kinds first."""
    for kind in reversed(list(KINDS)):
        for first in range(0, counts.get(kind, 0), BATCH):
            yield kind, first, min(first + BATCH, counts[kind])


def fuzz(counts: dict[str, int], *, seed: int, jobs: int, failures: Path) -> dict[str, Counter]:
    """Judge all cases in several processes; a process that hangs or dies is replaced."""
    context = multiprocessing.get_context("spawn")
    tasks, results = context.Queue(), context.Queue()
    for batch in batches(counts):
        tasks.put(batch)
    done = context.Event()
    workers = {}

    def start() -> None:
        worker = context.Process(
            target=work, args=(tasks, results, done, seed, failures), daemon=True
        )
        worker.start()
        workers[worker.pid] = [worker, time.monotonic(), None]

    for _ in range(jobs):
        start()
    found: dict[str, Counter] = defaultdict(Counter)
    total, count = sum(counts.values()), 0
    while count < total and workers:
        for event in _events(results):
            state, pid, kind, number, verdict, what, seconds = event
            if pid in workers:
                workers[pid][1] = time.monotonic()
                workers[pid][2] = (kind, number) if state == "begin" else None
            if state == "end":
                count += 1
                found[kind][verdict] += 1
                if verdict not in ("valid", "refused"):
                    print(f"{kind}:{number} {verdict}: {what}"[:200], flush=True)
                if count % 500 == 0:
                    print(f"... {count} of {total}", flush=True)
        for pid, (worker, last, busy) in list(workers.items()):
            silent = busy is not None and time.monotonic() - last > SILENCE
            if worker.is_alive() and not silent:
                continue
            del workers[pid]
            worker.kill()
            if busy is not None:
                kind, number = busy
                count += 1
                found[kind]["hang" if silent else "traceback"] += 1
                print(f"{kind}:{number} {'hangs' if silent else 'ended the process'}", flush=True)
                # The rest of its batch.
                tasks.put((kind, number + 1, min((number // BATCH + 1) * BATCH, counts[kind])))
                start()
    done.set()
    return found


def _events(results):
    try:
        yield results.get(timeout=5.0)
        while True:
            yield results.get_nowait()
    except queue.Empty:
        return


def table(found: dict[str, Counter]) -> str:
    """Lay the verdicts out as a table."""
    columns = (
        "valid",
        "refused",
        "traceback",
        "hang",
        "bad message",
        "left behind",
        "silent error",
    )
    rows = [["kind", "cases", *columns]]
    rows += [
        [kind, str(sum(found[kind].values())), *(str(found[kind][column]) for column in columns)]
        for kind in KINDS
        if found[kind]
    ]
    return "\n".join("| " + " | ".join(cell.rjust(12) for cell in row) + " |" for row in rows)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    for kind in KINDS:
        parser.add_argument(f"--{kind}", type=int, default=0, metavar="N")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("fuzz-failures"), metavar="DIR")
    parser.add_argument(
        "--only", metavar="KIND:NUMBER", help="make and judge one case, and show it"
    )
    arguments = parser.parse_args()
    if arguments.only:
        kind, _, number = arguments.only.partition(":")
        with tempfile.TemporaryDirectory() as folder:
            case, outcome = Fuzzer(kind, arguments.seed, Path(folder)).run(
                int(number), arguments.out
            )
        print(case.what, " ".join(map(str, case.arguments)), outcome.verdict.value, outcome.detail,
              f"{outcome.seconds:.2f} s", sep="\n")  # fmt: skip
        return int(outcome.failed)
    counts = {kind: getattr(arguments, kind) for kind in KINDS}
    start = time.monotonic()
    found = fuzz(counts, seed=arguments.seed, jobs=arguments.jobs, failures=arguments.out)
    print(table(found))
    (arguments.out.parent / f"{arguments.out.name}.json").write_text(json.dumps(found, indent=2))
    print(f"seed {arguments.seed}, {time.monotonic() - start:.0f} s")
    failed = sum(n for counter in found.values() for v, n in counter.items()
                 if v not in ("valid", "refused"))  # fmt: skip
    return int(failed > 0 or sum(map(Counter.total, found.values())) < sum(counts.values()))


if __name__ == "__main__":
    sys.exit(main())
