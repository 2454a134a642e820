"""Where numba keeps compiled kernels: one folder per state of the package sources.

A kernel that numba caches on disk is looked up by the time stamp of its own file. It does not
notice that a file whose functions it inlines has changed, and would go on running old physics.
Here the folder itself is named by a hash of the package sources that compiled code may be made of,
so that a change of any of them starts an empty one. A change of the others (commands, reports,
couplings, ...) keeps what is compiled, and so does a new checkout at the same place: whoever keeps
the folder between two runs of the tests compiles once for each state of the kernels.
"""

from __future__ import annotations

import hashlib
import itertools
import os
import platform
import shutil
import stat
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator
from importlib.util import find_spec
from pathlib import Path

from platformdirs import user_cache_path

# Packages that live outside the folder of lcmchain in a checkout.
OUTER_PACKAGES = ("lcmchain.mapping", "lcmchain.coupling", "lcmchain.fmu")

# Folders and files of the package that no compiled function is in, nor anything that one is made
# of: no file with compiled functions imports them, directly or not. What is not named here counts.
# tests/packaging/test_compile_cache.py compares this list with the imports.
NEVER_COMPILED = (
    "__main__.py", "cli.py", "forming_run.py", "pipeline.py", "provenance.py", "summary.py",
    "commands", "coupons", "identification", "judgements", "manual", "pattern", "report", "results",
    "statics", "study", "verification", "fmu", "mapping/formats", "mapping/structure",
    "coupling/mould.py", "coupling/cosimulation", "coupling/iteration", "coupling/precice_adapter",
    "coupling/wet_forming",
)  # fmt: skip

HASH_LENGTH = 20
MAXIMUM_AGE_DAYS = 30

#: Time to wait for another process that writes into the same folder [s].
LONGEST_WAIT = 10.0

# Set beside NUMBA_CACHE_DIR and inherited with it: tells a folder chosen here by a parent process
# (to be chosen anew, the child may run other sources) from one that the user chose.
CHOSEN_HERE = "LCMCHAIN_CHOSEN_CACHE_DIR"


def use_source_keyed_cache() -> Path | None:
    """Point numba at the cache folder of the present sources; None if the user chose a folder.

    Must run before the first kernel is compiled, best before numba is imported.
    """
    given = os.environ.get("NUMBA_CACHE_DIR")
    if given and given != os.environ.get(CHOSEN_HERE):
        return None
    folder = _writable_folder(source_key())
    os.environ["NUMBA_CACHE_DIR"] = os.environ[CHOSEN_HERE] = str(folder)
    if "numba" in sys.modules:  # it has read the environment already
        sys.modules["numba"].config.CACHE_DIR = str(folder)
    _remove_stale_siblings(folder)
    return folder


def key_cache_by_file(file: str | Path, module: str) -> None:
    """Keep compiled code apart that holds functions of a module outside this package.

    Kernels of a law that a user wrote must not be taken for those of another state of that file,
    and no other run should have to import the file to read its cache. For functions that are
    defined from now on; :func:`lcmchain.jit.move_cache` moves those that are.
    """
    import numba

    content = Path(file).read_bytes() if Path(file).is_file() else str(file).encode()
    present = Path(numba.config.CACHE_DIR or os.environ["NUMBA_CACHE_DIR"])  # type: ignore[attr-defined]
    digest = hashlib.blake2b(f"{present}\0{file}\0{module}\0".encode() + content, digest_size=5)
    numba.config.CACHE_DIR = str(present / f"with-{digest.hexdigest()}")  # type: ignore[attr-defined]


def let_processes_share() -> None:
    """Let several processes fill a folder at once; before anything is compiled.

    Numba numbers the files of a function and keeps an index of them. Two processes that compile one
    function for two kinds of arguments may both take the next number. An index then names the code
    of one for the arguments of the other. Here one waits for the other, and a file is complete
    before the index names it.

    The index of a function holds the types of its arguments. One that names a type of a module
    which this process cannot import, as of somebody's script, is taken for an empty one: numba
    would end there.
    """
    from filelock import FileLock, Timeout
    from numba.core.caching import IndexDataCacheFile

    def save(self, key, data):
        lock = FileLock(Path(self._cache_path) / "lock")
        try:
            lock.acquire(timeout=LONGEST_WAIT)
        except (OSError, Timeout, NotImplementedError):
            pass  # a file system without locks
        try:
            kept = self._load_index()
            taken = set(kept.values())
            names = (self._data_name(number) for number in itertools.count(1))
            name = kept.get(key) or next(name for name in names if name not in taken)
            self._save_data(name, data)
            self._save_index(kept | {key: name})
        finally:
            lock.release()

    load_index = IndexDataCacheFile._load_index

    def load_what_is_known(self):
        try:
            return load_index(self)
        except (ImportError, AttributeError):
            return {}

    IndexDataCacheFile.save = save  # type: ignore[method-assign]
    IndexDataCacheFile._load_index = load_what_is_known  # type: ignore[method-assign]


