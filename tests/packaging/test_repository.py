"""The root of the repository holds the agreed rooms and nothing else."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

FILES = {"pyproject.toml", "README.md", "LICENSE", ".gitignore"}
FOLDERS = {".ci", "lcmchain", "fmu", "mapping", "coupling", "tests", "examples"}


def repository_files() -> list[str]:
    """Tracked files and new ones that git does not ignore."""
    if shutil.which("git") is None or not (ROOT / ".git").exists():
        pytest.skip("not a git checkout")
    listed = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard", "-z"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    return [name for name in listed.stdout.split("\0") if name and (ROOT / name).exists()]


def test_root_holds_exactly_the_agreed_names():
    names = repository_files()
    assert {name for name in names if "/" not in name} == FILES
    assert {name.split("/")[0] for name in names if "/" in name} == FOLDERS


def test_no_build_or_result_files_are_kept():
    suffixes = {".pyc", ".so", ".whl", ".nbi", ".nbc", ".fmu", ".nc"}
    kept = [name for name in repository_files() if Path(name).suffix in suffixes]
    assert kept == []


def test_files_are_small():
    large = {
        name: size
        for name in repository_files()
        if (size := (ROOT / name).stat().st_size) > 1_500_000
    }
    assert large == {}


def test_ci_script_can_be_executed():
    assert os.access(ROOT / ".ci" / "run", os.X_OK)
