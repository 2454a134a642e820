"""Mutation study: breaks one line at a time and shows which test notices.

    python tests/mutation/run.py [--only NAME ...] [--jobs N] [--out TABLE.md]

The mutants are data (``mutants.toml``): a file, a text that occurs once in it, the text that takes
its place, what that breaks, and the tests that should notice. The package is copied to a temporary
folder, so that the checkout is never changed; every mutant is applied to the copy, its tests run
there, and the file is put back. With ``--only`` the rows of all others stay as they are in the
table. Ends with 1 if a mutant survives or a test fails without any.

A kernel on disk does not notice a change in another file that it inlines: a mutant of a file with
compiled functions gets a cache without the kernels of that file and of all files that import it,
directly or not; a file that asks a question imports those that answer it with ``implements``. All
other kernels are those of the unchanged package.
"""

from __future__ import annotations

import argparse
import ast
import os
import queue
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
MUTANTS = Path(__file__).with_name("mutants.toml")
# Folders of the checkout that are packages inside lcmchain once installed.
OUTER = ("mapping", "coupling", "fmu")
DECORATORS = r"njit|\w*entry|overload|vectorize|instruction|\w*(kernel|routine|equation|_part)"
COMPILED = re.compile(rf"^@({DECORATORS})\b", re.M)
HEAD = """# Mutation study

What each test is for, shown by breaking it: one line of the sources is changed at a time, and the
named tests must notice. Made by `python tests/mutation/run.py --out tests/mutation/table.md` (in
an hour or two on two cores); the mutants are data in `mutants.toml`.

"""
TIME_LIMIT = 900.0  # of the tests of one mutant [s]; an endless loop is noticed too


@dataclass(frozen=True)
class Mutant:
    """One change of one line, and the tests that should notice it."""

    name: str
    file: str
    old: str
    new: str
    breaks: str
    tests: tuple[str, ...]

    @property
    def is_compiled(self) -> bool:
        """Whether the file holds functions that kernels are made of."""
        return COMPILED.search((ROOT / self.file).read_text(encoding="utf-8")) is not None


def read_mutants(path: Path = MUTANTS) -> list[Mutant]:
    """Read the list of mutants."""
    entries = tomllib.loads(path.read_text(encoding="utf-8"))["mutant"]
    return [Mutant(**entry | {"tests": tuple(entry["tests"])}) for entry in entries]


def questions_answered(tree: ast.AST) -> set[str]:
    """Return the functions that a file answers with ``implements``, by their names."""
    return {
        call.args[0].id
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef)
        for call in node.decorator_list
        if isinstance(call, ast.Call)
        and isinstance(call.func, ast.Name)
        and call.func.id == "implements"
        and isinstance(call.args[0], ast.Name)
    }


class Copy:
    """The package as an installed wheel has it, and its tests, in a folder of their own."""

    def __init__(self, folder: Path):
        self.folder = folder
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / "lcmchain", folder / "lcmchain", ignore=ignored)
        for name in OUTER:
            shutil.copytree(ROOT / name, folder / "lcmchain" / name, ignore=ignored)
        for name in ("tests", "examples"):
            shutil.copytree(ROOT / name, folder / name, ignore=ignored)
        shutil.copy(ROOT / "pyproject.toml", folder)
        self.cache = folder / "kernels"

    def path_of(self, file: str) -> Path:
        inside = file.split("/")[0] in OUTER
        return self.folder / "lcmchain" / file if inside else self.folder / file

    def importers_of(self, path: Path) -> set[Path]:
        """Return a file of the package and all files that import it, directly or not.

        Tests too: some of them compile functions of their own.
        """
        found, size = {path}, 0
        while len(found) > size:
            size = len(found)
            found |= {file for file, imported in self.imports.items() if imported & found}
        return found

    @cached_property
    def imports(self) -> dict[Path, set[Path]]:
        """Files of the package that each of its files imports, and each of the tests."""
        folders = (self.folder / "lcmchain", self.folder / "tests")
        files = {file: set() for folder in folders for file in folder.rglob("*.py")}
        for file, imported in files.items():
            for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
                names = [node.module or ""] if isinstance(node, ast.ImportFrom) else ()
                names = [a.name for a in node.names] if isinstance(node, ast.Import) else names
                for name in names:
                    place = self.folder.joinpath(*name.split("."))
                    imported |= {place.with_suffix(".py"), place / "__init__.py"} & set(files)
        for file in files:
            tree = ast.parse(file.read_text(encoding="utf-8"))
            questions = questions_answered(tree)
            for node in ast.walk(tree):
                if isinstance(node, ast.ImportFrom) and questions & {a.name for a in node.names}:
                    place = self.folder.joinpath(*(node.module or "").split("."))
                    asking = {place.with_suffix(".py"), place / "__init__.py"} & set(files)
                    for other in asking:
                        files[other].add(file)
        return files

    def kernels_without(self, path: Path) -> Path:
        """Return a copy of the cache without what is made of a file."""
        cache = Path(tempfile.mkdtemp(dir=self.folder))
        if self.cache.is_dir():  # not before the first tests of this copy
            shutil.copytree(self.cache, cache, dirs_exist_ok=True)
        for file in self.importers_of(path):
            # numba keeps the kernels of folder/file.py in folder_HASH/file.NAME...
            for kernel in cache.glob(f"{file.parent.name}_*/{file.stem}.*"):
                kernel.unlink()
        return cache

    def run_tests(self, tests: tuple[str, ...], cache: Path) -> tuple[int | None, str]:
        """Return the exit code of pytest, None if it took too long, and what it printed."""
        environment = {
            **os.environ,
            "PYTHONPATH": str(self.folder),
            "NUMBA_CACHE_DIR": str(cache),
            "PYTHONDONTWRITEBYTECODE": "1",
        }
        command = [
            sys.executable,
            "-m",
            "pytest",
            "-x",
            "-q",
            "-p",
            "no:cacheprovider",
            "-n",
            "0",
            *tests,
        ]
        try:
            done = subprocess.run(
                command, cwd=self.folder, env=environment, capture_output=True, text=True,
                timeout=TIME_LIMIT,
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            return None, ""
        return done.returncode, done.stdout + done.stderr

    def try_mutant(self, mutant: Mutant) -> str:
        """Return the test that noticed the mutant, or what happened instead, in capitals."""
        path = self.path_of(mutant.file)
        text, status = path.read_text(encoding="utf-8"), path.stat()
        if text.count(mutant.old) != 1:
            return "TEXT NOT FOUND ONCE"
        cache = self.kernels_without(path) if mutant.is_compiled else self.cache
        path.write_text(text.replace(mutant.old, mutant.new), encoding="utf-8")
        try:
            code, printed = self.run_tests(mutant.tests, cache)
        finally:
            path.write_text(text, encoding="utf-8")
            os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))  # the kernels stay valid
            if mutant.is_compiled:
                shutil.rmtree(cache)
        if code is None:
            return "out of time"
        if code == 0:
            return "SURVIVED"
        # ERROR with the name of a test: in a fixture; without one: nothing could be collected
        failed = re.search(r"^(?:FAILED|ERROR) \S*?([^/\s]+\.py::\S+)", printed, re.M)
        if code != 1 or failed is None:
            return "NO TEST RAN: " + " ".join(printed.split()[-30:])
        return failed[1]


