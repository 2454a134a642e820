"""Loops compiled by two processes: what is told, who compiles what, and what a failure does."""

import os
import re
import subprocess
import sys
import types
import warnings

import pytest
from numba import njit

from lcmchain.solver import compile_beside
from lcmchain.solver.compile_beside import Account, Helper, HelperWarning, compile_loops

NAMES = ["steps", "frequency", "contact", "energies"]


class State:
    def copy(self):
        return self


class Loops:
    """In place of a simulation: four functions that numba compiles, and who was called."""

    model = None
    state = State()

    def __init__(self, after_steps):
        self.called, self.after_steps = [], after_steps

    def first_calls(self):
        return {name: self._call_of(name) for name in NAMES}

    def _call_of(self, name):
        @njit
        def loop(x):
            return x + 1

        def call():
            self.called.append(name)
            loop(1)
            if name == "steps":
                self.after_steps()

        return call

    def prepare_steps(self):
        self.called.append("prepare_steps")

    def restore(self, before):
        self.called.append("restore")


@pytest.fixture
def compiled(monkeypatch):
    """Compile the loops beside a process that runs this program, and say what was told."""
    monkeypatch.setattr(compile_beside, "_cores", lambda: 2)
    monkeypatch.setattr(compile_beside, "REPORT_INTERVAL", 0.0)

    def compile_beside_program(program, *, wait=False):
        def wait_for_the_other():
            while wait and not helper._loops_done.wait(0.02):
                helper._account.report()

        loops, told = Loops(wait_for_the_other), []
        monkeypatch.setattr(compile_beside, "PROGRAM", program)
        with Helper() as helper:
            compile_loops(loops, told.append, helper)
        return loops.called, told

    return compile_beside_program


#: Takes the loops as the second process does, and says that it compiles those it is told to.
PROGRAM = """
import json, pathlib, pickle, sys, time
sys.stdin.buffer.readline()
folder, _, names, _ = pickle.load(sys.stdin.buffer)
for index, name in enumerate(names[:{count}]):
    (pathlib.Path(folder) / str(index)).touch(exist_ok=False)
    print("begin", name, flush=True)
    time.sleep(0.5)
    print("end", name, flush=True)
{end}
"""


def test_the_account_tells_what_is_being_compiled_and_how_much_is_done():
    told = []
    account = Account(NAMES, told.append)
    with account.at_work_on("steps"):
        account.report()
        account.report()  # too soon
        with account.at_work_on("contact"):
            account._reported -= compile_beside.REPORT_INTERVAL
            account.report()
    account._reported -= compile_beside.REPORT_INTERVAL
    account.report()
    assert told == [
        "compiling, 0 of 4 loops done, now steps",
        "compiling, 0 of 4 loops done, now steps and contact",
        "compiling, 2 of 4 loops done",
    ]


def test_what_one_process_takes_the_other_leaves(compiled):
    """The first begins with the steps and goes on from the end; it reads the rest at last."""
    called, told = compiled(
        PROGRAM.format(count=2, end="print('loops done', flush=True)"), wait=True
    )
    assert called == [
        "steps", "energies", "frequency", "contact", "prepare_steps", "restore",
    ]  # fmt: skip
    assert "compiling, 0 of 4 loops done, now steps and frequency" in told
    assert "compiling, 1 of 4 loops done, now steps and contact" in told
    assert told[-1] == "compiling, 4 of 4 loops done"


@pytest.mark.parametrize(
    ("end", "reason"),
    [
        ("raise MemoryError('no memory left')", "MemoryError: no memory left"),
        ("import os; os._exit(7)", "exit code 7"),
    ],
)
def test_a_second_process_that_fails_is_told_and_not_missed(compiled, end, reason):
    with pytest.warns(HelperWarning, match=re.escape(f"failed ({reason})")):
        called, told = compiled(PROGRAM.format(count=1, end=end))
    assert sorted(called) == sorted([*NAMES, "prepare_steps", "restore"])
    alone = [text for text in told if text.startswith("compiling alone, ")]
    assert len(alone) == 1 and reason in alone[0]


def test_a_second_process_that_cannot_be_started_is_told(compiled, monkeypatch):
    def no_process(*_, **__):
        raise OSError("no more processes")

    monkeypatch.setattr(compile_beside.subprocess, "Popen", no_process)
    with pytest.warns(HelperWarning, match=r"failed \(OSError: no more processes\)"):
        called, _ = compiled("")
    assert sorted(called) == sorted([*NAMES, "prepare_steps", "restore"])


