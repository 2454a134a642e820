"""Progress as lines, the log of a run, and what the terminal says with --quiet and --strict."""

import platform
import re
import tomllib
import types
from importlib import metadata
from pathlib import Path

import pytest

from lcmchain import __version__, cli, provenance
from lcmchain.commands import terminal
from lcmchain.commands.terminal import progress_bar, warn_in_groups
from lcmchain.results import ProgressLines, RunLog
from lcmchain.results.folder import all_warnings


class Clock:
    now = 100.0

    def __call__(self):
        return self.now


def test_a_line_per_stage_and_one_every_ten_seconds():
    lines, clock = [], Clock()
    tell = ProgressLines(lines.append, clock)
    tell(0.0, 2.0, "compiling")
    for second in range(31):
        clock.now = 200.0 + second
        tell(0.05 * second, 2.0, f"forming, step {100 * second}")
    clock.now += 1.0
    tell(2.0, 2.0, "writing fields")
    assert lines == [
        "compiling",
        "forming, step 0",
        "forming, step 1000, 25%, 30.0 s left",
        "forming, step 2000, 50%, 20.0 s left",
        "forming, step 3000, 75%, 10.0 s left",
        "writing fields",
    ]


def test_time_left_counts_from_where_a_resumed_run_began():
    lines, clock = [], Clock()
    tell = ProgressLines(lines.append, clock)
    tell(1.0, 2.0)
    clock.now += 10.0
    tell(1.25, 2.0)
    assert lines[-1] == "forming, 62%, 30.0 s left"


def test_a_stage_without_progress_says_how_long_it_takes():
    lines, clock = [], Clock()
    tell = ProgressLines(lines.append, clock)
    tell(0.0, 2.0, "compiling")
    clock.now += 75.0
    tell(0.0, 2.0, "compiling")
    assert lines[-1] == "compiling, since 1 min 15 s"


def test_what_is_no_terminal_gets_lines_on_the_error_stream(capsys):
    with progress_bar() as update:
        update(0.5, 1.0, "forming, step 3")
    captured = capsys.readouterr()
    assert captured.err == "forming, step 3\n" and captured.out == ""
    with progress_bar(quiet=True) as update:
        update(0.5, 1.0, "forming, step 3")
    assert capsys.readouterr().err == ""


def test_a_terminal_is_told_how_long_a_stage_without_progress_takes(capsys, monkeypatch):
    clock = Clock()
    monkeypatch.setenv("FORCE_COLOR", "1")  # rich takes the stream for a terminal then
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.setattr(terminal.time, "monotonic", clock)
    with progress_bar() as update:
        update(0.0, 2.0, "compiling")
        clock.now += 12.0
        update(0.0, 2.0, "compiling, 2 of 6 loops done, now steps")
    compiling = capsys.readouterr().err
    with progress_bar() as update:
        update(0.0, 2.0, "compiling")
        clock.now += 12.0
        update(0.0, 2.0, "forming, step 0")
        clock.now += 12.0
        update(1.0, 2.0, "forming, step 50")
    forming = capsys.readouterr().err
    assert "compiling, 2 of 6 loops done, now steps, since 12" in compiling
    assert "forming, step 50" in forming and "since" not in forming


def test_the_log_says_when(tmp_path):
    RunLog(tmp_path)("compiling")
    RunLog(tmp_path)("stopped: first\nsecond")
    first, second, third = (tmp_path / "lcmchain.log").read_text(encoding="utf-8").splitlines()
    assert re.fullmatch(r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d[+-]\d\d:\d\d  compiling", first)
    assert second.endswith("  stopped: first") and third == "    second"


def test_equal_warnings_are_said_once(capsys):
    warn_in_groups(["thin", "thin", "thick"])
    assert capsys.readouterr().out == "Warning: thin (2 times)\nWarning: thick\n"


def test_version(capsys):
    with pytest.raises(SystemExit) as stop:
        cli.main(["--version"])
    assert stop.value.code == 0
    told = capsys.readouterr().out.splitlines()
    assert told[0] == f"lcmchain {__version__}"
    assert told[1].startswith(f"python {platform.python_version()} on ")
    for name in ("numpy", "numba", "llvmlite", "h5py", "xarray", "meshio", "fmpy"):
        assert f"{name} {metadata.version(name)}" in told[2]
    (citation,) = [line for line in told if line.startswith("how to cite: ")]
    assert f"version: {__version__}\n" in Path(citation.partition(": ")[2]).read_text("utf-8")


def test_versions_name_every_extra_and_what_installs_a_missing_one(monkeypatch):
    project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text("utf-8"))
    extras = project["project"]["optional-dependencies"]
    assert provenance.EXTRAS.keys() == extras.keys() - {"test"}
    for extra, (name, _) in provenance.EXTRAS.items():
        assert any(re.match(rf"{name}\b", needed) for needed in extras[extra])
    real = provenance.version

    def without_openpyxl(name):
        if name == "openpyxl":
            raise metadata.PackageNotFoundError(name)
        return real(name)

    monkeypatch.setattr(provenance, "version", without_openpyxl)
    (told,) = [line for line in provenance.versions() if line.startswith("extra excel")]
    assert told.endswith('not installed: pip install "lcmchain[excel]"')


SUMMARY = {
    "title": "dome", "shear_angle_max_rad": 0.1, "fibre_strain_max": 0.0, "balance_error_max": 0.0,
    "kinetic_to_internal_end": 0.0, "step_count": 10, "step_control": {"waves": 10},
    "wall_s": 1.0, "compile_s": 1.0, "threads": 2, "us_per_element_step": 0.1,
    "mapping": {"part": {"error": "no sheet nearby", "warnings": ["a hole"]}},
}  # fmt: skip


@pytest.fixture
def run_with(monkeypatch, tmp_path):
    """Run the command on a stand-in for the chain that leaves these warnings."""
    scene = tmp_path / "scene.toml"
    scene.write_text(
        'process = { time = "1 ms" }\nblank = { size = ["20 mm", "20 mm"], edge_length = "5 mm" }\n'
        'material = { preset = "MD600" }\n',
        encoding="utf-8",
    )

    def run(warnings, *options):
        from lcmchain import pipeline

        result = types.SimpleNamespace(summary=SUMMARY | {"warnings": warnings})
        monkeypatch.setattr(pipeline, "run", lambda *given, **options: result)
        with pytest.raises(SystemExit) as stop:
            cli.main(["run", str(scene), "--out", str(tmp_path / "out"), *options])
        return stop.value.code

    return run


def test_warnings_end_well_unless_they_are_errors(run_with, capsys):
    assert run_with(["it still moves"]) == 0
    captured = capsys.readouterr()
    assert "Shear angle" in captured.out and "Warning: it still moves" in captured.out
    assert "Warning: part: a hole" in captured.out and "Error" not in captured.err
    assert run_with(["it still moves"], "--strict") == 1
    captured = capsys.readouterr()
    assert "Warning: it still moves" in captured.out and "Shear angle" in captured.out
    assert "2 warnings (above), and --strict" in captured.err


def test_quiet_says_warnings_only(run_with, capsys):
    assert run_with(["it still moves"], "--quiet") == 0
    captured = capsys.readouterr()
    assert captured.out == "Warning: it still moves\nWarning: part: a hole\n"
    assert captured.err == ""
    assert all_warnings(SUMMARY | {"warnings": []}) == ["part: a hole"]
