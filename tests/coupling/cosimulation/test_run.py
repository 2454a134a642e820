"""The command: results, checkpoints that go on bit by bit, interruption, and its messages."""

import json
import os
import signal
import subprocess
import sys
import time
import tomllib

import numpy as np
import pytest
import xarray as xr

from lcmchain.cli import main
from lcmchain.coupling.cosimulation import run as run_module
from lcmchain.coupling.cosimulation.run import CHECKPOINT, run_system
from lcmchain.coupling.cosimulation.system_file import System, read_system
from lcmchain.errors import InputError, SimulationInterrupted

SYSTEM = """
title = "Two masses and a field"
stop_time = "2 s"
window = "50 ms"
connections = [
  "one.position -> two.position1",
  {{ link = "two.force -> one.force", absolute = 1e-9 }},
  "left.y -> right.x_in",
  "right.y -> left.x_in",
  "one.velocity -> counter_foot.x_in",
  "count.count -> other.count_in",
]
[[units]]
name = "one"
fmu = "{units}/Mass_2.fmu"
start = {{ mass = "2 kg", position0 = "10 cm" }}
[[units]]
name = "two"
fmu = "{units}/Tail_3.fmu"
[[units]]
name = "left"
fmu = "{units}/Field_2.fmu"
[[units]]
name = "right"
fmu = "{units}/Field_3.fmu"
start = {{ a = -1.5 }}
[[units]]
name = "counter_foot"
fmu = "{units}/Follower_2.fmu"
[[units]]
name = "count"
fmu = "{units}/Counter_2.fmu"
[[units]]
name = "other"
fmu = "{units}/Counter_3.fmu"
[scheme]
type = "{scheme}"
"""


def system_file(units, tmp_path, scheme="iqn-ils"):
    path = tmp_path / "system.toml"
    path.write_text(SYSTEM.format(units=units, scheme=scheme))
    return path


def record_of(folder):
    names = ("one", "two", "left", "right", "count", "other")
    record = {name: xr.load_dataset(folder / "cosimulation.nc", group=name) for name in names}
    return record | {"coupling": xr.load_dataset(folder / "cosimulation.nc", group="coupling")}


def same(one, other):
    for group, values in one.items():
        assert list(values) == list(other[group]), group
        for name in values:
            assert np.array_equal(
                values[name].values, other[group][name].values,
                equal_nan=values[name].dtype.kind == "f",
            ), (group, name)  # fmt: skip


def test_the_command_writes_what_it_says(units, tmp_path, capsys):
    out = tmp_path / "out"
    with pytest.raises(SystemExit) as ended:
        main(["cosim", str(system_file(units, tmp_path)), "--out", str(out)])
    assert ended.value.code == 0
    files = {path.name for path in out.iterdir() if not path.name.startswith(".")}
    assert files == {
        "cosimulation.nc", "signals.png", "convergence.png", "summary.json", "lcmchain.log",
    }  # fmt: skip
    summary = json.loads((out / "summary.json").read_text())
    assert summary["state"] == "complete" and summary["window_count"] == 40
    assert summary["time_reached_s"] == 2.0
    assert summary["iteration_count"] > 40
    one = summary["units"]["one"]
    assert one["step_count"] == summary["iteration_count"]
    assert one["rollback_count"] == summary["iteration_count"] - 40
    assert set(one["seconds"]) == {"instantiation", "initialisation", "steps", "values", "states"}
    assert one["seconds"]["steps"] > 0.0
    record = record_of(out)
    assert record["one"]["position"].sizes == {"time": 41}
    assert record["one"]["position"].attrs["units"] == "m"
    assert record["two"]["force"].attrs["units"] == "kN"
    assert record["left"]["y"].sizes == {"time": 41, "value_40": 40}
    assert record["coupling"].attrs["scheme"] == "IQN-ILS"
    assert record["coupling"].sizes["window"] == 40
    exchanges = record["coupling"]["exchange_unit"]
    unit_of = dict(zip(exchanges["exchange"].values, exchanges.values, strict=True))
    assert next(u for name, u in unit_of.items() if name.startswith("one.position")) == "mm"
    assert next(u for name, u in unit_of.items() if name.startswith("two.force")) == "N"
    assert "units" not in record["coupling"]["residual"].attrs, "each exchange has its own"
    assert summary["final_values"]["one.position"] == record["one"]["position"].values[-1]
    said = capsys.readouterr()
    assert "40 windows to 2 s" in said.out and "rollbacks" in said.out
    assert "simulating" in said.err
    with xr.open_dataset(out / "cosimulation.nc") as root:
        assert tomllib.loads(root.attrs["system"])["title"] == root.attrs["title"]


