"""README and manual: length, links, and commands that exist."""

from __future__ import annotations

import ast
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from typing import get_args

import pytest
import typer

from lcmchain.cli import app
from lcmchain.interfaces.table import AnyInterfaceLaw
from lcmchain.manual.contents import FOLDER, TOPICS, read_page
from lcmchain.manual.markdown import render
from lcmchain.scene import read_scene, scene_from_text

ROOT = Path(__file__).resolve().parents[2]

pytestmark = pytest.mark.skipif(
    not (ROOT / "pyproject.toml").is_file(), reason="needs the checkout, not only the tests"
)

LONGEST_README = 130
GENERATED = {"commands"}  # usage lines with brackets, made from the commands themselves


def texts() -> dict[str, str]:
    files = [ROOT / "README.md", *sorted(ROOT.glob("examples/*/README.md"))]
    files += [FOLDER / f"{topic}.md" for topic in TOPICS if topic not in GENERATED]
    return {f"{file.parent.name}/{file.name}": file.read_text("utf-8") for file in files}


def command_lines(text: str) -> list[str]:
    """Commands of lcmchain in code blocks (fenced or indented) and in running code."""
    lines = re.findall(r"^(?: {4})?(?:.* && )?(?:\.venv/bin/)?(lcmchain .*)$", text, re.MULTILINE)
    without_blocks = re.sub(r"```.*?```", "", text, flags=re.DOTALL)
    lines += [" ".join(code.split()) for code in re.findall(r"`(lcmchain\s[^`]+)`", without_blocks)]
    return lines


def parse(line: str) -> None:
    """Parse a command line as the program does; a command that is only named needs no more."""
    words = shlex.split(line, comments=True)[1:]
    command = typer.main.get_command(app)
    context = None
    while hasattr(command, "commands"):
        # A command takes from its group what help is called, and keeps it.
        context = command.context_class(command, context, command.name, **command.context_settings)
        name = words.pop(0)
        assert name in command.commands, f"no command {name}"
        command = command.commands[name]
        if not words:
            return
    command.make_context(command.name, words, parent=context)


# --- README ---------------------------------------------------------------------------------------


def test_the_readme_can_be_read_in_five_minutes():
    assert len((ROOT / "README.md").read_text("utf-8").splitlines()) <= LONGEST_README


def test_links_of_the_readme_resolve():
    rendered = render((ROOT / "README.md").read_text("utf-8"))
    assert len(rendered.links) > 10 and rendered.pictures
    for target in [*rendered.links, *rendered.pictures]:
        file, _, anchor = target.partition("#")
        assert (ROOT / file).is_file(), target
        if anchor:
            headings = render((ROOT / file).read_text("utf-8")).headings
            assert anchor in [heading.anchor for heading in headings], target


def test_the_scene_of_the_readme_is_a_scene():
    (block,) = re.findall(r"```toml\n(.*?)```", (ROOT / "README.md").read_text("utf-8"), re.DOTALL)
    assert len(block.splitlines()) <= 15
    assert [tool.name for tool in scene_from_text(block).tools] == ["punch", "die"]


# --- commands -------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", texts())
def test_commands_parse(name):
    for line in command_lines(texts()[name]):
        parse(line)


def test_the_texts_name_commands_at_all():
    assert sum(len(command_lines(text)) for text in texts().values()) > 50
    assert command_lines("a && .venv/bin/lcmchain run x.toml\n") == ["lcmchain run x.toml"]
    assert command_lines("    lcmchain bench\n`lcmchain\ncheck`") == [
        "lcmchain bench",
        "lcmchain check",
    ]


@pytest.mark.parametrize(
    "line", ["lcmchain nonsense", "lcmchain verify tables", "lcmchain run a.toml --nonsense"]
)
def test_a_wrong_command_is_seen(line):
    with pytest.raises(Exception, match="no command|[Nn]o such option"):
        parse(line)


def test_scenes_and_overrides_in_the_commands_are_right():
    checked = 0
    for text in texts().values():
        for line in command_lines(text):
            words = shlex.split(line, comments=True)
            if words[1] not in ("run", "check") or len(words) < 3 or "examples/" not in words[2]:
                continue
            overrides = [after for word, after in zip(words, words[1:]) if word == "--set"]
            read_scene(ROOT / words[2], overrides)
            checked += 1
    assert checked > 10


def test_scripts_and_tests_named_in_the_texts_exist():
    for name, text in texts().items():
        for path in re.findall(r"(?:python|pytest) ((?:examples|tests)/[\w/.-]*\w)", text):
            assert (ROOT / path).exists(), f"{name}: {path}"


# --- tutorial -------------------------------------------------------------------------------------


def tutorial_blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", read_page("tutorial").text, flags=re.DOTALL)


