"""Units in processes of their own: the same bits, and a unit that is lost takes nothing along."""

import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from lcmchain.coupling.cosimulation import assembly as assembly_module
from lcmchain.coupling.cosimulation import run as run_module
from lcmchain.coupling.cosimulation import stopping
from lcmchain.coupling.cosimulation.process_instance import ProcessInstance
from lcmchain.coupling.cosimulation.run import CHECKPOINT, run_system
from lcmchain.coupling.cosimulation.system_file import system_from
from lcmchain.coupling.cosimulation.temporary_folder import temporary_folder
from lcmchain.errors import InputError, SimulationError, SimulationInterrupted

EXIT, EXIT_0, ABORT, CRASH, HANG, CHILD = 1, 2, 3, 4, 5, 6
READING = 10

pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")


def trouble(how, when="250 ms", version=2, **options):
    return {
        "stop_time": "1 s", "window": "100 ms", "connections": ["foot.y -> bad.push"],
        "units": [
            {"name": "foot", "fmu": "Follower_2.fmu", "start": {"shift": 2.5}},
            {"name": "bad", "fmu": f"Trouble_{version}.fmu", "process": "own",
             "start": {"how": float(how), "when": when}, **options},
        ],
        "scheme": {"type": "gauss-seidel"},
    }  # fmt: skip


def run(units, folder, data):
    return run_system(system_from(data, None, directory=units), folder)


