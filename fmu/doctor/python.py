"""A unit written in Python: its content, the Python that will run it, and what it needs of it.

pythonfmu and pythonfmu3 put the name of the model's module into ``resources/slavemodule.txt``, the
module beside it, and a copy of their own package.
"""

from __future__ import annotations

import ast
import json
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from packaging.requirements import InvalidRequirement, Requirement

from lcmchain.errors import InputError, shortened
from lcmchain.fmu.doctor.binary import link, read_installed
from lcmchain.fmu.doctor.findings import Diagnosis, Finding, Level


def examine_python(
    diagnosis: Diagnosis, content: PythonContent | None, python: Path | str
) -> Interpreter:
    """Ask a Python whether it has what the modules of a unit import.

    Raises
    ------
    InputError : it cannot be started.
    """
    asked = _requirements(content)
    modules = () if content is None else (*content.needed, *content.used)
    names = [requirement.name for requirement in asked]
    if content is not None and content.lcmchain_version is not None:
        names.append("lcmchain")
    interpreter = ask_interpreter(python, modules, names)
    diagnosis.facts["python"] = {
        "version": interpreter.version,
        "executable": str(interpreter.executable),
        "prefix": str(interpreter.prefix),
        "library": None if interpreter.library is None else str(interpreter.library),
        "modules": interpreter.modules,
        "distributions": interpreter.distributions,
    }
    what = "its binary embeds Python"
    if content is not None and content.module_is_there:
        what = f"its module {content.module} runs in the Python of the host"
    diagnosis.add(
        Level.OK, "python",
        f"{what}; looked at: Python {interpreter.version} of {interpreter.prefix}",
    )  # fmt: skip
    if content is not None:
        diagnosis.extend(_module_findings(content, interpreter))
        diagnosis.extend(_requirement_findings(asked, content, interpreter))
        diagnosis.extend(_version_findings(content, interpreter))
    return interpreter


def examine_library(
    diagnosis: Diagnosis, python: Interpreter, symbols: Collection[str], *, is_wanted: bool
) -> None:
    """Look for the library of Python that a host that is no Python must be given.

    is_wanted : whether the unit is to run in such a host; else its absence is only a warning.
    """
    level = Level.MISSING if is_wanted else Level.WARNING
    if python.library is None:
        diagnosis.add(
            level, "libpython",
            f"Python {python.version} of {python.prefix} has no shared library: hosts that are no "
            "Python cannot run the unit",
            f"install it (Debian: apt install libpython{python.minor}), or use a Python that was "
            "built with --enable-shared (those of conda and uv are)",
        )  # fmt: skip
        return
    diagnosis.facts["start_of_other_hosts"] = python.start
    file = read_installed(python.library)
    if file is None:
        diagnosis.add(level, "libpython", f"{python.library} is damaged", "install it again")
        return
    linkage = link(file)
    absent = set(symbols) - file.defined
    if absent:
        diagnosis.add(
            Level.MISSING, "libpython",
            f"{python.library} lacks {', '.join(sorted(absent)[:3])}, which the unit takes from it",
            "the unit is for another Python: build it again, or name that Python (--python)",
        )  # fmt: skip
        return
    for name, by in linkage.absent.items():
        diagnosis.add(
            level, "libpython", f"{name}, which {by} needs, is not on this machine",
            "install the package that brings it",
        )  # fmt: skip
    diagnosis.add(
        Level.OK, "libpython",
        f"{python.library}; hosts that are no Python are started as: {python.start} HOST ...",
    )  # fmt: skip


def _requirements(content: PythonContent | None) -> list[Requirement]:
    requirements = []
    for line in () if content is None else content.requirements:
        try:
            requirement = Requirement(line)
        except InvalidRequirement:
            continue  # an address or a folder, told by _requirement_findings
        if requirement.marker is None or requirement.marker.evaluate():
            requirements.append(requirement)
    return requirements


