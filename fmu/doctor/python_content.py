"""Units whose model is Python: what their modules import, and what they ask to be installed.

pythonfmu and pythonfmu3 put the name of the model's module into ``resources/slavemodule.txt``, the
module beside it, and a copy of their own package.
"""

from __future__ import annotations

import ast
import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

#: Files in which a unit of pythonfmu lists its packages (``pythonfmu deploy`` reads them).
REQUIREMENTS = "requirements.txt"
ENVIRONMENTS = ("environment.yaml", "environment.yml")
#: File in which a unit of lcmchain says what it holds.
UNIT_FILE = "unit.json"


@dataclass(frozen=True)
class PythonContent:
    """What the Python in a unit needs.

    Parameters
    ----------
    module : name of the model's module.
    needed : modules from outside the unit, without which its module cannot be loaded.
    used : further modules that a function or an optional branch imports.
    requirements : lines of ``requirements.txt``.
    environment : name of a conda file with packages, empty without one.
    unreadable : module files that are no Python of this version, with the reason.
    lcmchain_version : with which a unit of ours was built, else None.
    """

    module: str
    needed: tuple[str, ...]
    used: tuple[str, ...]
    requirements: tuple[str, ...]
    environment: str
    unreadable: dict[str, str]
    lcmchain_version: str | None


def python_content(resources: Path) -> PythonContent | None:
    """Read what the Python of an unpacked unit needs; None where its model is no Python."""
    names = resources / "slavemodule.txt"
    if not names.is_file():
        return None
    module = names.read_text(encoding="utf-8", errors="replace").strip()
    needed, used, unreadable = _imports(resources, module)
    requirements: list[str] = []
    if (resources / REQUIREMENTS).is_file():
        text = (resources / REQUIREMENTS).read_text(encoding="utf-8", errors="replace")
        lines = [line.partition("#")[0].strip() for line in text.splitlines()]
        requirements = [line for line in lines if line and not line.startswith("-")]
    environment = next((name for name in ENVIRONMENTS if (resources / name).is_file()), "")
    return PythonContent(
        module=module,
        needed=tuple(sorted(needed)),
        used=tuple(sorted(used - needed)),
        requirements=tuple(requirements),
        environment=environment,
        unreadable=unreadable,
        lcmchain_version=_lcmchain_version(resources / UNIT_FILE),
    )


def _lcmchain_version(path: Path) -> str | None:
    try:
        unit = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    version = unit.get("lcmchain_version") if isinstance(unit, dict) else None
    return version if isinstance(version, str) else None


def _imports(resources: Path, module: str) -> tuple[set[str], set[str], dict[str, str]]:
    """Follow the imports of a module through the unit to those that leave it."""
    needed: set[str] = set()
    used: set[str] = set()
    unreadable: dict[str, str] = {}
    waiting, seen = [(module, True)], set()
    while waiting:
        name, must = waiting.pop()
        files = _files(resources, name)
        if not files:
            (needed if must else used).add(name)
        for file in files:
            if (file, must) in seen:
                continue
            seen.add((file, must))
            try:
                tree = ast.parse(file.read_bytes())
            except (SyntaxError, ValueError) as error:
                unreadable[file.relative_to(resources).as_posix()] = str(error)
                continue
            waiting += [(other, must and sure) for other, sure in _imported(tree)]
    return needed, used, unreadable


def _files(resources: Path, name: str) -> list[Path]:
    """Return the files of a top-level module that lies in the unit."""
    if (resources / f"{name}.py").is_file():
        return [resources / f"{name}.py"]
    package = resources / name
    if not package.is_dir():
        return []
    if name.startswith("pythonfmu"):  # its builder and commands are not run with the unit
        return [package / "__init__.py"] if (package / "__init__.py").is_file() else []
    return sorted(package.rglob("*.py"))


def _imported(node: ast.AST, sure: bool = True) -> Iterator[tuple[str, bool]]:
    """Yield top-level modules, and whether loading the file cannot do without them."""
    if isinstance(node, ast.Import):
        yield from ((alias.name.partition(".")[0], sure) for alias in node.names)
    elif isinstance(node, ast.ImportFrom):
        if node.module and not node.level:
            yield node.module.partition(".")[0], sure
    elif isinstance(node, ast.Try):
        ends = all(isinstance(handler.body[-1], ast.Raise) for handler in node.handlers)
        for part in (*node.body, *node.orelse, *node.finalbody):
            yield from _imported(part, sure and ends)
        for handler in node.handlers:
            yield from _imported(handler, False)
    else:
        optional = (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda, ast.If)
        for child in ast.iter_child_nodes(node):
            yield from _imported(child, sure and not isinstance(node, optional))
