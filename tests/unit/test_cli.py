"""The command line: quick help, thin commands, exit codes, and what is left on disk."""

import json
import os
import subprocess
import sys
import tomllib
import types
import warnings
from contextlib import contextmanager
from pathlib import Path

import pytest
import typer.main
from rich.table import Table

from lcmchain import cli
from lcmchain.commands import run as run_command
from lcmchain.commands.options import default_out
from lcmchain.commands.terminal import show_python_warnings
from lcmchain.errors import InputError, SimulationError
from lcmchain.manual.command_reference import leaf_commands
from lcmchain.scene import read_scene, scene_from_text
from lcmchain.scene.reading.single_tables import is_scene_file
from lcmchain.study.sources import SceneText

EXAMPLES = Path(__file__).parents[2] / "examples"

SCENE = """
[process]
time = "20 ms"
[blank]
size = ["100 mm", "80 mm"]
edge_length = "10 mm"
height = "0.502 mm"
[material]
preset = "MD600"
[contact]
friction = 0.157
[[tools]]
name = "punch"
shape = { type = "sphere_capped_punch", radius = "30 mm" }
position = "0 0 1.004 mm"
motion = { type = "stroke", direction = [0, 0, -1], distance = "20 mm" }
[[tools]]
name = "holder"
shape = { type = "plate_with_hole", hole_radius = "32 mm", fillet_radius = "5 mm", side = "above" }
position = "0 0 2 mm"
friction = 0
motion = { type = "guided", direction = [0, 0, -1], mass = "1.7 kg" }
"""


@pytest.fixture
def scene_file(tmp_path):
    path = tmp_path / "dome.toml"
    path.write_text(SCENE, encoding="utf-8")
    return path


def exit_code(*arguments) -> int:
    with pytest.raises(SystemExit) as stop:
        cli.main([str(argument) for argument in arguments])
    return stop.value.code or 0


def stand_in(monkeypatch, module_name: str, **functions) -> None:
    """Replace a module that a command imports when it runs."""
    module = types.ModuleType(module_name)
    for name, function in functions.items():
        setattr(module, name, function)
    monkeypatch.setitem(sys.modules, module_name, module)


def test_help_lists_the_commands_without_loading_the_solver():
    program = (
        "import sys\n"
        "import lcmchain.cli as cli\n"
        "try:\n    cli.main(['--help'])\nexcept SystemExit as stop:\n    assert not stop.code\n"
        "heavy = {'numba', 'numpy', 'pydantic', 'pint', 'xarray', 'matplotlib'}\n"
        "assert not heavy & set(sys.modules), heavy & set(sys.modules)\n"
    )
    result = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert result.returncode == 0, result.stderr
    for command in ("run", "check", "schema", "map", "fmu", "coupon", "bench"):
        assert f" {command} " in result.stdout


def test_ctrl_c_while_the_command_is_loaded_shows_no_traceback():
    scripts = tomllib.loads((EXAMPLES.parent / "pyproject.toml").read_text("utf-8"))["project"]
    module, _, function = scripts["scripts"]["lcmchain"].partition(":")
    program = (
        "import sys\n"
        "class Interrupting:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name == 'typer':\n            raise KeyboardInterrupt\n"
        "sys.meta_path.insert(0, Interrupting())\n"
        f"from {module} import {function}\n{function}()\n"
    )
    result = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert (result.returncode, result.stderr) == (1, "Error: stopped by the user\n")


def test_run_does_not_wait_for_what_its_steps_do_not_need():
    program = (
        "import sys\n"
        "import lcmchain.pipeline\n"
        "heavy = {'xarray', 'pandas', 'matplotlib', 'scipy.optimize', 'scipy.ndimage'}\n"
        "assert not heavy & set(sys.modules), heavy & set(sys.modules)\n"
    )
    result = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert result.returncode == 0, result.stderr


def test_a_warning_is_shown_once_whatever_happens_to_the_filters(capsys):
    with show_python_warnings():
        for _ in range(3):
            with warnings.catch_warnings():
                warnings.simplefilter("always")
                warnings.warn("ball.stl: inside out", stacklevel=1)
        warnings.warn("ball.stl: open", stacklevel=1)
    assert capsys.readouterr().err == "Warning: ball.stl: inside out\nWarning: ball.stl: open\n"


def test_no_command_shows_the_help(capsys):
    assert exit_code() == 2
    captured = capsys.readouterr()
    assert "Usage" in captured.out + captured.err


