"""The wheel holds every package, works outside the checkout, and imports run in one direction."""

import ast
import importlib
import os
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

from lcmchain import __version__

ROOT = Path(__file__).resolve().parents[2]
OUTER = ("mapping", "coupling", "fmu")

pytestmark = pytest.mark.skipif(
    not (ROOT / "pyproject.toml").is_file(), reason="needs the checkout, not only the tests"
)

# Rank of every core module: it may import modules of its own or a lower rank. A new module must
# be placed here.
RANK_OF_CORE = {
    "": 0,  # lcmchain/__init__.py
    "compilation": 0,
    "errors": 0,
    "atomic": 0,
    "text_files": 0,
    "jit": 0,
    "packs": 0,
    "dispatch": 0,
    "thresholds": 0,
    "quantities": 1,
    "mesh": 2,
    "mesh_files": 2,
    "elements": 3,
    "materials": 3,
    "effects": 3,
    "interfaces": 3,
    "tools": 3,
    "results": 4,
    "scene": 4,
    "model": 4,
    "stages": 4,
    "state": 4,
    "provenance": 4,
    "solver": 4,
    "statics": 4,
    "fields": 5,
    "judgements": 6,
    "draping": 6,
    "report": 6,
    "pattern": 7,
    "coupons": 7,
    "identification": 7,
    "verification": 7,
    "study": 7,
    "check": 7,
    "bench": 7,
    "forming_run": 7,
    "summary": 7,
    "pipeline": 7,
    "manual": 7,
    "__main__": 8,
    "commands": 8,
    "cli": 8,
}
# Each may import the core and what stands before it, but not what stands after it.
OUTER_RANK = {"mapping": 1, "coupling": 2, "fmu": 3}
# The only core modules that may import mapping, coupling or fmu, and only inside functions.
CHAIN_MODULES = {"pipeline", "cli", "commands", "study"}
# Packages whose files are one kind of thing, a file each: their pages need not list them.
A_FILE_EACH = {"lcmchain.effects.sheet", "lcmchain.interfaces.laws"}
# What the page of a package names: words as code, files, what an arrow of its drawing leads to
# ("▶ geometry, kernel: ..."), and names with an underscore anywhere.
NAMED_ON_PAGE = re.compile(
    r"``([a-z]\w*)``|\b([a-z]\w*)\.py\b|[▶├└]─? ?([a-z]\w*(?:, [a-z]\w*)*):"
    r"|(?<![\w.`:/])([a-z]\w*_\w+)\b(?![.(])"
)
DEFINED = re.compile(r"^\s*(?:def|class) (\w+)|^\s*(\w+)(?: =|:)", re.M)


def source_files():
    """Every source file and the dotted name it is imported by."""
    for folder in ("lcmchain", *OUTER):
        prefix = ("lcmchain",) if folder == "lcmchain" else ("lcmchain", folder)
        for file in sorted((ROOT / folder).rglob("*.py")):
            parts = file.relative_to(ROOT / folder).with_suffix("").parts
            name = ".".join((*prefix, *parts))
            yield file, name.removesuffix(".__init__")


def imports_of(file: Path, name: str):
    """(imported module, line, True if it does not run with the file) of all imports of lcmchain."""
    package = name if file.name == "__init__.py" else name.rpartition(".")[0]
    tree = ast.parse(file.read_text(encoding="utf-8"))
    inside = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
            inside.update(id(child) for child in ast.walk(node) if child is not node)
        elif isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            # for annotations alone: it never runs
            inside.update(id(child) for child in ast.walk(node))
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            targets = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                parents = package.split(".")[: len(package.split(".")) - node.level + 1]
                base = ".".join([*parents, *([base] if base else [])])
            # `from lcmchain import solver` imports a module, `from lcmchain.solver import run` a
            # name; with both levels in the list the room is found either way.
            targets = [f"{base}.{alias.name}" for alias in node.names]
        else:
            continue
        for target in targets:
            if target.split(".")[0] in ("lcmchain", *OUTER):
                yield target, node.lineno, id(node) in inside