def _module_findings(content: PythonContent, python: Interpreter) -> Iterator[Finding]:
    if not content.module_is_there:
        name = json.dumps(shortened(content.module))
        yield Finding(
            Level.MISSING, "python",
            f"slavemodule.txt names the module {name}, which is not in the unit: its exporter ends "
            "the host, or never comes back",
            "build the unit again",
        )  # fmt: skip
    absent = [name for name in content.needed if not python.modules[name]]
    for name in absent:
        built = ""
        package = name
        if name == "lcmchain" and content.lcmchain_version is not None:
            built = f" (the unit was built with lcmchain {content.lcmchain_version})"
            package = f"lcmchain=={content.lcmchain_version}"
        yield Finding(
            Level.MISSING, "packages",
            f"there is no module {name} in Python {python.version} of {python.prefix}{built}",
            f"{python.executable} -m pip install {package}, or run the host in the environment "
            "that has it (--python names one to look at)",
        )  # fmt: skip
    packages = [name for name in content.needed if name not in sys.stdlib_module_names]
    if packages and not absent:
        yield Finding(Level.OK, "packages", f"it has {', '.join(packages)}")
    unused = [name for name in content.used if not python.modules[name]]
    if unused:
        yield Finding(
            Level.WARNING, "packages",
            f"there is no module {', '.join(unused)}, which parts of the unit import on their way",
        )  # fmt: skip
    own = ".".join(map(str, sys.version_info[:2])) == python.minor  # by which they were read
    for file, reason in content.unreadable.items():
        is_first = own and file == f"{content.module}.py"
        yield Finding(
            Level.MISSING if is_first else Level.WARNING, "python",
            f"{file} cannot be read as Python ({reason})",
            "build the unit again" if is_first else "",
        )  # fmt: skip


def _requirement_findings(
    asked: list[Requirement], content: PythonContent, python: Interpreter
) -> Iterator[Finding]:
    for requirement in asked:
        version = python.distributions[requirement.name]
        if version is None or not requirement.specifier.contains(version, prereleases=True):
            has = "is not installed" if version is None else f"is {version} here"
            yield Finding(
                Level.MISSING, "packages", f"{REQUIREMENTS} asks for {requirement}; it {has}",
                f"{python.executable} -m pip install '{requirement}'",
            )  # fmt: skip
        else:
            yield Finding(Level.OK, "packages", f"{requirement}: {version}")
    unread = len(content.requirements) - len(asked)
    if unread:
        yield Finding(
            Level.NOTE, "packages",
            f"{unread} lines of {REQUIREMENTS} are not for this machine, or name no version",
        )  # fmt: skip
    if content.environment:
        yield Finding(
            Level.NOTE, "packages",
            f"its packages stand in {content.environment}, which `pythonfmu deploy` hands to conda",
        )  # fmt: skip


def _version_findings(content: PythonContent, python: Interpreter) -> Iterator[Finding]:
    built, here = content.lcmchain_version, python.distributions.get("lcmchain")
    if built is not None and here is not None and built != here:
        yield Finding(
            Level.WARNING, "packages",
            f"the unit was built with lcmchain {built}, this Python has {here}",
            "the unit says at its start if its variables have changed: build it again then",
        )  # fmt: skip


# --- what its modules import, and what they ask to be installed -----------------------------------

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
    module : name of the model's module. module_is_there : whether it lies in the unit.
    needed : modules from outside the unit, without which its module cannot be loaded.
    used : further modules that a function or an optional branch imports.
    requirements : lines of ``requirements.txt``.
    environment : name of a conda file with packages, empty without one.
    unreadable : module files that are no Python of this version, with the reason.
    lcmchain_version : with which a unit of ours was built, else None.
    """

    module: str
    module_is_there: bool
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
    # The exporters take the first line as it is, also with the end of a line of Windows.
    with names.open(encoding="utf-8", errors="replace", newline="\n") as file:
        module = file.readline().removesuffix("\n")
    is_there = _is_module(resources, module)
    needed, used, unreadable = _imports(resources, module) if is_there else (set(), set(), {})
    requirements: list[str] = []
    if (resources / REQUIREMENTS).is_file():
        text = (resources / REQUIREMENTS).read_text(encoding="utf-8", errors="replace")
        lines = [line.partition("#")[0].strip() for line in text.splitlines()]
        requirements = [line for line in lines if line and not line.startswith("-")]
    environment = next((name for name in ENVIRONMENTS if (resources / name).is_file()), "")
    return PythonContent(
        module=module,
        module_is_there=is_there,
        needed=tuple(sorted(needed)),
        used=tuple(sorted(used - needed)),
        requirements=tuple(requirements),
        environment=environment,
        unreadable=unreadable,
        lcmchain_version=_lcmchain_version(resources / UNIT_FILE),
    )


def _is_module(resources: Path, name: str) -> bool:
    try:
        return name.isidentifier() and (resources / f"{name}.py").is_file()
    except OSError:  # too long a name
        return False


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


# --- the Python that will run it: version, library and packages, asked of itself ------------------

# Runs in any Python 3; finds modules without running them.
_PROBE = r"""
import json, os, re, sys, sysconfig
from importlib.util import find_spec
asked = json.loads(sys.argv[1])
def has(name):
    try:
        return find_spec(name) is not None
    except Exception:
        return False
