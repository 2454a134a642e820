"""No call ends a host, whatever its order and its arguments; what is refused changes nothing."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from fmpy import extract
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from lcmchain.fmu.build import build_fmu
from lcmchain.fmu.conduct import Status
from lcmchain.fmu.instances import open_unit

CALLS = Path(__file__).with_name("calls.py")
STEP = 1e-4
BATCH = 50

odd_numbers = st.sampled_from([float("nan"), float("inf"), -float("inf"), 0.0, -1.0, 1e300, 5e-324])
numbers = st.one_of(odd_numbers, st.floats(-1e3, 1e3))
sizes = st.one_of(
    st.just(STEP), st.just(STEP), odd_numbers.filter(lambda x: not x > 1.0), st.just(-STEP)
)
reals = ["punch.velocity_input", "punch.position_input", "holder.force_input", "contact.friction",
         "tools.holder.motion.mass", "punch.travel", "thickness_min", "edge_length", "time",
         "holder.velocity_input", 0, 123456, 2**31 - 1]  # fmt: skip
fields = ["thickness", "shear_angle", "thickness[1]"]  # of one version or the other
others = ["threads", "step_count", "status", "punch.drive", "punch.drive_to_position", "out_dir",
          "message", "scene", "element_count", 99999]  # fmt: skip
names = st.sampled_from([*reals, *others])
kinds = st.sampled_from(["real", "integer", "boolean", "text"])
damages = st.sampled_from(["flip", "cut", "extend", "zeros", "noise", "swap", None])
places = st.integers(1, 20_000)

calls = st.one_of(
    st.tuples(st.just("step")),
    st.tuples(st.just("step"), sizes),
    st.tuples(st.just("step"), sizes, numbers),
    st.sampled_from(
        [
            ("initialize",),
            ("set_up",),
            ("enter",),
            ("leave",),
            ("terminate",),
            ("reset",),
            ("save",),
            ("restore",),
            ("restore", 0),
            ("serialize",),
            ("deserialize",),
        ]
    ),  # fmt: skip
    st.tuples(st.just("set_up"), numbers),
    st.tuples(st.just("set_up"), st.just(0.0), numbers),
    st.tuples(
        st.just("move"),
        st.sampled_from(["Get", "Get", "Set"]),
        st.integers(0, 7),
        st.lists(st.one_of(names, st.sampled_from(fields)), max_size=5),
        st.sampled_from([0, 0, 0, -1, 1, 7, 1150, 5000]),
    ),
    st.tuples(st.just("mode"), st.integers(0, 4)),
    st.tuples(st.just("get"), kinds, names),
    st.tuples(st.just("put"), st.just("real"), st.sampled_from(reals), numbers),
    st.tuples(st.just("put"), st.sampled_from(["integer", "boolean"]), names, st.integers(0, 1)),
    st.tuples(st.just("put"), st.just("text"), names, st.sampled_from(["", "ä", "/proc/none"])),
    st.tuples(st.just("put_bytes"), names),
    st.tuples(st.just("deserialize"), damages, places, st.integers(0, 255)),
)
sequences = st.tuples(
    st.sampled_from([[], [("initialize",)], [("initialize",), ("step",)],
                     [("initialize",), ("step",), ("save",), ("serialize",)]]),
    st.lists(calls, min_size=1, max_size=12),
).map(lambda parts: [*parts[0], *parts[1]])  # fmt: skip
corrupted = st.tuples(damages.filter(bool), places, st.integers(0, 255)).map(
    lambda damage: [
        ("initialize",), ("step",), ("save",), ("serialize",), ("step",),
        ("deserialize", *damage), ("restore",), ("step",), ("save",), ("restore", 0),
        ("step", STEP, STEP), ("serialize",),
    ]
)  # fmt: skip


@pytest.fixture(scope="module", params=[2, 3])
def folder(request, patch_file, tmp_path_factory):
    where = tmp_path_factory.mktemp(f"fmi{request.param}")
    unit = build_fmu(patch_file, where / "patch.fmu", fmi=request.param)
    return extract(str(unit), unzipdir=str(where / "unpacked"))


#: The Python code of a unit is one for both versions; each library has the tests of its own below.
mostly_fmi_3 = pytest.mark.parametrize(
    "folder", [pytest.param(2, marks=pytest.mark.slow), 3], indirect=True, scope="module"
)


def drawn(strategy, count):
    found = []

    @settings(
        max_examples=count, derandomize=True, database=None, phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )  # fmt: skip
    @given(strategy)
    def collect(sequence):
        found.append(sequence)

    collect()
    return found


def run_calls(folder, batch, tmp_path):
    file = tmp_path / "sequences.json"
    file.write_text(json.dumps(batch), encoding="utf-8")
    done = subprocess.run(
        [sys.executable, CALLS, folder, file],
        capture_output=True,
        text=True,
        errors="replace",
        env={**os.environ, "NUMBA_NUM_THREADS": "1"},
    )
    last = [line for line in done.stderr.splitlines() if line.startswith("sequence ")][-1:]
    told = f"{last}: {batch[int(last[0].split()[1])] if last else ''}\n{done.stderr[-3000:]}"
    assert done.returncode == 0, f"ended with {done.returncode} in {told}"
    answer = json.loads(done.stdout.splitlines()[-1])
    assert answer["end"] == "done"
    return answer["results"]


def run_all(folder, strategy, count, tmp_path):
    """Run sequences in batches; return all results. None is fatal."""
    found = drawn(strategy, count)
    assert len(found) >= 0.9 * count
    results = []
    for first in range(0, len(found), BATCH):
        results += run_calls(folder, found[first : first + BATCH], tmp_path)
    statuses = {call["status"] for sequence in results for call in sequence}
    assert statuses == {0, 2, 3}, "some succeed, some steps are discarded, some calls are refused"
    return found, results


@pytest.mark.parametrize(
    "count", [12, pytest.param(1100, marks=pytest.mark.slow)]
)  # 1,100 for each version of FMI
def test_random_calls_end_no_host_and_break_no_instance(folder, count, tmp_path):
    """Each is an error exactly if it was refused: with wrong references, types, counts it is."""
    run_all(folder, sequences, count, tmp_path)


@mostly_fmi_3
@pytest.mark.parametrize("count", [8, pytest.param(500, marks=pytest.mark.slow)])
def test_corrupted_states_are_refused(folder, count, tmp_path):
    found, results = run_all(folder, corrupted, count, tmp_path)
    assert any(calls[5][1] == "flip" for calls in found)
    for sequence in results:
        assert sequence[6]["refused"], "a damaged state must not be taken"
        assert [sequence[k]["status"] for k in (7, 10)] == [2, 0]


# --- single rules, all in one process -------------------------------------------------------------

IN_ORDER = [
    ("set_up",), ("put", "real", "contact.friction", 0.2), ("enter",),
    ("put", "boolean", "punch.drive", 1), ("leave",), ("step",), ("save",), ("serialize",),
    ("put", "real", "punch.velocity_input", 0.02), ("step",), ("deserialize",), ("restore",),
    ("restore", 0), ("get", "real", "thickness_min", "punch.travel"), ("terminate",),
]  # fmt: skip

# A call that is refused between two steps, and what the next step says of it.
REFUSED = [
    (("put", "real", "punch.travel", 1.0), "punch.travel cannot be set"),
    (("put", "real", "edge_length", 1.0), "edge_length cannot be set"),
    (("put", "real", 123456, 1.0), "no Real variable has the value reference 123456"),
    (("put", "real", "contact.friction", 0.1), "cannot be set after initialization"),
    (("enter",), "it was asked to enter initialization mode, but it is between steps"),
]
NO_STEPS = [float("nan"), float("inf"), 0.0, -STEP]

SEQUENCES = [
    IN_ORDER,
    *[
        [("initialize",), ("step",), call, ("step",), ("get", "text", "message"), ("step",)]
        for call, _ in REFUSED
    ],
    *[
        [("initialize",), ("step",), ("step", value), ("step", STEP, value or 1.0), ("step",)]
        for value in NO_STEPS
    ],
    [("put_bytes", "out_dir"), ("initialize",), ("step",), ("get", "text", "message"), ("step",)],
    [("put", "text", "out_dir", "/proc/none"), ("initialize",), ("step",), ("step",),
     ("get", "real", "thickness_min"), ("get", "text", "message"), ("terminate",)],
    [("put", "real", "contact.friction", -1.0), ("initialize",), ("step",),
     ("get", "text", "message"), ("reset",), ("initialize",), ("step",)],
]  # fmt: skip


@pytest.fixture(scope="module")
def rules(folder, tmp_path_factory):
    return run_calls(folder, SEQUENCES, tmp_path_factory.mktemp("rules"))


def statuses_of(results):
    return [call["status"] for call in results]


def test_calls_in_order_all_succeed(rules):
    assert set(statuses_of(rules[0])) == {0}
    assert not any(call["refused"] for call in rules[0])
    assert rules[0][-2]["answer"][1] == 0.0  # the drive was on, its velocity 0


@pytest.mark.parametrize("number", range(len(REFUSED)), ids=[told for _, told in REFUSED])
def test_a_refused_call_stops_the_next_step_once(rules, number):
    """A master may not have looked at the status; the step after that goes on."""
    results = rules[1 + number]
    assert results[2]["refused"] and results[2]["status"] == 3
    assert [results[k]["status"] for k in (1, 3, 5)] == [0, 2, 0]
    assert REFUSED[number][1] in results[4]["answer"][0]


def test_an_experiment_that_ends_before_it_starts_is_refused(folder):
    unit = open_unit(f"{folder}/resources", "one", lambda *_: None, arrays=False)
    assert unit.set_up(5.0, 1.0) is Status.ERROR
    assert unit.set_up(5.0, 5.0) is Status.OK


@pytest.mark.parametrize("number", range(len(NO_STEPS)), ids=map(str, NO_STEPS))
def test_a_step_without_sense_is_discarded(rules, number):
    assert statuses_of(rules[1 + len(REFUSED) + number]) == [0, 0, 2, 2, 0]


def test_a_text_that_is_no_utf8_is_refused(rules):
    results = rules[-3]
    assert results[0]["refused"] and results[0]["answer"] == 3
    assert [results[k]["status"] for k in (2, 4)] == [2, 0]
    assert "no text in UTF-8" in results[3]["answer"][0]


def test_initialization_that_fails_is_told_by_every_step(rules):
    results = rules[-2]
    assert statuses_of(results) == [0, 3, 2, 2, 0, 0, 0]
    assert "out_dir" in results[5]["answer"][0]


def test_a_parameter_that_makes_no_sense_is_told_and_a_reset_heals(rules):
    results = rules[-1]
    assert [results[k]["status"] for k in (2, 6)] == [2, 0]
    assert "contact.friction" in results[3]["answer"][0]


def test_a_text_with_the_name_of_a_folder_that_is_no_utf8_can_be_handed_on(folder):
    """The exporters end the host at a text that they cannot encode."""
    told = []
    unit = open_unit(
        f"{folder}/resources", "one", lambda status, category, text: told.append(text), arrays=False
    )
    unit.refuse("the folder a\udcffb", changes=False)
    unit.message = "the folder a\udcffb"
    reference = unit.layout.slots["message"].start
    assert [*told, *unit.get_texts([reference])] == ["one: the folder a\\udcffb"] + [
        "the folder a\\udcffb"
    ]


# --- Ctrl-C ---------------------------------------------------------------------------------------

HOST = """
import signal, sys, time
# A shell that starts tests in the background has it ignored.
signal.signal(signal.SIGINT, signal.default_int_handler)
sys.path.insert(0, {here!r})
from calls import Driver
driver = Driver({folder!r})
driver.set_up()
driver.put("text", "out_dir", {out!r})
driver.enter(); driver.leave(); driver.step()
print("ready", flush=True)
statuses = []
try:
    while 2 not in statuses:
        try:
            driver.step(1e-5)
            statuses.append(0)
        except Exception as error:
            statuses.append(error.status)