class _StopAfter:
    """Stands for a user who stops the run after some windows."""

    def __init__(self, windows):
        self.left = windows

    def is_set(self):
        self.left -= 1
        return self.left < 0


@pytest.mark.parametrize(
    "scheme, windows",
    [
        ("iqn-ils", 17),
        ("gauss-seidel", 17),
        # a scheme with less to remember, and a stop before there is much
        pytest.param("jacobi", 17, marks=pytest.mark.slow),
        pytest.param("iqn-ils", 1, marks=pytest.mark.slow),
    ],
)
def test_a_resumed_run_is_bit_identical(units, tmp_path, monkeypatch, scheme, windows):
    system = read_system(system_file(units, tmp_path, scheme), ["units.right.start.a=0.5"])
    whole = run_system(system, tmp_path / "whole")
    from contextlib import contextmanager

    @contextmanager
    def stopping():
        yield _StopAfter(2 * windows)  # looked at twice in a window

    with monkeypatch.context() as patch:
        patch.setattr(run_module, "stop_requests", stopping)
        with pytest.raises(SimulationInterrupted, match="--resume goes on from here"):
            run_system(system, tmp_path / "parts")
    stopped = json.loads((tmp_path / "parts" / "summary.json").read_text())
    assert stopped["state"] == "interrupted"
    assert 0.0 < stopped["time_reached_s"] < 2.0
    assert (tmp_path / "parts" / CHECKPOINT).is_file()
    resumed = run_system(system, tmp_path / "parts", resume=True)
    assert resumed["final_values"] == whole["final_values"]
    assert not (tmp_path / "parts" / CHECKPOINT).exists()
    assert resumed["units"]["one"]["step_count"] == whole["units"]["one"]["step_count"]
    same(record_of(tmp_path / "whole"), record_of(tmp_path / "parts"))


def interrupted(system, folder, monkeypatch):
    from contextlib import contextmanager

    @contextmanager
    def stopping():
        yield _StopAfter(10)

    with monkeypatch.context() as patch:
        patch.setattr(run_module, "stop_requests", stopping)
        with pytest.raises(SimulationInterrupted):
            run_system(system, folder)


def test_a_checkpoint_of_other_units_or_settings_is_refused(units, tmp_path, monkeypatch):
    import shutil

    mine = tmp_path / "units"
    shutil.copytree(units, mine, ignore=shutil.ignore_patterns("*_2", "*_3"))
    path = system_file(mine, tmp_path)
    folder = tmp_path / "out"
    interrupted(read_system(path), folder, monkeypatch)
    kept = (folder / CHECKPOINT).read_bytes()

    for override, said in (
        ("scheme.relative=1e-3", r"something else: scheme.relative \(\S+ then, 0.001 now\); go on"),
        ("units.one.start.mass='3 kg'", r'units.one.start.mass \("2 kg" then, "3 kg" now\); go'),
        (
            'units.one.start.stiffness="1 N/m"',
            r'start.stiffness \(absent then, "1 N/m" now\); go on',
        ),
    ):
        with pytest.raises(InputError, match=said):
            run_system(read_system(path, [override]), folder, resume=True)
    import zipfile

    with zipfile.ZipFile(mine / "Mass_2.fmu", "a") as archive:
        archive.writestr("documentation/index.html", "another one")
    with pytest.raises(InputError, match=r'something else: unit "one" \(SHA-256 \w{12} then'):
        run_system(read_system(path), folder, resume=True)
    damaged = bytearray(kept)
    damaged[len(kept) // 2] ^= 1
    (folder / CHECKPOINT).write_bytes(damaged)
    with pytest.raises(InputError, match="damaged"):
        run_system(read_system(path), folder, resume=True)
    (folder / CHECKPOINT).unlink()
    with pytest.raises(InputError, match="no checkpoint to go on from"):
        run_system(read_system(path), folder, resume=True)


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
def test_ctrl_c_leaves_a_checkpoint(units, tmp_path):
    path, out = system_file(units, tmp_path), tmp_path / "out"
    command = [sys.executable, "-P", "-m", "lcmchain.cli", "cosim", str(path), "--out", str(out),
               "--set", "stop_time=1000 s"]  # fmt: skip
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    log = out / "lcmchain.log"
    for _ in range(1200):
        if log.is_file() and "simulating" in log.read_text():
            break
        time.sleep(0.1)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=120)
    assert process.returncode == 1
    assert "--resume goes on from here" in said and "Traceback" not in said
    assert (out / CHECKPOINT).is_file()
    assert json.loads((out / "summary.json").read_text())["state"] == "interrupted"