def version(name):
    try:
        from importlib.metadata import version
        return version(name)
    except Exception:
        return None
mapped = []
if os.path.exists("/proc/self/maps"):
    with open("/proc/self/maps") as lines:
        mapped = sorted({line.split()[-1] for line in lines if re.search(r"/libpython3\.\d", line)})
names = ("LIBDIR", "INSTSONAME", "LDLIBRARY", "Py_ENABLE_SHARED")
settings = {name: sysconfig.get_config_var(name) for name in names}
print(json.dumps({
    "version": sys.version.split()[0], "executable": sys.executable, "prefix": sys.prefix,
    "base_prefix": sys.base_prefix, "bits": 64 if sys.maxsize > 2**32 else 32,
    "settings": settings, "mapped": mapped,
    "modules": {name: has(name) for name in asked["modules"]},
    "distributions": {name: version(name) for name in asked["distributions"]},
}))
"""


@dataclass(frozen=True)
class Interpreter:
    """What a Python says of itself.

    Parameters
    ----------
    library : its shared library, None where it has none.
    modules : whether a module is there, for those that were asked for.
    distributions : version of a package, None where it is not installed.
    """

    version: str
    executable: Path
    prefix: Path
    bits: int
    library: Path | None
    modules: dict[str, bool] = field(default_factory=dict)
    distributions: dict[str, str | None] = field(default_factory=dict)

    @property
    def minor(self) -> str:
        """Version without the last number, such as 3.12."""
        return ".".join(self.version.split(".")[:2])

    @property
    def start(self) -> str:
        """What to write before the command of a host on Linux that is no Python."""
        folder = self.executable.parent
        return f"LD_PRELOAD={self.library} PATH={folder}:$PATH"


def ask_interpreter(
    python: Path | str, modules: Sequence[str] = (), distributions: Sequence[str] = ()
) -> Interpreter:
    """Start a Python and ask it.

    Raises
    ------
    InputError : it cannot be started, or is none.
    """
    path = shutil.which(str(python))
    if path is None:
        raise InputError(f'there is no Python "{python}"; name its file', key="--python")
    asked = json.dumps({"modules": list(modules), "distributions": list(distributions)})
    try:
        with tempfile.TemporaryDirectory() as empty:
            done = subprocess.run(
                [str(Path(path).absolute()), "-c", _PROBE, asked],
                capture_output=True, encoding="utf-8", errors="replace", timeout=60,
                cwd=empty,
            )  # fmt: skip
        answer = json.loads(done.stdout)
    except (OSError, subprocess.TimeoutExpired, ValueError) as error:
        raise InputError(
            f"this is no Python 3 that can be started ({error})", file=str(python)
        ) from None
    return Interpreter(
        version=answer["version"],
        executable=Path(answer["executable"]),
        prefix=Path(answer["prefix"]),
        bits=answer["bits"],
        library=_library(answer),
        modules=answer["modules"],
        distributions=answer["distributions"],
    )


def _library(answer: dict) -> Path | None:
    """Return the shared library of a Python: the one it runs from, else the one beside it."""
    for mapped in answer["mapped"]:
        return Path(mapped)
    settings, version = answer["settings"], ".".join(answer["version"].split(".")[:2])
    names = [f"libpython{version}.so.1.0", f"libpython{version}.so"]
    if settings["INSTSONAME"] and ".so" in settings["INSTSONAME"]:
        names.insert(0, settings["INSTSONAME"])
    # a Python that was built elsewhere and moved still says where it was built
    folders = [settings["LIBDIR"], Path(answer["base_prefix"], "lib")]
    for folder in folders:
        for name in names if folder else ():
            if Path(folder, name).is_file():
                return Path(folder, name)
    return None
