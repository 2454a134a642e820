"""What can be said here about Windows and macOS: sources, file names, dependencies, the wheel.

A source is read, not run: what one system alone has stands behind a question whether it is there,
and texts are read and written in an encoding that is said, since that of Windows is another one.
"""

import ast
import re
import tomllib
from collections import Counter
from pathlib import Path

import pytest
from packaging.markers import default_environment
from packaging.requirements import Requirement

ROOT = Path(__file__).resolve().parents[2]
SOURCES = ("lcmchain", "mapping", "coupling", "fmu")

pytestmark = pytest.mark.skipif(
    not (ROOT / "pyproject.toml").is_file(), reason="needs the checkout, not only the tests"
)

#: Modules of the standard library that some systems do not have.
OF_ONE_SYSTEM = frozenset(
    "crypt curses fcntl grp nis ossaudiodev posix pty pwd readline resource spwd syslog termios "
    "tty _winapi msvcrt winreg winsound".split()
)
#: Names that ``os`` and ``signal`` do not have on Windows, or on macOS.
NOT_EVERYWHERE = {
    "os": frozenset(
        "chown fork forkpty getgid getloadavg getpgid getpgrp getpriority getsid getuid geteuid "
        "killpg lchown mkfifo mknod nice posix_fadvise posix_fallocate posix_spawn pread pwrite "
        "register_at_fork sched_getaffinity sched_setaffinity sendfile setpgid setpriority setsid "
        "statvfs sync sysconf ttyname uname wait wait3 wait4 waitid P_PID WEXITED WNOHANG WNOWAIT "
        "WIFEXITED O_CLOEXEC O_DIRECT O_DIRECTORY O_NOFOLLOW O_NONBLOCK".split()
    ),
    "signal": frozenset(
        "SIGALRM SIGCHLD SIGCONT SIGHUP SIGKILL SIGPIPE SIGQUIT SIGSTOP SIGTSTP SIGUSR1 SIGUSR2 "
        "SIGWINCH alarm pause pthread_sigmask setitimer siginterrupt sigwait".split()
    ),
}


def trees(folders):
    for folder in folders:
        for path in sorted((ROOT / folder).rglob("*.py")):
            yield path.relative_to(ROOT).as_posix(), ast.parse(path.read_text(encoding="utf-8"))


def with_scopes(tree):
    """Yield nodes with what they stand in, the innermost first."""
    stack = [(tree, ())]
    while stack:
        node, around = stack.pop()
        yield node, around
        stack += [(child, (node, *around)) for child in ast.iter_child_nodes(node)]


def answers(around, errors):
    """Whether a node stands in a ``try`` that answers to one of these errors."""
    caught = (
        name.id
        for node in around
        if isinstance(node, ast.Try)
        for handler in node.handlers
        for name in ast.walk(handler.type or ast.Name("Exception"))
        if isinstance(name, ast.Name)
    )
    return any(name in errors for name in caught)


def asks(around, module):
    """Whether the function that a node stands in asks which system it is on, or what there is."""
    function = next((n for n in around if isinstance(n, ast.FunctionDef)), None)
    if function is None:
        return False
    if any(ast.unparse(n) in ("sys.platform", "os.name") for n in ast.walk(function)):
        return True
    return any(
        isinstance(call, ast.Call)
        and ast.unparse(call.func) in ("hasattr", "getattr")
        and ast.unparse(call.args[0]) in ("os", module)
        for call in ast.walk(function)
    )


def of_one_system(tree):
    """Yield line and name of what stands in a source without a question whether it is there."""
    for node, around in with_scopes(tree):
        if isinstance(node, ast.Import | ast.ImportFrom):
            of = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            names = of or [alias.name for alias in node.names]
            for name in names:
                is_asked = answers(around, ("ImportError", "ModuleNotFoundError"))
                if name.split(".")[0] in OF_ONE_SYSTEM and not is_asked:
                    yield node.lineno, f"import {name}"
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            module = node.value.id
            if node.attr in NOT_EVERYWHERE.get(module, ()):
                if not answers(around, ("AttributeError",)) and not asks(around, module):
                    yield node.lineno, f"{module}.{node.attr}"
        elif isinstance(node, ast.Call) and node.args:
            words = ast.unparse(node)
            if words.endswith(("get_context('fork')", "set_start_method('fork')")):
                yield node.lineno, words
            elif words.endswith("CDLL(None)") and not asks(around, "os"):
                yield node.lineno, words  # all libraries of the process: not on Windows