@pytest.fixture
def temporary(tmp_path, monkeypatch):
    """A folder of its own for temporary files, which must be empty in the end."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setenv("TMPDIR", str(folder))
    monkeypatch.setattr(tempfile, "tempdir", None)
    yield folder
    assert list(folder.glob("lcmchain-*")) == []


@pytest.mark.parametrize(
    "how, version, words",
    [
        (EXIT, 2, "its process ended with exit code 3"),
        (EXIT_0, 3, "its process ended with exit code 0"),
        (ABORT, 2, r"its process ended by signal 6 \(Aborted\)"),
        (CRASH, 3, r"its process ended by signal 11 \(Segmentation fault\)"),
        (CHILD, 2, "its process ended with exit code 4"),
    ],
)
def test_a_unit_that_is_lost_is_told_with_time_and_inputs(
    units, tmp_path, temporary, how, version, words
):
    with pytest.raises(SimulationError, match=words) as caught:
        run(units, tmp_path / "out", trouble(how, version=version))
    message = str(caught.value)
    for part in ('part "bad" failed at 0.2 s, step 0.1 s', "in a step", "push 2.5 to 2.5"):
        assert part in message, message
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["state"].startswith('stopped: coupled part "bad" failed')
    assert (summary["units"]["bad"]["process"], summary["time_reached_s"]) == ("own", 0.2)
    with xr.open_dataset(tmp_path / "out" / "cosimulation.nc") as record:
        assert record["time"].values == pytest.approx([0.0, 0.1, 0.2])
        assert record.attrs["state"] == summary["state"]


def test_a_unit_that_hangs_is_ended_after_its_limit(units, tmp_path, temporary):
    data = trouble(HANG, step_limit="0.5 s") | {"connections": []}
    data["units"][1]["start"]["push"] = 1.5  # what it was given last stands in the message
    with pytest.raises(SimulationError, match=r"did not come back within 0\.5 s in a step") as told:
        run(units, tmp_path / "out", data)
    assert "longer step_limit" in str(told.value) and "push 1.5 to 1.5" in str(told.value)


def test_a_unit_may_be_lost_before_the_first_step(units, tmp_path, temporary):
    with pytest.raises(SimulationError, match='"bad".*"y".*ended with exit code 3.*were read'):
        data = trouble(READING + EXIT) | {"connections": ["bad.y -> foot.x_in"]}
        run(units, tmp_path / "out", data)
    data = trouble(EXIT)
    data["units"][1]["fmu"] = "Bad.fmu"
    (tmp_path / "Bad.fmu").write_bytes(_crashing_at_its_birth(units, tmp_path))
    (tmp_path / "Follower_2.fmu").write_bytes((units / "Follower_2.fmu").read_bytes())
    with pytest.raises(SimulationError, match='"bad" is lost: .*instantiated'):
        run(tmp_path, tmp_path / "other", data)
    assert not (tmp_path / "other").exists()


def _crashing_at_its_birth(units, folder):
    from dataclasses import replace

    import models
    from unit_builder import build

    model = replace(models.TROUBLE, name="Born", begin="abort();")
    return build(model, 2, folder).read_bytes()


PAIR = {
    "stop_time": "1 s", "window": "0.25 s",
    "units": [
        {"name": "one", "fmu": "Field_2.fmu", "start": {"a": 0.9, "b": 0.3, "c": 1.0}},
        {"name": "two", "fmu": "Field_3.fmu", "start": {"a": -2.0, "b": 0.3, "c": 0.5}},
        {"name": "count", "fmu": "Counter_2.fmu"},
        {"name": "other", "fmu": "Counter_3.fmu"},
    ],
    "connections": [
        "one.y -> two.x_in", "two.y -> one.x_in", "count.word -> other.word_in",
        "count.count -> other.count_in", "other.on -> count.on_in",
    ],
    "scheme": {"type": "iqn-ils", "relative": 1e-12, "most_iterations": 60},
}  # fmt: skip


def test_a_process_of_its_own_changes_no_bit(units, tmp_path, temporary):
    """Fields, texts, whole numbers and switches, with states saved and restored."""
    records, summaries = [], []
    for process in ("shared", "own"):
        data = json.loads(json.dumps(PAIR))
        for unit in data["units"]:
            unit["process"] = process
        folder = tmp_path / process
        summaries.append(run(units, folder, data))
        records.append({name: xr.load_dataset(folder / "cosimulation.nc", group=name)
                        for name in ("one", "two", "count", "other", "coupling")})  # fmt: skip
    shared, own = records
    for group, values in shared.items():
        for name in values:
            assert np.array_equal(
                values[name].values, own[group][name].values,
                equal_nan=values[name].dtype.kind == "f",
            ), (group, name)  # fmt: skip
    assert shared["other"]["seen_word"].values[-1] == "step 4"
    assert summaries[0]["system_sha256"] == summaries[1]["system_sha256"]
    assert summaries[1]["iteration_count"] > 8  # so that states were gone back to
    counts = [summary["units"]["one"]["rollback_count"] for summary in summaries]
    assert counts[0] == counts[1] > 0


def test_states_are_given_back_with_the_next_call(units, assembled):
    data = trouble(0)
    data["units"][1] = {"name": "bad", "fmu": "Field_2.fmu", "process": "own"}
    assembly = assembled(data | {"connections": []})
    part = assembly.parts["bad"]
    part.set_fields({"x_in": np.arange(40.0)})
    saved = part.save()
    content = part.serialised(saved)
    part.advance(0.1)
    first = part.get_fields(["y", "sum"])
    part.restore(saved)
    part.set_fields({"x_in": np.arange(40.0)})
    part.advance(0.1)
    assert np.array_equal(part.get_fields(["y"])["y"], first["y"])
    del saved
    assert part.instance._released == [1]
    part.restore(content)
    assert part.instance._released == [2]  # the first was brought, the second is that of a file
    part.advance(0.1)
    assert np.array_equal(part.get_fields(["sum"])["sum"], first["sum"])


def test_units_by_others_get_a_process_and_own_ones_share_that_of_the_command(
    units, assembled, monkeypatch
):
    monkeypatch.setattr(assembly_module, "OWN_TOOL", "lcmchain ")
    data = {
        "stop_time": "1 s", "window": "100 ms",
        "units": [{"name": "ball", "fmu": "Ball_2.fmu"}],
    }  # fmt: skip
    part = assembled(data).parts["ball"]
    assert part.apart and isinstance(part.instance, ProcessInstance)
    assert part.instance._process.poll() is None
    monkeypatch.setattr(assembly_module, "OWN_TOOL", part.description.generation_tool)
    assert not assembled(data).parts["ball"].apart
    data["units"][0]["step_limit"] = "1 s"
    with pytest.raises(InputError, match=r'units\.ball\.step_limit: .* process = "own"'):
        assembled(data)
    data["units"][0]["process"] = "shared"
    with pytest.raises(InputError, match='only a unit with process = "own"'):
        assembled(data)


def test_a_refused_step_and_the_words_of_a_unit_come_through(units, tmp_path):
    data = {
        "stop_time": "1 s", "window": "100 ms",
        "units": [{"name": "ball", "fmu": "Ball_3.fmu", "process": "own",
                   "start": {"largest_step": "30 ms"}}],
    }  # fmt: skip
    with pytest.raises(SimulationError, match="refused the step and came to 0.03 s"):
        run(units, tmp_path / "out", data)
    log = (tmp_path / "out" / "lcmchain.log").read_text()
    assert "unit ball: discard [model]: the step is too long" in log
    data["units"][0]["start"] = {"ending_time": "300 ms"}
    with pytest.raises(SimulationError, match=r"asked for the end .* at 0\.3 s"):
        run(units, tmp_path / "end", data)


def test_the_record_grows_on_disk(units, tmp_path, monkeypatch):
    """What is on disk while the run is at work, in which every window is written."""
    monkeypatch.setattr(run_module, "RECORD_INTERVAL", 0.0)
    monkeypatch.setattr(run_module, "RECORD_SHARE", 1e9)
    seen, folder = [], tmp_path / "out"

    def progress(time, total, text):
        if text.startswith("simulating") and (folder / "cosimulation.nc").is_file():
            with xr.open_dataset(folder / "cosimulation.nc") as record:
                state = json.loads((folder / "summary.json").read_text())["state"]
                seen.append((record.sizes["time"], record.attrs["state"], state))

    system = system_from(trouble(0) | {"stop_time": "500 ms"}, None, directory=units)
    run_system(system, folder, progress=progress)
    assert seen == [(count, "running", "running") for count in (1, 2, 3, 4, 5)]
    with xr.open_dataset(folder / "cosimulation.nc") as record:
        assert (record.sizes["time"], record.attrs["state"]) == (6, "complete")


SYSTEM = """
stop_time = "1 s"
window = "100 ms"
[[units]]
name = "bad"
fmu = "{units}/Trouble_2.fmu"
start = {{ how = 5.0, when = "250 ms" }}
"""


def test_a_hanging_unit_does_not_keep_the_command_from_being_ended(units, tmp_path, temporary):
    """SIGTERM leaves it a while, a second request none."""
    path, out = tmp_path / "system.toml", tmp_path / "out"
    path.write_text(SYSTEM.format(units=units))
    command = [sys.executable, "-P", "-m", "lcmchain.cli", "cosim", str(path), "--out", str(out)]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    log = out / "lcmchain.log"
    for _ in range(600):
        if log.is_file() and "simulating" in log.read_text():
            break
        time.sleep(0.1)
    time.sleep(0.5)  # the third step is soon reached
    children = _children(process.pid)
    assert len(children) == 1
    for number in (signal.SIGTERM, signal.SIGINT):
        process.send_signal(number)
        time.sleep(0.3)
    said, told = process.communicate(timeout=60)
    assert process.returncode == 1
    assert "Traceback" not in told and 'unit "bad" had not come back in a step' in told
    assert "What was recorded up to 0.2 s" in " ".join(told.split())
    assert json.loads((out / "summary.json").read_text())["state"] == "interrupted"
    with xr.open_dataset(out / "cosimulation.nc") as record:
        assert record.sizes["time"] == 3 and record.attrs["state"] == "interrupted"
    assert not _at_work(children[0])


def test_a_unit_that_hangs_in_the_initialisation_does_not_keep_its_master(
    units, tmp_path, temporary
):
    processes = []

    def progress(reached, total, text):
        processes.append(threading.Timer(1.5, end))
        processes[0].start()

    def end():
        processes.extend(_children(os.getpid()))
        os.kill(os.getpid(), signal.SIGTERM)

    before = signal.getsignal(signal.SIGTERM)
    data = trouble(READING + HANG) | {"connections": ["bad.y -> foot.x_in"]}
    with pytest.raises(KeyboardInterrupt):
        run_system(system_from(data, None, directory=units), tmp_path / "out", progress=progress)
    assert len(processes) == 2 and not _at_work(processes[1])
    assert signal.getsignal(signal.SIGTERM) is before
    assert not (tmp_path / "out").exists()


def test_one_request_leaves_a_call_a_while_and_names_the_checkpoint(
    units, tmp_path, temporary, monkeypatch
):
    monkeypatch.setattr(stopping, "GRACE", 0.3)
    monkeypatch.setattr(run_module, "CHECKPOINT_INTERVAL", 0.0)
    data = trouble(HANG)
    begin = []

    def progress(reached, total, text):
        if text.startswith("simulating") and reached > 0.15:
            threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT)).start()
            begin.append(time.monotonic())

    system = system_from(data, None, directory=units)
    with pytest.raises(SimulationInterrupted, match=r"--resume goes on .* at 0\.2 s"):
        run_system(system, tmp_path / "out", progress=progress)
    assert time.monotonic() - begin[0] > 0.6
    assert (tmp_path / "out" / CHECKPOINT).is_file()
    assert json.loads((tmp_path / "out" / "summary.json").read_text())["state"] == "interrupted"


def _children(process):
    return Path(f"/proc/{process}/task/{process}/children").read_text().split()


def _at_work(process):
    try:
        return Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


MASTER = """
import pathlib, sys
from lcmchain.coupling.cosimulation.assembly import assemble
from lcmchain.coupling.cosimulation.system_file import read_system