@pytest.mark.parametrize(
    ("cores", "executable"), [(1, "/usr/bin/python3"), (2, "/usr/bin/modelica"), (2, None)]
)
def test_no_process_is_started_on_one_core_or_inside_another_program(
    compiled, monkeypatch, cores, executable
):
    monkeypatch.setattr(compile_beside.subprocess, "Popen", None)  # would be told as a failure
    monkeypatch.setattr(compile_beside, "_cores", lambda: cores)
    monkeypatch.setattr(compile_beside.sys, "executable", executable)
    with warnings.catch_warnings():
        warnings.simplefilter("error", HelperWarning)
        called, told = compiled("")
    assert called == ["steps", "energies", "contact", "frequency", "prepare_steps", "restore"]
    assert "compiling, 0 of 4 loops done, now steps" in told


def test_no_process_is_started_where_the_steps_are_on_disk(compiled, monkeypatch):
    """What is left is compiled sooner than a second process begins."""
    monkeypatch.setattr(compile_beside.subprocess, "Popen", None)  # would be told as a failure
    call_of = Loops._call_of
    on_disk = {"steps"}
    monkeypatch.setattr(
        Loops,
        "_call_of",
        lambda self, name: (
            (lambda: self.called.append(name)) if name in on_disk else call_of(self, name)
        ),
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error", HelperWarning)
        called, told = compiled("")
        assert called == ["steps", "energies", "contact", "frequency", "prepare_steps", "restore"]
        assert told[0] == "compiling, 1 of 4 loops done, now energies"
        on_disk.update(NAMES)
        assert compiled("") == (called, [])


def test_leaving_the_context_ends_the_process_and_removes_its_folder(monkeypatch):
    monkeypatch.setattr(compile_beside, "_cores", lambda: 2)
    monkeypatch.setattr(compile_beside, "PROGRAM", "import time; time.sleep(600.0)")
    with pytest.raises(KeyboardInterrupt), Helper() as helper:
        helper.start(types.SimpleNamespace(model=None, state=None), NAMES, Account(NAMES, print))
        process, folder = helper._process, helper._folder.name
        assert process.poll() is None and os.path.isdir(folder)
        raise KeyboardInterrupt
    assert process.poll() is not None and not os.path.exists(folder)


@pytest.mark.parametrize(("threads", "goes_on"), [(1, True), (2, False)])
def test_it_goes_on_only_where_the_steps_leave_a_core(monkeypatch, tmp_path, threads, goes_on):
    monkeypatch.setattr(compile_beside, "_cores", lambda: 2)
    monkeypatch.setattr(compile_beside, "thread_count", lambda: threads)
    program = (
        "import pickle, sys; sys.stdin.buffer.readline(); "
        "content = pickle.load(sys.stdin.buffer)[3]; "
        f"open({str(tmp_path / 'later')!r}, 'w').write(repr(pickle.loads(content)[2]))"
    )
    monkeypatch.setattr(compile_beside, "PROGRAM", program)
    with Helper(later=os.path.join) as helper:
        helper.start(types.SimpleNamespace(model=None, state=None), NAMES, Account(NAMES, print))
        helper.wait()
    assert ("join" in (tmp_path / "later").read_text()) is goes_on


def test_a_first_process_that_is_killed_takes_the_second_one_along(tmp_path):
    program = (
        "import os, sys, threading; from lcmchain.solver import compile_beside; "
        "threading.Thread(target=compile_beside._end_with_the_first, daemon=True).start(); "
        "print('alive', flush=True); threading.Event().wait(60.0); print('left behind')"
    )
    second = subprocess.Popen(
        [sys.executable, "-c", program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert second.stdout.readline() == "alive\n" and second.poll() is None
    second.stdin.close()  # as the end of the first does
    assert second.stdout.read() == "" and second.wait(30.0) == 1
    second.stdout.close()


def test_a_model_of_classes_of_the_script_is_compiled_alone(compiled, monkeypatch):
    """Another process could not import them: it is not started, and nothing is warned of."""
    own = type("Own", (), {"__module__": "__main__", "__qualname__": "Own"})
    monkeypatch.setattr(sys.modules["__main__"], "Own", own, raising=False)
    monkeypatch.setattr(Loops, "model", own())
    with warnings.catch_warnings():
        warnings.simplefilter("error", HelperWarning)
        called, _ = compiled("raise SystemExit(3)")
    assert called[: len(NAMES)] == ["steps", *reversed(NAMES[1:])]