def test_what_everybody_types_first_is_known(capsys):
    """``-h`` wherever ``--help`` is, and ``-o`` wherever ``--out`` is."""
    for arguments in (["-h"], ["fmu", "build", "-h"]):
        assert exit_code(*arguments) == 0
        assert "Usage" in capsys.readouterr().out
    commands = dict(leaf_commands(typer.main.get_command(cli.app), "lcmchain"))
    outs = {
        name: option.opts
        for name, command in commands.items()
        for option in command.params
        if "--out" in option.opts
    }
    assert len(outs) > 10
    assert all("-o" in spellings for spellings in outs.values()), outs


@pytest.mark.parametrize("arguments", [["run"], ["walk"], ["run", "--threads", "0", "a.toml"]])
def test_wrong_usage_is_wrong_input(arguments, capsys):
    assert exit_code(*arguments) == 2
    assert "Traceback" not in capsys.readouterr().err


def test_run_hands_everything_over(monkeypatch, scene_file, tmp_path, capsys):
    calls = []

    def run_scene(scene, out, *, threads, resume, until_stage, start_from, progress):
        progress(0.5, 1.0, "forming")
        calls.append((scene.process.frames, out, threads, resume, until_stage, start_from))
        return types.SimpleNamespace(summary={"title": "dome"})

    def print_result(summary, folder, *, quiet):
        print(summary, folder)
        return []

    stand_in(monkeypatch, "lcmchain.pipeline", run=run_scene)
    monkeypatch.setattr(run_command, "print_result", print_result)
    out = tmp_path / "deep" / "results"
    code = exit_code(
        "run", scene_file, "--out", out, "--threads", 2, "--resume", "--set", "process.frames=5",
        "--set", "tools.punch.friction=0.2",
    )  # fmt: skip
    assert code == 0
    assert calls == [(5, out, 2, True, None, None)]
    assert capsys.readouterr().out == f"{{'title': 'dome'}} {out}\n"


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (SimulationError("element 7 is inverted at 3 ms"), 1),
        (InputError("is wrong", key="blank.size"), 2),
        (OSError(28, "No space left on device", "forming.nc"), 1),
        (KeyboardInterrupt(), 1),
    ],
)
def test_errors_are_one_message_and_an_exit_code(
    error, code, monkeypatch, scene_file, tmp_path, capsys
):
    def run_scene(*arguments, **options):
        raise error

    stand_in(monkeypatch, "lcmchain.pipeline", run=run_scene)
    out = tmp_path / "deep" / "results"
    found = exit_code("run", scene_file, "--out", out)
    message = capsys.readouterr().err
    assert found == code
    assert message.count("Error:") == 1 and message.startswith("Error: ")
    assert "Traceback" not in message
    assert not (tmp_path / "deep").exists(), "folders made for nothing are removed"


def test_a_failed_run_keeps_what_it_left(monkeypatch, scene_file, tmp_path):
    def run_scene(scene, out, **options):
        (out / "checkpoint.npz").touch()
        raise SimulationError("stopped by a guard")

    stand_in(monkeypatch, "lcmchain.pipeline", run=run_scene)
    assert exit_code("run", scene_file, "--out", tmp_path / "results") == 1
    assert (tmp_path / "results" / "checkpoint.npz").exists()


def test_a_run_that_is_interrupted_after_forming_says_how_it_goes_on(
    monkeypatch, scene_file, tmp_path, capsys
):
    def run_scene(scene, out, **options):
        (out / "checkpoint.npz").touch()
        raise KeyboardInterrupt

    stand_in(monkeypatch, "lcmchain.pipeline", run=run_scene)
    assert exit_code("run", scene_file, "--out", tmp_path / "results") == 1
    message = capsys.readouterr().err
    assert message.startswith("Error: stopped by the user") and "--resume goes on" in message


def test_default_folder_is_named_after_the_scene():
    assert default_out(Path("examples/hemisphere_free/scene.toml")) == Path(
        "results/hemisphere_free"
    )
    assert default_out(Path("dome.toml")) == Path("results/dome")


@contextmanager
def piped(text):
    """Yield the path of a pipe that holds a text, as <(...) of a shell does."""
    reading, writing = os.pipe()
    os.write(writing, text.encode())
    os.close(writing)
    try:
        yield Path(f"/dev/fd/{reading}")
    finally:
        os.close(reading)


SCENE_TEXT = """
process = { time = "1 ms" }
blank = { size = ["4 mm", "4 mm"], edge_length = "2 mm" }
material = { preset = "MD600" }
"""


