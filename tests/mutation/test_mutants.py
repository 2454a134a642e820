"""The list of mutants fits the sources: every text stands where it is said to, once."""

import ast
from pathlib import Path
from runpy import run_path

import pytest

ROOT = Path(__file__).resolve().parents[2]
RUN = run_path(str(Path(__file__).with_name("run.py")))
MUTANTS = RUN["read_mutants"]()

pytestmark = pytest.mark.skipif(
    not (ROOT / "pyproject.toml").is_file(), reason="needs the checkout, not only the tests"
)


@pytest.mark.parametrize("mutant", MUTANTS, ids=lambda mutant: mutant.name)
def test_a_mutant_changes_one_place_and_names_tests_that_exist(mutant):
    text = (ROOT / mutant.file).read_text(encoding="utf-8")
    assert text.count(mutant.old) == 1, "adapt `old` to the present sources"
    assert mutant.new != mutant.old and mutant.breaks
    ast.parse(text.replace(mutant.old, mutant.new))
    assert mutant.tests
    for test in mutant.tests:
        file, *name = test.split("::")
        functions = {
            node.name
            for node in ast.walk(ast.parse((ROOT / file).read_text(encoding="utf-8")))
            if isinstance(node, ast.FunctionDef)
        }
        assert {part.split("[")[0] for part in name} <= functions, test


def test_kernels_are_made_anew_that_call_a_file_by_dispatch_alone(tmp_path):
    """The loop imports the contact between plies by no way but its answers."""
    copy = RUN["Copy"](tmp_path)
    package = tmp_path / "lcmchain"
    between_plies = "solver/interactions/ply_contact.py"
    for file in ("interfaces/refresh.py", "interfaces/rims.py", between_plies):
        assert RUN["COMPILED"].search((package / file).read_text(encoding="utf-8"))
        assert package / "solver/loop.py" in copy.importers_of(package / file)
    assert package / "solver/loop.py" not in copy.importers_of(package / "report/captions.py")


def test_there_are_enough_mutants_in_every_room():
    assert len({mutant.name for mutant in MUTANTS}) == len(MUTANTS) >= 45
    rooms = {mutant.file.rsplit("/", 1)[0] for mutant in MUTANTS}
    assert rooms >= {
        "lcmchain", "lcmchain/solver", "lcmchain/effects", "lcmchain/elements/solid_shell",
        "lcmchain/elements/membrane_shell", "lcmchain/fields", "lcmchain/materials",
        "lcmchain/materials/features",
        "lcmchain/scene", "lcmchain/tools", "lcmchain/identification", "mapping", "fmu", "coupling",
    }  # fmt: skip


def test_the_kept_table_is_that_of_these_mutants():
    """Made anew by ``python tests/mutation/run.py --out tests/mutation/table.md``."""
    table = Path(__file__).with_name("table.md").read_text(encoding="utf-8")
    rows = [line.split(" | ") for line in table.splitlines() if line.startswith("| ")][1:]
    assert [row[0].removeprefix("| ") for row in rows] == [mutant.name for mutant in MUTANTS]
    assert f"{len(MUTANTS)} of {len(MUTANTS)} mutants are noticed" in table
    assert all(".py::" in row[3] for row in rows)
