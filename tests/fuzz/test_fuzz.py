"""The short version of the fuzzer, and that it sees what it is for."""

import sys
from collections import Counter
from pathlib import Path

import pytest

from lcmchain.errors import InputError

FOLDER = str(Path(__file__).parent)
#: Kind -> number of cases: a few hundred in a few seconds. `run.py` makes as many as wanted.
CASES = {
    "scenes": 50, "overrides": 50, "csvs": 6, "meshes": 20, "fillings": 20, "checkpoints": 40,
}  # fmt: skip


@pytest.fixture(scope="module", autouse=True)
def on_the_path():
    """The modules of the fuzzer stand beside each other, as a script's."""
    sys.path.insert(0, FOLDER)
    yield
    sys.path.remove(FOLDER)


@pytest.mark.parametrize("kind", CASES)
def test_wrong_input_ends_in_one_message(kind, tmp_path, monkeypatch):
    from run import Fuzzer

    monkeypatch.setattr("lcmchain.check.report.draw_start", lambda *arguments, **named: None)
    fuzzer = Fuzzer(kind, 20, tmp_path)
    verdicts, failed = Counter(), []
    for number in range(CASES[kind]):
        case, outcome = fuzzer.run(number)
        verdicts[outcome.verdict.value] += 1
        if outcome.failed:
            failed.append(f"{kind}:{number} {outcome.verdict.value}: {case.what}\n{outcome.detail}")
    assert not failed, "\n\n".join(failed)
    assert verdicts["refused"] >= CASES[kind] // 4
    assert kind == "checkpoints" or verdicts["valid"] > 0


def refuse(message):
    def call():
        raise InputError(message)

    return call


def crash():
    raise IndexError


def hang():
    while True:
        pass


@pytest.mark.parametrize(
    ("call", "options", "verdict"),
    [
        (refuse("blank.size: too small"), {}, "refused"),
        (lambda: None, {}, "valid"),
        (crash, {}, "traceback"),
        (hang, {}, "hang"),
        (refuse("something is wrong"), {}, "bad message"),
        (refuse("blank: Error: twice"), {}, "bad message"),
        (lambda: None, {"must_refuse": True}, "silent error"),
        (lambda: None, {"check": lambda: "not one cell is mapped"}, "silent error"),
    ],
)
def test_the_fuzzer_tells_what_it_sees(call, options, verdict, monkeypatch):
    import contract

    monkeypatch.setattr(contract, "TIME_LIMIT", 0.2)
    outcome = contract.judge(contract.Case((), "a case", call=call, **options))
    assert outcome.verdict.value == verdict
    assert outcome.failed == (verdict not in ("valid", "refused"))


def test_what_a_refused_call_leaves_behind_is_seen(tmp_path):
    from contract import Case, judge

    def call():
        (tmp_path / "half").write_text("half a file")
        raise InputError("wrong", key="blank")

    assert judge(Case((), "a case", out=tmp_path, call=call)).verdict.value == "left behind"


def test_a_case_can_be_made_again(tmp_path):
    """From its kind, the seed and its number alone."""
    from run import Fuzzer

    first, second = (Fuzzer("overrides", 3, tmp_path / name) for name in "ab")
    for number in (5, 6):
        second.run(number)
    case, outcome = first.run(6)
    again, same = second.run(6)
    assert (case.what, outcome.verdict) == (again.what, same.verdict)
    scenes = [(tmp_path / name / "scene.toml").read_bytes() for name in "ab"]
    assert scenes[0] == scenes[1]