def test_a_scene_from_a_pipe_is_read_as_often_as_a_command_needs_it(tmp_path, monkeypatch):
    """Files that it names are looked up in the current folder, also by studies."""
    monkeypatch.chdir(tmp_path)
    with piped(SCENE_TEXT) as path:
        first, second = read_scene(path), read_scene(path)
        assert is_scene_file(path)
        study = SceneText.from_file(path)
    assert first.source.text == second.source.text == SCENE_TEXT
    assert study.scene().source.directory == tmp_path
    with piped("title = 1") as path:
        assert not is_scene_file(path)  # another pipe is another text


def test_a_scene_from_a_pipe_is_filled_as_one_of_a_file(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    with piped(SCENE_TEXT) as path:
        assert exit_code("fill", path) == 2
    assert "the scene has no infiltration" in capsys.readouterr().err


@pytest.mark.parametrize("path", ["/dev/stdin", "/dev/fd/63", "/proc/self/fd/0"])
def test_results_of_a_scene_from_a_pipe_have_no_number_for_a_name(path):
    assert default_out(Path(path)) == Path("results/stdin")


def test_existing_results_are_not_touched_by_wrong_input(scene_file, tmp_path, capsys):
    out = tmp_path / "results"
    out.mkdir()
    (out / "forming.nc").write_text("earlier result")
    assert exit_code("run", scene_file, "--out", out, "--set", "process.time=1") == 2
    assert [path.name for path in out.iterdir()] == ["forming.nc"]
    assert (out / "forming.nc").read_text() == "earlier result"


def test_schema_is_json(tmp_path, capsys):
    assert exit_code("schema") == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["title"] == "lcmchain scene"
    assert exit_code("schema", "--out", tmp_path / "schema.json") == 0
    assert json.loads((tmp_path / "schema.json").read_text()) == printed
    assert exit_code("schema", "--out", tmp_path) == 2


def test_map_passes_si_values(monkeypatch, tmp_path, capsys):
    source, target = tmp_path / "forming.nc", tmp_path / "part.vtu"
    source.touch(), target.touch()
    calls = []

    def map_file(source, target, out, options):
        calls.append((out.name, vars(options)))
        error = {"units": "m", "worst": 2e-6, "worst_cell": 7, "root_mean_square": 1e-6}
        return types.SimpleNamespace(
            summary=lambda: "part: 12 cells",
            warnings=["[a] warning"],
            verification={"thickness": {**error, "there_and_back": None}},
        )

    names = {"map_file": map_file, "MappingOptions": types.SimpleNamespace}
    stand_in(monkeypatch, "lcmchain.mapping", **names)
    out = tmp_path / "mapped.nc"
    options = ["--kind", "infiltration", "--maximum-distance", "2 mm", "--length-unit", "mm"]
    options += ["--frame", "3", "--time", "2 ms", "--register", "--verify", "--all-frames"]
    assert exit_code("map", source, target, "--out", out, *options) == 0
    assert calls[0][0] == "mapped.nc"
    assert calls[0][1]["maximum_distance"] == 0.002
    assert calls[0][1]["kind"] == "infiltration" and calls[0][1]["method"] == "overlap"
    assert calls[0][1]["frame"] == 3 and calls[0][1]["time"] == 0.002
    assert all(calls[0][1][name] for name in ("register", "verify", "all_frames"))
    printed = capsys.readouterr().out
    assert "part: 12 cells" in printed and "[a] warning" in printed
    assert "thickness" in printed and "0.002 mm" in printed and "0.001 mm" in printed

    for wrong in (
        ["--kind", "part"],
        ["--method", "nearest"],
        ["--maximum-distance", "2"],
        ["--length-unit", "kg"],
        ["--time", "2"],
    ):
        assert exit_code("map", source, target, "--out", out, *wrong) == 2
        assert wrong[0] in capsys.readouterr().err
    assert exit_code("map", tmp_path / "absent.nc", target, "--out", out) == 2
    assert len(calls) == 1


def test_fmu_build_reads_the_scene_first(monkeypatch, scene_file, tmp_path, capsys):
    calls = []
    stand_in(
        monkeypatch,
        "lcmchain.fmu.build",
        build_fmu=lambda *paths, **options: calls.append((paths, options)),
    )
    assert exit_code("fmu", "build", scene_file, "-o", tmp_path / "dome.fmu") == 0
    ((paths, options),) = calls
    assert paths == (scene_file, tmp_path / "dome.fmu")
    assert (options["fmi"], options["part"], options["pore_pressure"]) == (2, "forming", False)
    assert exit_code("fmu", "build", scene_file, "-o", tmp_path / "dome.zip") == 2
    scene_file.write_text(SCENE.replace('"20 ms"', "20"), encoding="utf-8")
    assert exit_code("fmu", "build", scene_file, "-o", tmp_path / "dome.fmu") == 2
    assert len(calls) == 1


def test_bench_prints_its_table(monkeypatch, capsys):
    def figures(name):
        return lambda json_file: f"{name} to {json_file}"

    stand_in(
        monkeypatch, "lcmchain.bench", run_bench=figures("0.031 us"), run_size_bench=figures("1k"),
        run_effect_bench=figures("gravity"), run_part_bench=figures("gather"),
        run_stack_bench=figures("2 plies"), run_law_bench=figures("locking"),
    )  # fmt: skip
    assert exit_code("bench") == 0
    assert "0.031 us to None" in capsys.readouterr().out
    assert exit_code("bench", "--sizes", "--json", "speed.json") == 0
    assert "1k to speed.json" in capsys.readouterr().out
    assert exit_code("bench", "--effects", "--json", "speed.json") == 0
    assert "gravity to speed.json" in capsys.readouterr().out
    assert exit_code("bench", "--parts") == 0
    assert "gather to None" in capsys.readouterr().out
    assert exit_code("bench", "--stacks", "--json", "speed.json") == 0
    assert "2 plies to speed.json" in capsys.readouterr().out
    assert exit_code("bench", "--laws") == 0
    assert "locking to None" in capsys.readouterr().out


def test_tables_of_speed_are_whole_on_narrow_terminals(monkeypatch, capsys):
    def figures(json_file):
        table = Table("program", "µs")
        table.add_row("CalculiX C3D8R, explicit, of a plate of 1024 hexahedra", "5.58")
        return table

    monkeypatch.setenv("COLUMNS", "40")
    stand_in(monkeypatch, "lcmchain.bench", run_bench=figures, run_size_bench=figures)
    assert exit_code("bench") == 0
    row = capsys.readouterr().out.splitlines()[3]
    assert "explicit, of a plate of 1024 hexahedra" in row and "5.58" in row


# --- check ----------------------------------------------------------------------------------------


def test_check_says_what_is_simulated_and_why(scene_file, tmp_path, capsys):
    assert exit_code("check", scene_file, "--full", "--out", tmp_path / "look") == 0
    printed = capsys.readouterr().out
    assert (tmp_path / "look" / "initial.png").stat().st_size > 10_000
    for text in (
        "Given in the scene", "blank.edge_length", "10 mm",
        "Defaulted", "1.004 mm (preset MD600)", "contact.penalty",
        "friction on punch", "coefficient 0.157", "guided tool holder",
        "touches", "0.996 mm", "elements", "80", "critical time step",
    ):  # fmt: skip
        assert text in printed, text


def test_check_puts_gaps_cost_and_memory_first_and_the_rest_behind_an_option(
    scene_file, tmp_path, capsys
):
    assert exit_code("check", scene_file, "--out", tmp_path / "look") == 0
    printed = capsys.readouterr().out
    order = [printed.index(text) for text in ("Tools at the start", "Expected cost", "memory",
                                              "Simulated: ", "--full", "Picture")]  # fmt: skip
    assert order == sorted(order)
    assert "friction on punch" in printed
    assert "Given in the scene" not in printed and "Defaulted" not in printed


def test_effects_follow_from_the_scene(scene_file):
    from lcmchain.check import run_effects
    from lcmchain.model import build_model

    def active(*overrides):
        scene = read_scene(scene_file, overrides)
        effects = run_effects(scene, build_model(scene))
        return {effect.name for effect in effects if effect.active}

    basic = active()
    assert {"compaction", "bending", "transverse shear", "hourglass control"} <= basic
    assert {"contact with punch", "contact with holder", "friction on punch"} <= basic
    assert "friction on holder" not in basic, "its coefficient is zero"
    assert not {"enhanced strain", "gravity", "mass damping", "permeability"} & basic

    def reason(*overrides):
        scene = read_scene(scene_file, overrides)
        effects = run_effects(scene, build_model(scene))
        return next(effect.reason for effect in effects if effect.name == "bending")

    assert "reference thickness" not in reason()
    assert "reference thickness" in reason("element.bending_thickness=reference")

    assert "gravity" in active("process.gravity=true")
    assert "mass damping" in active("process.mass_damping=50 1/s")
    assert not any("contact" in name or "friction" in name for name in active("tools=[]"))
    steel = (
        'material={law="isotropic", thickness="1 mm", density="7850 kg/m^3",'
        ' young_modulus="210 GPa", poisson_ratio=NU}'
    )
    assert "enhanced strain" in active(steel.replace("NU", "0.3"))
    assert "enhanced strain" not in active(steel.replace("NU", "0.0"))
    assert "compaction" not in active(steel.replace("NU", "0.3"))


def test_estimated_step_is_the_time_of_a_wave_across_an_element(scene_file):
    from lcmchain.check import estimate_run
    from lcmchain.model import build_model

    estimate = estimate_run(build_model(read_scene(scene_file, ["blank.edge_length=5 mm"])))
    share = 1.1**-0.5  # contact as stiff as a tenth of the element
    assert estimate.critical_step == pytest.approx(3.865e-6 * share, abs=0.01e-6)
    assert estimate.step_count == pytest.approx(0.02 / (0.9 * 3.865e-6 * share), rel=0.01)
    assert estimate.controlled_by == "in-plane stiffness"
    thin = read_scene(scene_file, ["material.thickness=0.05 mm", "blank.height=0 mm",
                                   "material.areal_mass=30 g/m^2"])  # fmt: skip
    model = build_model(thin)
    estimate = estimate_run(model)
    # of a face on its springs, and of the holder on those of all faces
    contact = model.environment.penalty * (1.0 / (0.5 * 30e-3) + 0.1 * 0.08 / 1.7)
    wave = (2.0 / 0.05e-3) ** 2 * 0.1563e6 / 600.0
    assert estimate.critical_step == pytest.approx(2.0 / (wave + contact) ** 0.5)
    assert estimate.controlled_by == "compaction (thickness)"


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        (["tools=[]"], "nothing moves"),
        (["tools.holder.motion.direction=[0, 0, 1]"], "points against its direction"),
        (["tools.holder.shape.fillet_radius=2 mm"], 'edge_length = "1.2 mm"'),
        (["tools.holder.shape.fillet_radius=0 mm"], "sharp edge"),
        (["element.compaction_strain=director"], "fold over"),
        (["material.areal_mass=1700 g/m^2"], "more than fibres can be packed to"),
        (["process.mass_scaling={factor=4}", "process.mass_damping=50 1/s"], "drags the sheet 4"),
    ],
)
def test_what_is_probably_not_meant_is_said(overrides, words, scene_file):
    from lcmchain.check import scene_warnings

    assert any(words in warning for warning in scene_warnings(read_scene(scene_file, overrides)))
    regular = scene_warnings(read_scene(scene_file))
    assert not any(words in warning for warning in regular if "long for the fillet" not in warning)