def test_what_is_recorded_can_be_chosen(units, tmp_path):
    path = system_file(units, tmp_path)
    system = read_system(
        path,
        ['recorder.variables=["one.*", "left.sum", "two.mass"]', "recorder.every=12",
         "units.right.start.a=0.5"],
    )  # fmt: skip
    run_system(system, tmp_path / "out")
    with xr.open_dataset(tmp_path / "out" / "cosimulation.nc", group="two") as two:
        assert list(two) == ["mass"]
        assert two["time"].values == pytest.approx([0.0, 0.6, 1.2, 1.8, 2.0])
    for pattern, reason in (("one.psition", "did you mean"), ("x.*", "no output fits"),
                            ("x.y", 'no unit "x"')):  # fmt: skip
        with pytest.raises(InputError, match=reason):
            run_system(read_system(path, [f'recorder.variables=["{pattern}"]']), tmp_path / "no")


@pytest.mark.parametrize(
    "override, reason",
    [
        ("scheme.typ=jacobi", 'scheme.typ: unknown key; did you mean "type"'),
        ("scheme.type=jakobi", 'did you mean "jacobi"'),
        ("window=20", "20 has no unit"),
        ("window=20 mm", "of dimension"),
        ("units.one.fmv=x", r'units\[0\] "one".fmv: unknown key; did you mean "fmu"'),
        ("stop_time=0 s", "stop_time"),
        ("start_time=3 s", "must lie after start_time"),
        ('connections=["a.b"]', "is no connection"),
        ('connections=["a.b -> one.force"]', 'there is no unit "a"'),
        ("units.two.name=one", 'two units are named "one"'),
        ("units.two.name=coupling", "choose another"),
        ('units.one.start.mass="2 m"', r"units\.one\.start\.mass: .*cannot be converted into kg"),
        ("units.one.start.mass=2", r"2 has no unit; write it in quotes with one"),
        ("units.one.fmu=absent.fmu", "no such file"),
    ],
)
def test_wrong_entries_name_their_key(units, tmp_path, override, reason):
    with pytest.raises(InputError, match=reason):
        run_system(read_system(system_file(units, tmp_path), [override]), tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_all_entries_are_described():
    def described(model):
        for name, field in model.model_fields.items():
            assert field.description, name

    described(System)


def test_the_command_ends_with_the_code_of_the_error(units, tmp_path, capsys):
    path = system_file(units, tmp_path)
    for arguments, code in (
        (["--set", "scheme.type=no"], 2),
        (["--set", "scheme.type=gauss-seidel", "--set", "units.right.start.a=-9"], 1),
        (["--export", str(tmp_path / "no.zip")], 2),
    ):
        with pytest.raises(SystemExit) as caught:
            main(["cosim", str(path), "--out", str(tmp_path / "x"), "-q", *arguments])
        assert caught.value.code == code, capsys.readouterr().err