def without_encoding(tree):
    """Yield line and words of what reads or writes text in an encoding that is not said."""
    for node, _ in with_scopes(tree):
        if not isinstance(node, ast.Call):
            continue
        method = isinstance(node.func, ast.Attribute)
        name = node.func.attr if method else getattr(node.func, "id", "")
        given = {keyword.arg: keyword.value for keyword in node.keywords}
        if "encoding" in given:
            continue
        if method and name in ("read_text", "write_text"):
            yield node.lineno, ast.unparse(node)
        elif name in ("run", "Popen", "check_output"):
            if {"text", "universal_newlines"} & given.keys():
                yield node.lineno, ast.unparse(node)
        elif name in ("open", "fdopen", "NamedTemporaryFile", "TemporaryFile"):
            owner = ast.unparse(node.func.value) if method else ""
            if owner in ("os", "webbrowser", "Image", "archive") and name == "open":
                continue  # no text
            position = 0 if (method and name == "open") or "Temporary" in name else 1
            mode = given.get("mode", node.args[position] if len(node.args) > position else None)
            default = "'w+b'" if "Temporary" in name else "'r'"
            if "b" not in (ast.unparse(mode) if mode is not None else default):
                yield node.lineno, ast.unparse(node)


@pytest.mark.parametrize("rule", [of_one_system, without_encoding])
def test_sources_of_the_package_are_those_of_any_system(rule):
    found = [
        f"{path}:{line} {words}" for path, tree in trees(SOURCES) for line, words in rule(tree)
    ]
    assert found == []


def test_examples_say_the_encoding_of_their_texts():
    found = [
        f"{path}:{line} {words}"
        for path, tree in trees(["examples"])
        for line, words in without_encoding(tree)
    ]
    assert found == []


@pytest.mark.parametrize(
    ("rule", "text", "count"),
    [
        (of_one_system, "import fcntl", 1),
        (of_one_system, "def f():\n    from resource import getrusage", 1),
        (of_one_system, "try:\n    import fcntl\nexcept ImportError:\n    fcntl = None", 0),
        (of_one_system, "try:\n    import fcntl\nexcept OSError:\n    pass", 1),
        (of_one_system, "def f():\n    return os.getuid()", 1),
        (of_one_system, "def f():\n    return os.getuid() if hasattr(os, 'getuid') else 0", 0),
        (
            of_one_system,
            "try:\n    n = os.sysconf(1)\nexcept (OSError, AttributeError):\n    n = 0",
            0,
        ),
        (of_one_system, "hint = code == signal.SIGKILL", 1),
        (of_one_system, "c = multiprocessing.get_context('fork')", 1),
        (of_one_system, "c = multiprocessing.get_context('spawn')", 0),
        (of_one_system, "ctypes.CDLL(None).signal(2, None)", 1),
        (of_one_system, "def f():\n    if sys.platform == 'linux':\n        CDLL(None)", 0),
        (without_encoding, "Path(p).read_text()", 1),
        (without_encoding, "p.write_text(text, encoding='utf-8')", 0),
        (without_encoding, "read_text(path)", 0),
        (without_encoding, "open(p)", 1),
        (without_encoding, "open(p, 'rb')", 0),
        (without_encoding, "p.open(mode='w')", 1),
        (without_encoding, "open(p, 'r+b' if n else 'wb')", 0),
        (without_encoding, "tempfile.TemporaryFile(dir=d)", 0),
        (without_encoding, "tempfile.NamedTemporaryFile('w')", 1),
        (without_encoding, "subprocess.run(c, text=True)", 1),
        (without_encoding, "subprocess.run(c, capture_output=True)", 0),
    ],
)
def test_the_rules_find_what_they_are_for(rule, text, count):
    assert len(list(rule(ast.parse(text)))) == count


# --- files, dependencies, the wheel ---------------------------------------------------------------


def files():
    """Yield the files of the repository by their places."""
    for folder in (*SOURCES, "examples", "tests", ".ci"):
        for path in (ROOT / folder).rglob("*"):
            if path.is_file() and "__pycache__" not in path.parts:
                yield path.relative_to(ROOT).as_posix()


def test_names_of_files_are_names_on_every_system():
    """None with what Windows keeps for itself, none too long, no two that differ in case alone."""
    places = list(files())
    reserved = re.compile(r"(?i)(con|prn|aux|nul|com\d|lpt\d)(\..*)?")
    for place in places:
        assert len(place) < 150, place
        for part in place.split("/"):
            assert not re.search(r'[<>:"|?*\\]|[. ]$', part) and not reserved.fullmatch(part), place
    (most,) = Counter(place.lower() for place in places).most_common(1)
    assert most[1] == 1, most


SYSTEMS = {
    "Linux": {"sys_platform": "linux", "platform_machine": "x86_64"},
    "Windows": {"sys_platform": "win32", "platform_machine": "AMD64"},
    "macOS, Intel": {"sys_platform": "darwin", "platform_machine": "x86_64"},
    "macOS, Apple": {"sys_platform": "darwin", "platform_machine": "arm64"},
}


def test_no_system_is_asked_for_what_there_is_none_of():
    """TBB has no wheels for macOS since 2021.11: what asks for it there cannot be installed."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    asked = {}
    for system, own in SYSTEMS.items():
        environment = {**default_environment(), **own}
        asked[system] = {
            requirement.name
            for requirement in map(Requirement, project["dependencies"])
            if requirement.marker is None or requirement.marker.evaluate(environment)
        }
    assert {system for system, names in asked.items() if "tbb" in names} == {"Linux", "Windows"}
    assert all(names | {"tbb"} == asked["Linux"] for names in asked.values())
    assert "Operating System :: OS Independent" in project["classifiers"]
