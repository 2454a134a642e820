"""Runs of a study: none made twice, none lost with a worker, the same wherever they are made."""

import csv
import os
import signal
import threading
import time

import numpy as np
import pytest
import xarray as xr
from rich.console import Console
from typer.testing import CliRunner

from lcmchain.cli import app, main
from lcmchain.errors import InputError, SimulationInterrupted
from lcmchain.study import runs as runs_module
from lcmchain.study.accuracy import ladder, study_accuracy
from lcmchain.study.accuracy_files import markdown, terminal_table, write_accuracy
from lcmchain.study.outcome import Outcome
from lcmchain.study.runs import RUNS, Study, Workers
from lcmchain.study.sources import Variant

EDGES = [Variant(f"{e} mm", "edge length", (f"blank.edge_length={e} mm",), e * 1e-3)
         for e in (10, 8, 5)]  # fmt: skip


@pytest.fixture
def counted(monkeypatch):
    """Names of the variants that are run from now on."""
    made = []
    make = runs_module.make_run

    def counting(source, variant, threads, tell=None):
        made.append(variant.name)
        return make(source, variant, threads, tell)

    monkeypatch.setattr(runs_module, "make_run", counting)
    return made


def test_a_study_goes_on_from_what_is_there(dent, tmp_path, counted):
    first = Study(dent, tmp_path).outcomes(EDGES[:2])
    assert sorted(counted) == ["10 mm", "8 mm"]
    everything = Study(dent, tmp_path).outcomes(EDGES)
    assert counted[2:] == ["5 mm"]
    assert all(everything[name].equals(first[name]) for name in first)
    damaged = tmp_path / RUNS / "8_mm.nc"
    damaged.write_bytes(b"cut off")
    again = Study(dent, tmp_path).outcomes(EDGES)
    assert counted[3:] == ["8 mm"]
    assert again["8 mm"].equals(first["8 mm"])


def test_a_changed_scene_takes_nothing_from_another_ones_runs(dent, tmp_path, counted):
    Study(dent, tmp_path).outcomes(EDGES[:1])
    other = type(dent)(dent.text, dent.path, ("contact.friction=0.3",))
    Study(other, tmp_path).outcomes(EDGES[:1])
    assert counted == ["10 mm", "10 mm"]


def test_what_stops_a_run_is_an_outcome_and_what_the_scene_refuses_is_an_error(dent, tmp_path):
    coarse = Variant("too coarse", "edge length", ("blank.edge_length=30 mm",))
    found = Study(dent, tmp_path).outcome(coarse)
    assert "edge_length" in found.failure
    with pytest.raises(InputError, match='setting "odd" of the study.*friction'):
        Study(dent, tmp_path).outcome(Variant("odd", "x", ("contact.friction=much",)))
    with pytest.raises(InputError, match='two settings of the study have the name "10 mm"'):
        Study(dent, tmp_path).outcomes([EDGES[0], EDGES[0]])


def test_a_cluster_gives_the_same_results_though_a_worker_is_killed(dent, tmp_path):
    distributed, dask = pytest.importorskip("distributed"), pytest.importorskip("dask")
    here = Study(dent, tmp_path / "here").outcomes(EDGES)
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None, memory_limit=0
    ) as cluster:
        killed = []

        def kill_one_at_work():
            with distributed.Client(cluster, set_as_default=False) as client:
                for _ in range(600):
                    busy = [w for w, tasks in client.processing().items() if tasks]
                    if busy and not killed:
                        pid = client.run(os.getpid, workers=busy[:1])[busy[0]]
                        os.kill(pid, signal.SIGKILL)
                        killed.append(pid)
                        return
                    time.sleep(0.05)

        killer = threading.Thread(target=kill_one_at_work)
        killer.start()
        workers = Workers(1, 1, cluster.scheduler_address)
        there = Study(dent, tmp_path / "there", workers).outcomes(EDGES)
        killer.join()
    assert len(killed) == 1
    assert dask.config.get("scheduler", None) is None  # xarray would ask for a client for ever
    assert all(there[name].equals(here[name]) for name in here)