def source_key() -> str:
    """Hash of the sources of compiled code, the numba version and the kind of processor."""
    digest = hashlib.blake2b(digest_size=HASH_LENGTH // 2)
    digest.update(source_hash(without=NEVER_COMPILED).encode())
    digest.update(_numba_version())
    digest.update(processor().encode())
    return digest.hexdigest()


def source_hash(without: Iterable[str] = ()) -> str:
    """Hash of every source file of lcmchain: which code this is, whatever its version says.

    Parameters
    ----------
    without : folders and files that do not count, as they are named in an installed package.
    """
    digest = hashlib.blake2b(digest_size=32)
    left_out = frozenset(without)
    main, *outer = _package_folders()
    for folder in (main, *outer):
        inside = "" if folder == main else f"{folder.name}/"
        for file in _python_files(folder, inside, left_out):
            digest.update(f"{folder.name}{file[len(str(folder)) :]}\0".encode())
            digest.update(hashlib.blake2b(Path(file).read_bytes()).digest())
    return digest.hexdigest()


def _package_folders() -> list[Path]:
    folders = [Path(__file__).resolve().parents[1]]
    for name in OUTER_PACKAGES:
        spec = find_spec(name)
        if spec is None or not spec.submodule_search_locations:
            continue  # run from a checkout that was not installed
        folder = Path(next(iter(spec.submodule_search_locations))).resolve()
        if folders[0] not in folder.parents:  # an installed wheel has it inside lcmchain
            folders.append(folder)
    return folders


def _python_files(folder: Path, inside: str, left_out: frozenset[str]) -> Iterator[str]:
    """Source files below a folder, in an order that does not depend on the file system.

    Parameters
    ----------
    inside : name of the folder in an installed package, with a slash at its end.
    left_out : names of what does not count there.
    """
    if inside.rstrip("/") in left_out:
        return
    with os.scandir(folder) as entries:
        ordered = sorted(entries, key=lambda entry: entry.name)
    for entry in ordered:
        name = inside + entry.name
        if entry.is_dir():
            if entry.name != "__pycache__":
                yield from _python_files(Path(entry.path), f"{name}/", left_out)
        elif entry.name.endswith(".py") and name not in left_out:
            yield entry.path


def _numba_version() -> bytes:
    """Version file of numba, read as text because importing numba takes a second."""
    spec = find_spec("numba")
    if spec is None or spec.origin is None:
        return b""
    version_file = Path(spec.origin).with_name("_version.py")
    return version_file.read_bytes() if version_file.is_file() else b""


def processor() -> str:
    """Processor model and instruction sets; kernels are compiled for exactly these."""
    described = {}
    try:
        with open("/proc/cpuinfo", encoding="utf-8", errors="replace") as file:
            for line in file:
                if not line.strip():
                    break  # the first core stands for all
                name, _, value = line.partition(":")
                described[name.strip()] = value.strip()
    except OSError:
        return f"{platform.machine()} {platform.processor()}"
    wanted = ("vendor_id", "cpu family", "model", "model name", "flags", "Features", "CPU part")
    return " ".join([platform.machine(), *(described.get(name, "") for name in wanted)])


def _writable_folder(key: str) -> Path:
    """Folder of this key below the user's cache, else below the temporary folder."""
    try:
        folder = user_cache_path("lcmchain", appauthor=False, opinion=False) / key
        if _make_private_folder(folder):
            return folder
    except (OSError, RuntimeError):  # RuntimeError: no home folder
        pass
    user = os.getuid() if hasattr(os, "getuid") else "user"
    try:
        folder = Path(tempfile.gettempdir()) / f"lcmchain-{user}" / key
        if _make_private_folder(folder.parent) and _make_private_folder(folder):
            return folder
    except OSError:
        pass
    return Path(tempfile.mkdtemp(prefix="lcmchain-"))


def _make_private_folder(folder: Path) -> bool:
    """Create the folder; True if it is ours alone to write (cached kernels are executed)."""
    folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    found = folder.stat(follow_symlinks=False)
    if not stat.S_ISDIR(found.st_mode):
        return False
    if hasattr(os, "getuid"):
        if found.st_uid != os.getuid() or found.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
            return False
    if not os.access(folder, os.W_OK | os.X_OK):
        return False
    os.utime(folder)  # last use, for the removal of stale folders
    return True


def _remove_stale_siblings(folder: Path) -> None:
    """Remove caches of other source states that nobody has used for a month."""
    oldest = time.time() - MAXIMUM_AGE_DAYS * 86400.0
    try:
        siblings = list(os.scandir(folder.parent))
    except OSError:
        return
    for entry in siblings:
        is_cache = len(entry.name) == HASH_LENGTH and set(entry.name) <= set("0123456789abcdef")
        if not is_cache or entry.name == folder.name:
            continue
        try:
            if entry.is_dir(follow_symlinks=False) and entry.stat().st_mtime < oldest:
                shutil.rmtree(entry.path, ignore_errors=True)
        except OSError:
            continue