assembly = assemble(read_system(sys.argv[1]), pathlib.Path(sys.argv[2]), lambda text: None)
print(assembly.parts["bad"].instance._process.pid, flush=True)
assembly.coupled.advance_to(1.0)
"""


def test_the_process_of_a_unit_ends_with_a_master_that_was_killed(units, tmp_path):
    path = tmp_path / "system.toml"
    path.write_text(SYSTEM.format(units=units))
    command = [sys.executable, "-P", "-c", MASTER, str(path), str(tmp_path / "unpacked")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as master:
        child = int(master.stdout.readline())
        time.sleep(0.3)
        assert _at_work(child)  # it hangs in its third step
        master.kill()
    for _ in range(100):
        if not _at_work(child):
            break
        time.sleep(0.1)
    assert not _at_work(child)


HOLDER = """
import sys, time
from lcmchain.coupling.cosimulation.temporary_folder import temporary_folder

with temporary_folder("lcmchain-held-") as folder:
    (folder / "unit.so").write_text("x")
    print(folder.parent, flush=True)
    time.sleep(60)
"""


def test_folders_that_killed_processes_have_left_are_removed_by_the_next(temporary):
    """Only those: one that is in use, one that may not be locked yet, and a link stay."""
    other = temporary.parent / "other"
    (other / "content").mkdir(parents=True)
    (other / "lock").touch()
    with subprocess.Popen([sys.executable, "-P", "-c", HOLDER], stdout=subprocess.PIPE) as holder:
        folder = Path(os.fsdecode(holder.stdout.readline().strip()))
        link = temporary / "lcmchain-held-link"
        link.symlink_to(other)
        os.utime(folder, (0.0, 0.0))
        os.utime(other, (0.0, 0.0))
        with temporary_folder("lcmchain-held-"):
            assert (folder / "content" / "unit.so").exists()
        holder.kill()
    os.utime(folder)
    with temporary_folder("lcmchain-held-"):
        assert folder.exists()
    os.utime(folder, (0.0, 0.0))
    with temporary_folder("lcmchain-held-") as present:
        assert not folder.exists() and list(present.iterdir()) == []
    assert (other / "lock").exists()
    link.unlink()