def test_the_scene_of_the_tutorial_is_a_scene(tmp_path):
    scene_text, mapping = tutorial_blocks("toml")
    for file in ("punch.stl", "dome.vtk"):
        (tmp_path / file).write_text("not empty")
    scene = scene_from_text(scene_text + mapping, tmp_path / "scene.toml")
    assert scene.material.name == "my_fabric" and scene.mapping[0].mesh == "dome.vtk"


@pytest.mark.slow
def test_the_tutorial_works_and_its_figures_are_true(tmp_path):
    import json

    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    (tmp_path / "my_part").mkdir()
    (tmp_path / "my_part" / "scene.toml").write_text(tutorial_blocks("toml")[0], encoding="utf-8")
    (script,) = tutorial_blocks("python")
    (tmp_path / "my_part" / "make_mesh.py").write_text(script, encoding="utf-8")
    printed = ""
    for line in "".join(tutorial_blocks("console")).splitlines():
        words = shlex.split(line)
        if words[0] == "mkdir":
            continue
        if words[0] == "lcmchain":
            words = [sys.executable, "-c", "from lcmchain.cli import main; main()", *words[1:]]
        elif words[0] == "python":
            words = [sys.executable, *words[1:]]
        done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, line + "\n" + done.stdout + done.stderr
        printed += done.stdout
    text = " ".join(read_page("tutorial").text.split())
    for law in ("shear", "compaction", "bending"):
        found = (tmp_path / "my_part" / law / "parameters.toml").read_text(encoding="utf-8")
        for entry in [row for row in found.splitlines() if " = " in row and row[0] != "#"]:
            assert entry in text, entry
    summary = json.loads((tmp_path / "my_part" / "results" / "summary.json").read_text())
    assert f"The {summary['step_count']:,} steps of {summary['element_count']:,} elements" in text
    assert f"{summary['shear_angle_max_rad'] * 57.29578:.1f}°" in text
    assert f"{1e3 * summary['thickness_min_m']:.3f} mm" in text
    assert f"{1e3 * summary['thickness_max_m']:.3f} mm" in text
    assert f"with {summary['punch_force_max_N']:.1f} N" in text
    assert summary["warnings"] == []
    mapped = json.loads((tmp_path / "my_part" / "results" / "dome.json").read_text())
    inside, projected = (mapped["status_count"][name] for name in ("inside", "projected"))
    assert inside + projected == 576
    assert f"{inside} inside, {projected} projected" in printed
    assert f"{inside} have their centre within" in text and f"{projected} are projected" in text
    assert f"the farthest over {1e3 * mapped['worst_distance']:.2f} mm" in text
    assert f"{mapped['second_family_error_max'] * 57.29578:.1f}°" in text


def toml_blocks(topic: str) -> list[str]:
    return re.findall(r"```toml\n(.*?)```", read_page(topic).text, re.DOTALL)


def test_the_interface_laws_on_the_page_of_stacks_are_a_scene_and_cover_all_kinds():
    (block,) = [text for text in toml_blocks("stacks") if "laws = [" in text]
    scene = scene_from_text(block)
    words = [interface.in_words() for interface in scene.interfaces]
    assert words == [
        "friction 0.2, film of 50 Pa s, 0.05 mm",
        "friction 0.1 to 0.4 by Hersey number, adhesion 0.01 MPa, on 0.1 mm, off 0.11 mm",
    ]
    section = read_page("stacks").text.split("## Interface laws")[1].split("\n## ")[0]
    kinds = re.findall(r"^\| `(\w+)` \| .* \|$", section, re.MULTILINE)[1:]  # below the head
    tables = get_args(get_args(AnyInterfaceLaw)[0])
    assert kinds == [table.model_fields["type"].default for table in tables]
    # every entry of a law stands in its row
    rows = {row.split("`")[1]: row for row in section.splitlines() if row.startswith("| `")}
    for table in tables:
        kind = table.model_fields["type"].default
        for entry in table.model_fields:
            shared = entry == "tangential_ratio" and kind != "coulomb"
            assert entry == "type" or shared or f"`{entry}`" in rows[kind], (kind, entry)


def test_the_law_of_the_page_on_extending_is_that_of_the_script():
    """But for docstrings; the script has more, as it runs the law."""
    (block,) = re.findall(r"```python\n(.*?)```", read_page("extending").text, re.DOTALL)
    script = (ROOT / "examples/scripts/own_interface.py").read_text("utf-8")

    def statements(text: str) -> list[str]:
        tree = ast.parse(text)
        for node in ast.walk(tree):
            if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef)):
                node.body = [n for n in node.body if not is_docstring(n)]
        return [ast.dump(node) for node in tree.body]

    def is_docstring(node: ast.AST) -> bool:
        return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)

    law = statements(block)
    assert sum("ClassDef" in statement for statement in law) == 2
    assert [statement for statement in statements(script) if statement in law] == law