@cache
def room_of(module: str) -> str:
    """First level below lcmchain; empty for names that lcmchain itself offers."""
    parts = module.split(".")
    room = parts[1] if len(parts) > 1 else ""
    known = room in OUTER or (ROOT / "lcmchain" / room).is_dir() and room
    return room if known or (ROOT / "lcmchain" / f"{room}.py").is_file() else ""


@cache
def all_imports() -> tuple[tuple[str, str, bool, str], ...]:
    """(room, imported module, True if it does not run with the module, place) of every import."""
    return tuple(
        (room_of(name), target, is_inside, f"{file.relative_to(ROOT)}:{line} imports {target}")
        for file, name in source_files()
        for target, line, is_inside in imports_of(file, name)
    )


def test_every_package_folder_is_listed_for_the_wheel():
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    found = {name for file, name in source_files() if file.name == "__init__.py"}
    assert sorted(settings["tool"]["setuptools"]["packages"]) == sorted(found)


def test_every_source_file_lies_in_a_package():
    lost = [str(file) for file, _ in source_files() if not (file.parent / "__init__.py").is_file()]
    assert lost == []


def pages():
    """Every package, its page (the docstring of its ``__init__.py``), and its folder."""
    for file, name in source_files():
        if file.name == "__init__.py":
            tree = ast.parse(file.read_text(encoding="utf-8"))
            yield name, ast.get_docstring(tree) or "", file.parent


def test_the_page_of_a_package_names_what_exists():
    """Files of the package and of those around it, and names in its own files."""
    modules = {name for _, name in source_files()}
    wrong = []
    for package, page, folder in pages():
        around = {package.rsplit(".", depth)[0] for depth in range(package.count(".") + 1)}
        known = {module.rpartition(".")[2] for module in modules
                 if module in around or module.rpartition(".")[0] in around}  # fmt: skip
        for file in folder.glob("*.py"):
            found = DEFINED.findall(file.read_text(encoding="utf-8"))
            known |= {word for both in found for word in both}
        named = {word for found in NAMED_ON_PAGE.findall(page) for part in found if part
                 for word in part.split(", ")}  # fmt: skip
        wrong += [f"{package}: {word}" for word in sorted(named - known)]
        stated = set(re.findall(r":mod:`~?([\w.]+)`", page))
        wrong += [f"{package}: {word}" for word in sorted(stated - modules)]
    assert wrong == []


def test_the_page_of_a_package_names_all_its_files():
    modules = {name for _, name in source_files()}
    wrong = []
    for package, page, _ in pages():
        own = {module.rpartition(".")[2] for module in modules
               if module.rpartition(".")[0] == package} - {"__main__"}  # fmt: skip
        if package not in A_FILE_EACH:
            wrong += [f"{package}: {name}" for name in own if not re.search(rf"\b{name}\b", page)]
    assert sorted(wrong) == []


def test_every_core_module_has_a_rank():
    rooms = {room_of(name) for _, name in source_files()} - set(OUTER)
    assert rooms - set(RANK_OF_CORE) == set(), "place these in RANK_OF_CORE"


def test_packages_are_imported_through_lcmchain_only():
    bare = [place for _, target, _, place in all_imports() if target.split(".")[0] in OUTER]
    assert bare == []


def test_every_import_finds_what_it_names():
    """Also those inside functions, which importing the module does not try."""
    lost = []
    for _, target, _, place in all_imports():
        module, _, name = target.rpartition(".")
        try:
            if not module or not hasattr(importlib.import_module(module), name):
                importlib.import_module(target)
        except ImportError:
            lost.append(place)
    assert lost == []


def test_core_modules_import_downwards_only():
    wrong = []
    for room, target, _, place in all_imports():
        other = room_of(target)
        if room not in OUTER and other not in OUTER and other != room:
            if RANK_OF_CORE.get(other, 0) > RANK_OF_CORE.get(room, 99):
                wrong.append(place)
    assert wrong == []


def test_core_rooms_do_not_depend_on_each_other_in_circles():
    needs: dict[str, set[str]] = {}
    for room, target, _, _ in all_imports():
        other = room_of(target)
        if other and room and other != room:
            needs.setdefault(room, set()).add(other)
    # The chain is called by the pipeline and built on the core, both as intended.
    needs = {room: set() if room in CHAIN_MODULES else others for room, others in needs.items()}
    try:
        TopologicalSorter(needs).prepare()
    except CycleError as error:
        pytest.fail(f"rooms import each other in a circle: {' <- '.join(error.args[1])}")


