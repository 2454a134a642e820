"""Compiled kernels are kept per state of their sources, never shared between two states."""

import ast
import contextlib
import json
import os
import re
import subprocess
import sys
import threading
import time

import filelock
import meshio
import numba
import numpy as np
import pytest
import xarray as xr
from numba.core import caching

import lcmchain.jit  # noqa: F401  # sets how numba keeps what it compiles
from lcmchain.compilation import cache as compile_cache

REPORT = "import lcmchain, os; print(os.environ['NUMBA_CACHE_DIR'])"


def cache_folder_of_new_process(code=REPORT, **changes):
    environment = {
        name: value
        for name, value in os.environ.items()
        if name not in ("NUMBA_CACHE_DIR", compile_cache.CHOSEN_HERE)
    }
    done = subprocess.run(
        [sys.executable, "-P", "-c", code],
        env={**environment, **changes},
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.strip()


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A package of two files in place of lcmchain."""
    folder = tmp_path / "package"
    (folder / "inner").mkdir(parents=True)
    (folder / "kernel.py").write_text("from inner.physics import stress\n")
    (folder / "inner" / "physics.py").write_text("stress = 1\n")
    monkeypatch.setattr(compile_cache, "_package_folders", lambda: [folder])
    return folder


def test_key_changes_with_any_source_file(package):
    keys = [compile_cache.source_key()]
    (package / "inner" / "physics.py").write_text("stress = 2\n")
    keys.append(compile_cache.source_key())
    (package / "inner" / "physics.py").rename(package / "inner" / "other.py")
    keys.append(compile_cache.source_key())
    assert len(set(keys)) == 3
    (package / "notes.txt").write_text("not a source\n")
    (package / "__pycache__").mkdir()
    (package / "__pycache__" / "left_over.py").write_text("")
    assert compile_cache.source_key() == keys[-1]


def test_key_stays_where_what_is_never_compiled_changes(package, monkeypatch):
    """It is told by its place: another file or folder of that name counts."""
    monkeypatch.setattr(compile_cache, "NEVER_COMPILED", ("report", "inner/words.py", "outer/run"))
    for name in ("report", "inner/report", "outer/run"):
        (package / name).mkdir(parents=True)
        (package / name / "page.py").write_text("")
    (package / "inner" / "words.py").write_text("")
    (package / "words.py").write_text("")
    key, everything = compile_cache.source_key(), compile_cache.source_hash()
    for name in ("report/page.py", "inner/words.py", "outer/run/page.py"):
        (package / name).write_text("changed = True\n")
    assert compile_cache.source_key() == key
    assert compile_cache.source_hash() != everything
    for name in ("words.py", "inner/report/page.py", "kernel.py"):
        (package / name).write_text("changed = True\n")
        assert compile_cache.source_key() != key
        key = compile_cache.source_key()


def test_a_package_outside_has_the_names_of_an_installed_one(package, tmp_path, monkeypatch):
    """In a checkout ``coupling`` lies beside ``lcmchain``, in a wheel inside it."""
    outer = tmp_path / "outer"
    (outer / "run").mkdir(parents=True)
    monkeypatch.setattr(compile_cache, "_package_folders", lambda: [package, outer])
    monkeypatch.setattr(compile_cache, "NEVER_COMPILED", ("outer/run",))
    (outer / "run" / "page.py").write_text("")
    (outer / "kernel.py").write_text("")
    key = compile_cache.source_key()
    (outer / "run" / "page.py").write_text("changed = True\n")
    assert compile_cache.source_key() == key
    (outer / "kernel.py").write_text("changed = True\n")
    assert compile_cache.source_key() != key


#: A function that numba compiles, or that answers a question of one.
COMPILED_FUNCTION = re.compile(
    r"^@(njit|jit|vectorize|guvectorize|overload|implements|inherit|"
    r"\w*(entry|kernel|routine|equation|span_part|kernel_part))\b"
    r"|^from lcmchain\.(jit|dispatch) import|^(from|import) numba\b",
    re.M,
)


def sources_of_the_package():
    """Files of the package by their names in an installed one."""
    main, *outer = compile_cache._package_folders()
    return {
        ("" if folder == main else f"{folder.name}/") + path.relative_to(folder).as_posix(): path
        for folder in (main, *outer)
        for path in folder.rglob("*.py")
    }


def imported_by(name, path, files):
    """Files of the package that one of them imports, wherever in it, by their names.

    A name on demand is in the file where the stub of the package says it is.
    """

    def file_of(module):
        place = "/".join(module.split(".")[1:])
        candidates = (f"{place}.py", f"{place}/__init__.py".lstrip("/"))
        return next((file for file in candidates if file in files), None)

    def stub_of(module):
        file = file_of(module)
        return file and files[file].with_suffix(".pyi")

    def modules_in(tree):
        for node in ast.walk(tree):
            if isinstance(node, ast.Import):
                yield from (alias.name for alias in node.names)
            elif isinstance(node, ast.ImportFrom):
                assert node.level == 0, f"{name}: a relative import"
                yield node.module
                yield from (f"{node.module}.{alias.name}" for alias in node.names)
                if node.module.split(".")[0] == "lcmchain":
                    stub = stub_of(node.module)
                    if stub is not None and stub.is_file():
                        asked = {alias.name for alias in node.names}
                        yield from (
                            f"{node.module}.{found.module}"
                            for found in ast.walk(ast.parse(stub.read_text(encoding="utf-8")))
                            if isinstance(found, ast.ImportFrom)
                            and asked & {alias.name for alias in found.names}
                        )

    found = set()
    for module in modules_in(ast.parse(path.read_text(encoding="utf-8"))):
        parts = module.split(".")
        if parts[0] == "lcmchain":  # with the packages around it
            found |= {file_of(".".join(parts[: k + 1])) for k in range(len(parts))}
    return found - {None}


def test_no_compiled_function_is_made_of_what_does_not_count():
    files = sources_of_the_package()
    for name in compile_cache.NEVER_COMPILED:
        assert name in files or f"{name}/__init__.py" in files, f"{name} is not there any more"
    made_of = {
        name
        for name, path in files.items()
        if COMPILED_FUNCTION.search(path.read_text(encoding="utf-8"))
    }
    new = made_of
    while new:
        new = {other for name in new for other in imported_by(name, files[name], files)} - made_of
        made_of |= new
    assert {"solver/loop.py", "state.py", "jit.py", "mapping/solids/columns.py"} <= made_of
    assert len(made_of) < len(files) / 2
    left_out = compile_cache.NEVER_COMPILED
    folders = tuple(f"{name}/" for name in left_out)
    wrong = {name for name in made_of if name in left_out or name.startswith(folders)}
    assert wrong == set(), "compiled code is made of these: take them out of NEVER_COMPILED"


def test_key_changes_with_numba(package, monkeypatch):
    before = compile_cache.source_key()
    assert b"version" in compile_cache._numba_version()
    monkeypatch.setattr(compile_cache, "_numba_version", lambda: b"another")
    assert compile_cache.source_key() != before


def test_key_changes_with_the_processor(package, monkeypatch):
    """Kernels are compiled for its instructions: another one may not even run them."""
    before = compile_cache.source_key()
    monkeypatch.setattr(compile_cache, "processor", lambda: "x86_64 another model")
    assert compile_cache.source_key() != before


@pytest.mark.skipif(not os.path.isfile("/proc/cpuinfo"), reason="needs /proc/cpuinfo")
def test_the_processor_is_told_by_model_and_instructions():
    with open("/proc/cpuinfo", encoding="utf-8", errors="replace") as file:
        first = file.read().split("\n\n")[0]
    described = compile_cache.processor()
    values = dict(line.split(":", 1) for line in first.splitlines() if ":" in line)
    told = [
        value.strip()
        for name, value in values.items()
        if name.strip() in ("model name", "flags", "Features", "CPU part") and value.strip()
    ]
    assert told and all(value in described for value in told)


@pytest.mark.skipif(sys.platform != "linux", reason="cache folder of Linux")
def test_numba_uses_the_folder_of_the_sources(tmp_path):
    code = "import lcmchain, numba; print(numba.config.CACHE_DIR)"
    folder = cache_folder_of_new_process(code, XDG_CACHE_HOME=str(tmp_path))
    assert folder == str(tmp_path / "lcmchain" / compile_cache.source_key())
    assert os.path.isdir(folder)
    late = "import numba, lcmchain; print(numba.config.CACHE_DIR)"
    assert cache_folder_of_new_process(late, XDG_CACHE_HOME=str(tmp_path)) == folder


def test_no_file_of_tests_moves_the_cache_of_its_worker():
    """Else commands that tests start find nothing of what the workers have compiled."""
    assert numba.config.CACHE_DIR == os.environ["NUMBA_CACHE_DIR"]


def test_folder_of_the_user_is_respected(tmp_path):
    assert cache_folder_of_new_process(NUMBA_CACHE_DIR=str(tmp_path)) == str(tmp_path)


@pytest.mark.skipif(sys.platform != "linux", reason="cache folder of Linux")
def test_folder_inherited_from_a_parent_process_is_chosen_anew(tmp_path):
    stale = str(tmp_path / "of_other_sources")
    changes = {"NUMBA_CACHE_DIR": stale, compile_cache.CHOSEN_HERE: stale}
    folder = cache_folder_of_new_process(XDG_CACHE_HOME=str(tmp_path), **changes)
    assert folder == str(tmp_path / "lcmchain" / compile_cache.source_key())


@pytest.mark.skipif(sys.platform != "linux", reason="cache folder of Linux")
def test_falls_back_to_the_temporary_folder(tmp_path):
    blocked = tmp_path / "a_file_instead_of_a_folder"
    blocked.write_text("")
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    folder = cache_folder_of_new_process(XDG_CACHE_HOME=str(blocked), TMPDIR=str(temporary))
    assert folder.startswith(str(temporary))
    assert os.access(folder, os.W_OK)


@pytest.mark.skipif(sys.platform != "linux", reason="cache folder of Linux")
def test_user_without_a_home_gets_the_temporary_folder(tmp_path, monkeypatch):
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(os.path, "expanduser", lambda path: path)  # as where there is no home
    monkeypatch.setattr(compile_cache.tempfile, "gettempdir", lambda: str(tmp_path))
    monkeypatch.chdir(tmp_path)
    folder = compile_cache._writable_folder("key")
    assert folder == tmp_path / f"lcmchain-{os.getuid()}" / "key"
    assert not (tmp_path / "~").exists()


@pytest.mark.skipif(sys.platform == "win32", reason="permissions of POSIX")
def test_folder_that_others_may_write_is_not_used(tmp_path):
    shared = tmp_path / "shared"
    shared.mkdir()
    shared.chmod(0o777)
    assert not compile_cache._make_private_folder(shared)


def test_caches_unused_for_a_month_are_removed(tmp_path):
    present, recent, old = (tmp_path / (digit * compile_cache.HASH_LENGTH) for digit in "abc")
    foreign = tmp_path / "something_else"
    long_ago = time.time() - (compile_cache.MAXIMUM_AGE_DAYS + 1) * 86400.0
    for folder in (present, recent, old, foreign):
        folder.mkdir()
        (folder / "kernel.nbi").write_text("")
    for folder in (present, old, foreign):
        os.utime(folder, (long_ago, long_ago))
    compile_cache._remove_stale_siblings(present)
    assert sorted(tmp_path.iterdir()) == sorted([present, recent, foreign])


def test_processes_that_save_at_once_keep_what_each_has_saved(tmp_path, monkeypatch):
    """Two kinds of arguments of one function: numba alone gives both the same file."""

    def cache():
        return caching.IndexDataCacheFile(str(tmp_path), "loop-1.py311", "stamp")

    meet, save_data = threading.Barrier(2), caching.IndexDataCacheFile._save_data

    def save_data_together(self, name, data):
        with contextlib.suppress(threading.BrokenBarrierError):
            meet.wait(
                0.5
            )  # both have looked for a free name by now, unless one waits for the other
        save_data(self, name, data)

    monkeypatch.setattr(caching.IndexDataCacheFile, "_save_data", save_data_together)
    saving = [threading.Thread(target=cache().save, args=(key, f"code of {key}")) for key in "ab"]
    for thread in saving:
        thread.start()
    for thread in saving:
        thread.join()
    assert [cache().load(key) for key in "abc"] == ["code of a", "code of b", None]
    monkeypatch.setattr(caching.IndexDataCacheFile, "_save_data", save_data)
    cache().save("a", "newer code of a")
    assert [cache().load(key) for key in "ab"] == ["newer code of a", "code of b"]
    assert len(list(tmp_path.glob("*.nbc"))) == 2


def test_code_is_on_disk_before_the_index_names_it(tmp_path, monkeypatch):
    cache = caching.IndexDataCacheFile(str(tmp_path), "loop-1.py311", "stamp")

    def full_disk(self, name, data):
        raise OSError("no space left")

    monkeypatch.setattr(caching.IndexDataCacheFile, "_save_data", full_disk)
    with pytest.raises(OSError, match="no space"):
        cache.save("a", "code")
    assert cache._load_index() == {}


OWN_TYPE = """
from typing import NamedTuple
class Place(NamedTuple):
    x: float
    y: float
    z: float
"""
ASK = "from lcmchain.elements.vectors import dot; print(dot({}, (1.0, 2.0, 3.0)))"


def test_types_of_a_script_do_not_keep_others_from_what_is_compiled(tmp_path):
    """They are in the index of a function of the package, and this process cannot import them."""
    (tmp_path / "my_script.py").write_text(OWN_TYPE)
    own = {"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": str(tmp_path)}
    code = f"from my_script import Place; {ASK.format('Place(1.0, 1.0, 1.0)')}"
    assert cache_folder_of_new_process(code, **own) == "6.0"
    assert any(b"my_script" in file.read_bytes() for file in tmp_path.rglob("*vectors.dot*.nbi"))
    code = ASK.format("(2.0, 2.0, 2.0)")
    assert cache_folder_of_new_process(code, NUMBA_CACHE_DIR=own["NUMBA_CACHE_DIR"]) == "12.0"


def test_without_locks_code_is_kept_as_well(tmp_path, monkeypatch):
    def no_locks(self, *_, **__):
        raise NotImplementedError("no locks on this file system")

    monkeypatch.setattr(filelock.FileLock, "acquire", no_locks)
    cache = caching.IndexDataCacheFile(str(tmp_path), "loop-1.py311", "stamp")
    cache.save("a", "code of a")
    assert cache.load("a") == "code of a"


COMPILED = """
import json, sys
from numba.core import event
from lcmchain.scene import scene_from_text
from lcmchain.solver.simulation import Simulation

class Names(event.Listener):
    names = []
    def on_start(self, event): self.names.append(event.data["dispatcher"].py_func.__name__)
    def on_end(self, event): pass

scene = scene_from_text(open(sys.argv[1]).read(), overrides=sys.argv[2:])
with event.install_listener("numba:compile", Names()):
    Simulation.from_scene(scene).compile()
print(json.dumps(sorted(set(Names.names))))
"""


@pytest.mark.slow
def test_a_second_scene_compiles_only_what_no_scene_had_before(tmp_path):
    """Numbers compile nothing; an effect compiles what depends on it, once."""
    (tmp_path / "scene.toml").write_text(
        """
        process = { time = "1 ms" }
        blank = { size = ["20 mm", "20 mm"], edge_length = "5 mm", height = "0.502 mm" }
        material = { preset = "MD600" }
        tools = [{ name = "die", shape = { type = "plate", side = "below" } }]
        """,
        encoding="utf-8",
    )

    def compiled(*overrides):
        environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
        environment.pop("LCMCHAIN_CHOSEN_CACHE_DIR", None)
        command = [sys.executable, "-c", COMPILED, str(tmp_path / "scene.toml"), *overrides]
        done = subprocess.run(command, capture_output=True, text=True, env=environment, check=True)
        return set(json.loads(done.stdout))

    first = compiled()
    assert {"advance", "make_batches", "move_chunk", "find_near_nodes"} <= first
    assert compiled() == set()
    numbers = (
        'blank.size=["40 mm", "30 mm"]', "process.mass_damping=10 1/s", "process.gravity=true",
        "contact.friction=0.3", "element.integration_points=2", "element.fibre_hourglass=0.5",
        "element.cross_terms=true", "material.thickness=2 mm",
    )  # fmt: skip
    assert compiled(*numbers) == set()
    published = ("element.compaction_strain=director", "element.hourglass=published")
    second = compiled(*published)
    assert {"advance", "make_batches"} <= second
    assert not {"move_chunk", "find_near_nodes", "centre_stretches"} & second
    assert compiled(*published) == compiled(*numbers) == set()


RUN = """
import json, sys
from numba.core import event
from lcmchain import pipeline, read_scene
from lcmchain.solver import compile_beside

class Names(event.Listener):
    names = []
    def on_start(self, event): self.names.append(event.data["dispatcher"].py_func.__name__)
    def on_end(self, event): pass

scene, out, cores = sys.argv[1:]
compile_beside._cores = lambda: int(cores)
told = []
with event.install_listener("numba:compile", Names()):
    pipeline.run(
        read_scene(scene), out, threads=1, progress=lambda done, of, text: told.append(text)
    )
print(json.dumps([sorted(set(Names.names)), told]))
"""


@pytest.mark.slow
def test_two_processes_compile_what_one_does(tmp_path):
    """All of it is on disk then, and the results have the same bits."""
    (tmp_path / "scene.toml").write_text(
        """
        process = { time = "1 ms", frames = 2 }
        output = { pictures = false, vtu = false, report = false }
        blank = { size = ["20 mm", "20 mm"], edge_length = "5 mm", height = "0.502 mm" }
        material = { preset = "MD600" }
        tools = [{ name = "die", shape = { type = "plate", side = "below" } }]
        mapping = [{ name = "part", mesh = "part.vtu", kind = "infiltration" }]
        """,
        encoding="utf-8",
    )
    corners = 1e-3 * np.array([[-5, -5, 0.502], [5, -5, 0.502], [5, 5, 0.502], [-5, 5, 0.502]])
    meshio.write(tmp_path / "part.vtu", meshio.Mesh(corners, [("quad", [[0, 1, 2, 3]])]))

    def run(name, cache, cores):
        environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / cache)}
        environment.pop("LCMCHAIN_CHOSEN_CACHE_DIR", None)
        out = tmp_path / name
        command = [sys.executable, "-W", "error::RuntimeWarning", "-c", RUN]
        command += [str(tmp_path / "scene.toml"), str(out), str(cores)]
        done = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
        assert done.returncode == 0, done.stderr
        compiled, told = json.loads(done.stdout)
        fields = [read_groups(out / file) for file in ("forming.nc", "part.nc")]
        return set(compiled), [text for text in told if text.startswith("compiling, ")], fields

    here, told, fields = run("together", "shared", 2)
    compiled_alone, told_alone, fields_alone = run("alone", "own", 1)
    compiled_again, told_again, fields_again = run("again", "shared", 2)
    assert fields == fields_alone == fields_again
    assert compiled_again == set() and told_again == []
    there = compiled_alone - here
    assert {"element_frequency_bounds"} <= there and {"advance", "make_batches"} <= here
    pairs = [text for text in told if " and " in text]
    assert pairs and all("now steps and " in text for text in pairs)
    assert not any(" and " in text for text in told_alone)
    assert told_alone[0] == "compiling, 0 of 6 loops done, now steps"
    assert "compiling, 5 of 6 loops done, now highest frequency" in told_alone


def read_groups(path):
    """Return the content of all variables of a file, by group and name."""
    with xr.open_datatree(path, engine="netcdf4", decode_times=False) as tree:
        return {
            f"{node.path}/{name}": variable.values.tobytes()
            for node in tree.subtree
            for name, variable in node.to_dataset(inherit=False).variables.items()
        }