def test_damping_that_is_found_for_a_heavier_sheet_is_not_said_to_drag_it():
    from lcmchain.check import scene_warnings

    text = """
    material = { preset = "MD600" }
    blank = { size = ["60 mm", "60 mm"], edge_length = "10 mm", height = "0.502 mm" }
    process = { mass_scaling = { factor = 4 }MORE }
    [[tools]]
    name = "punch"
    shape = { type = "sphere_capped_punch", radius = "15 mm" }
    position = "0 0 1.004 mm"
    """
    stroke = '{ type = "stroke", direction = [0, 0, -1], distance = "5 mm" }'
    for led in (
        f"motion = {stroke}",
        f'[[stages]]\nname = "press"\nmotions.punch = {stroke}',
    ):
        for more, said in (("", False), (', mass_damping = "50 1/s"', True)):
            told = scene_warnings(scene_from_text(text.replace("MORE", more) + led))
            assert any("drags the sheet" in warning for warning in told) == said


@pytest.mark.parametrize("name", ["hemisphere_holder", "hemisphere_free", "stl_tool"])
def test_examples_can_start(name):
    from lcmchain.check import check_scene

    report = check_scene(read_scene(EXAMPLES / name / "scene.toml"))
    assert not report.warnings
    gaps = {gap.tool: gap.gap for gap in report.gaps}
    start = 0.0 if name != "stl_tool" else 0.096e-3  # exact, though its field rounds the facets
    assert gaps["punch"] == pytest.approx(start, abs=1e-9)
    assert all(abs(gap) < 1e-6 for tool, gap in gaps.items() if tool != "punch")
    assert report.element_count == (1024 if name == "stl_tool" else 3600)
