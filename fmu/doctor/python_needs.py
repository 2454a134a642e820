"""What a unit written in Python needs of the Python that runs it."""

from __future__ import annotations

import sys
from collections.abc import Collection, Iterator
from pathlib import Path

from packaging.requirements import InvalidRequirement, Requirement

from lcmchain.fmu.doctor.findings import Diagnosis, Finding, Level
from lcmchain.fmu.doctor.interpreter import Interpreter, ask_interpreter
from lcmchain.fmu.doctor.libraries import link
from lcmchain.fmu.doctor.python_content import REQUIREMENTS, PythonContent
from lcmchain.fmu.doctor.shared_objects import read_shared_object


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
    if content is not None:
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
    file = read_shared_object(python.library)
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
    found = []
    for line in () if content is None else content.requirements:
        try:
            requirement = Requirement(line)
        except InvalidRequirement:
            continue  # an address or a folder, told by _requirement_findings
        if requirement.marker is None or requirement.marker.evaluate():
            found.append(requirement)
    return found


def _module_findings(content: PythonContent, python: Interpreter) -> Iterator[Finding]:
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
    for file, reason in content.unreadable.items():
        yield Finding(Level.WARNING, "python", f"{file} cannot be read as Python ({reason})")


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