def test_core_reaches_the_chain_from_functions_of_pipeline_studies_and_commands_only():
    wrong = []
    for room, target, is_inside, place in all_imports():
        if room not in OUTER and room_of(target) in OUTER:
            if room not in CHAIN_MODULES or not is_inside:
                wrong.append(place)
    assert wrong == []


def test_the_chain_imports_downwards_only():
    wrong = []
    for room, target, _, place in all_imports():
        if room in OUTER and OUTER_RANK.get(room_of(target), 0) > OUTER_RANK[room]:
            wrong.append(place)
    assert wrong == []


def run_python(code: str, **environment: str) -> str:
    done = subprocess.run(
        [sys.executable, "-P", "-c", code],
        env={**os.environ, **environment},
        cwd=os.path.abspath(os.sep),
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_import_is_light():
    heavy = "('numba', 'numpy', 'scipy', 'pydantic', 'xarray', 'matplotlib')"
    loaded = run_python(
        f"import sys, lcmchain; print([name for name in {heavy} if name in sys.modules])"
    )
    assert loaded.strip() == "[]"


def test_the_package_runs_as_its_command():
    code = "import runpy, sys; sys.argv = ['x', '--version']; "
    told = run_python(f"{code} runpy.run_module('lcmchain', run_name='__main__')")
    assert __version__ in told


def test_wheel_works_outside_the_checkout(tmp_path):
    pytest.importorskip("setuptools", minversion="77")
    # From a copy: a build folder left in the checkout would leak deleted files into the wheel.
    copy = tmp_path / "copy"
    copy.mkdir()
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, copy)
    for name in ("lcmchain", *OUTER):
        shutil.copytree(ROOT / name, copy / name, ignore=shutil.ignore_patterns("__pycache__"))
    options = ["--no-deps", "--no-build-isolation", "--no-index", "--quiet"]
    built = subprocess.run(
        [sys.executable, "-m", "pip", "wheel", *options, "--wheel-dir", str(tmp_path), str(copy)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert built.returncode == 0, built.stdout + built.stderr
    (wheel,) = tmp_path.glob("*.whl")
    site = tmp_path / "site"
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(site)
    # one wheel for all systems: nothing in it is compiled for the one that built it
    assert wheel.name.endswith("-py3-none-any.whl")
    (about,) = site.glob("*.dist-info/WHEEL")
    assert "Root-Is-Purelib: true" in about.read_text(encoding="utf-8")

    modules = {name for _, name in source_files()}
    packed = {
        ".".join(file.relative_to(site).with_suffix("").parts).removesuffix(".__init__")
        for file in (site / "lcmchain").rglob("*.py")
    }
    assert packed == modules
    manual = ROOT / "lcmchain" / "manual"
    pages = {
        file.relative_to(manual).as_posix()
        for file in manual.rglob("*")
        if file.is_file() and "__pycache__" not in file.parts
    }
    packed_manual = site / "lcmchain" / "manual"
    assert {
        file.relative_to(packed_manual).as_posix()
        for file in packed_manual.rglob("*")
        if file.is_file()
    } == pages
    assert any(page.endswith(".png") for page in pages)
    packed_report = {file.name for file in (site / "lcmchain" / "report" / "assets").iterdir()}
    assert packed_report == {"report.html", "report.css", "report.js"}
    assert (site / "lcmchain" / "CITATION.cff").is_file()

    code = f"""
import importlib, pathlib
for name in {sorted(modules - {"lcmchain.__main__"})!r}:
    file = pathlib.Path(importlib.import_module(name).__file__)
    assert file.is_relative_to({str(site)!r}), file
import lcmchain
assert all(getattr(lcmchain, name) is not None for name in lcmchain.__all__)
import lcmchain.cli
assert callable(lcmchain.cli.main)
"""
    run_python(
        code, PYTHONPATH=str(site), XDG_CACHE_HOME=str(tmp_path / "cache"), NUMBA_CACHE_DIR=""
    )