except KeyboardInterrupt:
    print("the host's own code was interrupted", flush=True)
driver.get("real", "thickness_min")
driver.terminate()
driver.free()
print("ended", flush=True)
"""


@mostly_fmi_3
@pytest.mark.parametrize(
    "moment", [0.0071, *[pytest.param(0.0037 * k, marks=pytest.mark.slow) for k in range(15)]]
)
@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_interrupt_ends_no_host(folder, tmp_path, moment):
    """The host exits as it wants to, and its results are kept."""
    program = HOST.format(here=str(CALLS.parent), folder=str(folder), out=str(tmp_path))
    host = subprocess.Popen(
        [sys.executable, "-P", "-c", program],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    line = ""
    while "ready" not in line:  # messages of the unit's log come before
        line = host.stdout.readline()
        assert line, host.stderr.read()
    time.sleep(moment)
    os.kill(host.pid, signal.SIGINT)
    try:
        out, err = host.communicate(timeout=120)
    finally:
        host.kill()
    assert out.splitlines()[-1:] == ["ended"], err
    assert "interrupted" in out + err
    assert (tmp_path / "forming.nc").is_file()
    assert host.returncode == 0, err


@pytest.mark.skipif(sys.platform != "linux", reason="reads the memory map of Linux")
def test_nothing_of_the_exporter_is_left_to_destructors(folder):
    """They would run after its memory was given back: processes aborted after their end."""
    program = Path(__file__).with_name("exporter_pointer.py")
    done = subprocess.run([sys.executable, program, folder], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    held, at_the_end = done.stdout.splitlines()
    assert int(held) > 0
    assert at_the_end == "None"


@pytest.mark.parametrize("count", [30, pytest.param(200, marks=pytest.mark.slow)])
@pytest.mark.skipif(sys.platform != "linux", reason="reads the memory of Linux processes")
def test_instances_leave_no_memory_behind(folder, tmp_path, count):
    """Of 25 kB that each left once, 200 may leave 1 MB, and 30 half of it: they left 0.75 MB."""
    program = Path(__file__).with_name("cycles.py")
    done = subprocess.run(
        [sys.executable, program, folder, str(count), tmp_path],
        capture_output=True,
        text=True,
        env={**os.environ, "NUMBA_NUM_THREADS": "1"},
    )
    assert done.returncode == 0, done.stderr
    assert int(done.stdout.splitlines()[-1]) < 1e6 * max(count / 200, 0.5)
    assert (tmp_path / "forming.nc").is_file()