def test_a_scheduler_that_does_not_answer_is_named(dent, tmp_path, monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr(runs_module, "ANSWER_WITHIN", 1.0)
    workers = Workers(1, 1, "tcp://127.0.0.1:9")
    with pytest.raises(InputError, match="127.0.0.1:9"):
        Study(dent, tmp_path, workers).outcomes(EDGES[:1])


@pytest.mark.parametrize("address", ["foo", "http://localhost:80", "", "tcp://:"])
def test_what_is_no_address_is_told_without_waiting(dent, tmp_path, address):
    pytest.importorskip("distributed")
    with pytest.raises(InputError, match="--scheduler.*no address of a dask scheduler"):
        Study(dent, tmp_path, Workers(1, 1, address)).outcomes(EDGES[:1])


def test_a_sweep_with_a_run_without_a_result_ends_as_a_failed_run(
    dent, tmp_path, monkeypatch, capsys
):
    def made(source, variant, threads, tell=None):
        return Outcome(1.0, 1, failure="the sheet tore" if "0.3" in variant.name else "")

    monkeypatch.setattr(runs_module, "make_run", made)
    out = ["--workers", "1", "--out", str(tmp_path / "out")]
    with pytest.raises(SystemExit) as ended:
        main(["study", "sweep", dent.path, "--vary", "contact.friction=0.1|0.3", *out])
    assert ended.value.code == 1
    assert "1 of 2 runs gave no result" in " ".join(capsys.readouterr().err.split())
    assert (tmp_path / "out" / "sweep.csv").exists()


def test_ctrl_c_in_a_run_of_a_study_advises_no_resume(dent, monkeypatch):
    def stopped(*arguments, **options):
        raise SimulationInterrupted("stopped; the same command with --resume goes on from here")

    monkeypatch.setattr("lcmchain.pipeline.run", stopped)
    with pytest.raises(SimulationInterrupted, match="the same command goes on") as caught:
        runs_module.make_run(dent, EDGES[0], 1)
    assert "--resume" not in str(caught.value)


def test_the_ladder_varies_everything_that_costs_time_and_ends_with_the_finest(dent):
    variants = ladder(dent)
    axes = {variant.axis for variant in variants}
    assert axes >= {"edge length", "process time", "contact stiffness", "time step", "damping"}
    assert len(variants) >= 13
    assert len({variant.name for variant in variants}) == len(variants)
    scenes = [dent.job(variant).scene for variant in variants]
    last = scenes[-1]
    assert last.blank.edge_length == min(s.blank.edge_length for s in scenes)
    assert last.process.time == max(s.process.time for s in scenes)
    with pytest.raises(InputError, match="--finest"):
        ladder(dent, 1.5)


def test_a_study_of_accuracy_tells_error_and_time_of_every_setting(dent, tmp_path):
    edges = ["10 mm", "8 mm", "5 mm", "4 mm"]
    study = study_accuracy(dent, tmp_path, vary={"blank.edge_length": edges})
    errors = [s.error("shear_angle") for s in study.settings]
    assert [s.variant.value for s in study.settings] == pytest.approx([0.01, 0.008, 0.005])
    assert errors[0] > errors[2] > 0.0
    assert study.reference.error("shear_angle") == pytest.approx(0.0, abs=1e-12)
    for quantity in ("shear_angle", "thickness"):
        front = study.efficient(quantity)
        assert [s.seconds for s in front] == sorted(s.seconds for s in front)
        assert [s.error(quantity) for s in front] == sorted(
            (s.error(quantity) for s in front), reverse=True
        )
        for setting in study.settings:
            beaten = any(
                s.seconds <= setting.seconds and s.error(quantity) <= setting.error(quantity)
                for s in front
            )
            assert beaten
    files = write_accuracy(tmp_path, study)
    assert all(file.stat().st_size > 500 for file in files)
    with open(tmp_path / "accuracy.csv", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert float(rows[0]["shear_angle_typical"]) == pytest.approx(errors[0], rel=1e-5)
    assert [row["setting"] for row in rows][-1] == study.reference.variant.name
    with xr.open_dataset(tmp_path / "accuracy.nc") as data:
        found = data["error"].sel(quantity="shear_angle", kind="typical").values
        np.testing.assert_allclose(found[:-1], errors)
    assert "blank.edge_length = 5 mm" in markdown(study)
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "http://" not in page and "https://" not in page
    assert "blank.edge_length = 4 mm" in page
    console = Console(width=120, record=True, file=open(os.devnull, "w", encoding="utf-8"))
    console.print(terminal_table(study))
    assert "blank.edge_length = 8 mm" in console.export_text()


def test_commands_of_studies(dent, tmp_path):
    scene = dent.path
    common = ["--workers", "1", "--threads", "1", "--quiet"]
    edges = "blank.edge_length=10 mm|8 mm|5 mm"
    done = CliRunner().invoke(
        app, ["study", "accuracy", scene, "--vary", edges, "--out", str(tmp_path / "a"), *common],
        catch_exceptions=False,
    )  # fmt: skip
    assert done.exit_code == 0
    assert {f.name for f in (tmp_path / "a").iterdir()} >= {
        "accuracy.csv", "accuracy.nc", "accuracy.md", "accuracy.png", "report.html", RUNS,
    }  # fmt: skip
    coarse = ["--set", "blank.edge_length=10 mm", *common]
    sweep = ["--vary", "contact.friction=0.1..0.3", "--samples", "3"]
    done = CliRunner().invoke(
        app, ["study", "sweep", scene, *sweep, "--out", str(tmp_path / "b"), *coarse],
        catch_exceptions=False,
    )  # fmt: skip
    assert done.exit_code == 0
    with open(tmp_path / "b" / "sweep.csv", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    frictions = sorted(float(row["contact.friction"]) for row in rows)
    thirds = [0.1, 0.1667, 0.2334, 0.3]
    assert all(a <= f <= b for a, f, b in zip(thirds, frictions, thirds[1:], strict=False))
    by_friction = sorted(rows, key=lambda row: float(row["contact.friction"]))
    assert float(by_friction[0]["forming_work"]) < float(by_friction[-1]["forming_work"])
    table = CliRunner(env={"COLUMNS": "60"}).invoke(
        app, ["study", "sweep", scene, *sweep, "--out", str(tmp_path / "b"), *coarse[:-1]],
        catch_exceptions=False,
    ).stdout  # fmt: skip
    assert "…" not in table, "cut off on a narrow terminal"
    for row in rows:
        line = next(k for k in table.splitlines() if f"{float(row['contact.friction']):.4g}" in k)
        assert f"{1e3 * float(row['forming_work']):.4g}" in line.split()
    inputs = ["--vary", "contact.friction", "--vary", "material.membrane.shear_polynomial"]
    done = CliRunner().invoke(
        app, ["study", "sensitivity", scene, *inputs, "--out", str(tmp_path / "c"), *coarse],
        catch_exceptions=False,
    )  # fmt: skip
    assert done.exit_code == 0
    with open(tmp_path / "c" / "sensitivity.csv", encoding="utf-8") as file:
        rows = {(row["input"], row["result"]): row for row in csv.DictReader(file)}
    shear = rows["material.membrane.shear_polynomial", "forming_work"]
    assert 0.01 < float(shear["elasticity"]) < 1.0


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["accuracy", "--vary", "blank.edge_length"], "--vary"),
        (["accuracy", "--vary", "blank.edge_length=5 mm"], "two settings"),
        (["accuracy", "--vary", "blank.edge=5 mm|4 mm"], "edge_length"),
        (["sweep", "--vary", "contact.friction=0.1..0.3"], "--samples"),
        (["sweep", "--vary", "blank.edge_length=4 mm..6"], "same unit"),
        (["sensitivity", "--vary", "blank.size"], "blank.size"),
        (["sensitivity", "--vary", "process.mass_dampin"], "process.mass_dampin"),
        (["sensitivity", "--vary", "blank.fibre_angle"], "zero"),
        (["sensitivity", "--part", "2"], "--part"),
    ],
)
def test_wrong_studies_are_told_before_anything_runs(dent, tmp_path, counted, arguments, told):
    kind, *options = arguments
    out = ["--out", str(tmp_path / "out"), "--workers", "1"]
    with pytest.raises(InputError, match=told):
        CliRunner().invoke(app, ["study", kind, dent.path, *options, *out], catch_exceptions=False)
    assert counted == []