def table_of(results: list[tuple[Mutant, str]]) -> str:
    """Return the results as a Markdown table."""
    caught = sum(not outcome.split(":")[0].isupper() for _, outcome in results)
    lines = [
        f"{caught} of {len(results)} mutants are noticed.",
        "",
        "| mutant | file | what it breaks | noticed by |",
        "|---|---|---|---|",
    ]
    for mutant, outcome in results:
        shown = outcome.replace("|", "\\|")
        lines.append(f"| {mutant.name} | `{mutant.file}` | {mutant.breaks} | {shown} |")
    return "\n".join(lines) + "\n"


def kept_outcomes(table: Path) -> dict[str, str]:
    """Return what a table that was written before says of its mutants, by their names."""
    if not table.is_file():
        return {}
    lines = table.read_text(encoding="utf-8").splitlines()
    rows = [line.strip("| ").split(" | ") for line in lines if line.startswith("| ")]
    return {row[0]: row[3].replace("\\|", "|") for row in rows}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="+", metavar="NAME", help="names, or beginnings of names")
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="mutants at a time")
    parser.add_argument("--out", type=Path, metavar="TABLE.md", help="write the table here too")
    arguments = parser.parse_args()
    mutants = read_mutants()
    if arguments.only:
        mutants = [m for m in mutants if m.name.startswith(tuple(arguments.only))]
    if not mutants:
        parser.error("no mutant has such a name")

    with tempfile.TemporaryDirectory(prefix="lcmchain-mutants-") as name:
        copies: queue.Queue[Copy] = queue.Queue()
        for job in range(arguments.jobs):
            copies.put(Copy(Path(name) / str(job)))
        first = copies.get()
        tests = tuple(dict.fromkeys(test for mutant in mutants for test in mutant.tests))
        code, printed = first.run_tests(tests, first.cache)
        if code != 0:
            print(printed, "\nthe tests fail without any mutant", file=sys.stderr)
            return 1
        copies.put(first)

        def attempt(mutant: Mutant) -> tuple[Mutant, str]:
            copy = copies.get()
            try:
                outcome = copy.try_mutant(mutant)
            finally:
                copies.put(copy)
            print(f"{mutant.name}: {outcome}", file=sys.stderr, flush=True)
            return mutant, outcome

        with ThreadPoolExecutor(arguments.jobs) as pool:
            results = list(pool.map(attempt, mutants))
    table = table_of(results)
    print(table)
    if arguments.out is not None:
        found = kept_outcomes(arguments.out) | {m.name: outcome for m, outcome in results}
        everything = [(m, found.get(m.name, "NOT RUN")) for m in read_mutants()]
        arguments.out.write_text(HEAD + table_of(everything), encoding="utf-8")
    return int(any(outcome.split(":")[0].isupper() for _, outcome in results))


if __name__ == "__main__":
    sys.exit(main())
