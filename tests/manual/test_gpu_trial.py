"""The step of ``examples/gpu``, recorded from the equations, is the step of the program."""

from __future__ import annotations

import ctypes
import importlib
import shutil
import subprocess

import numpy as np
import pytest

from lcmchain.bench.hemisphere import SCENE
from lcmchain.bench.sizes import free_plate
from lcmchain.scene import scene_from_text
from lcmchain.solver.simulation import Simulation

pytestmark = pytest.mark.skipif(not shutil.which("g++"), reason="needs a compiler of C++")

# What CUDA gives every thread; here one thread runs after the other.
ONE_AFTER_THE_OTHER = """
#include <cmath>
using namespace std;
struct Index { int x; };
static Index blockIdx, blockDim{1}, threadIdx{0};
#define __device__
#define __forceinline__ inline
#define __global__
#include "step.cu"
#define ALL(count, call) for (blockIdx.x = 0; blockIdx.x < count; blockIdx.x++) call
extern "C" void run(
    int steps, int elements, int nodes, int middles, int valence, double dt, double damping,
    double* position, double* velocity, double* inverse_mass, int* corner_node, real* quick_data,
    int* quick_start, real* general_data, int* general_start, real* shared, int* middle_nodes,
    real* bending_constants, int* bending_start, int* slot, int* middle_of_node, int* source,
    real* share, real* corner_force, real* sent
#ifdef TOOLS
    , double* area, double* impedance, double* offset, double* travel, double* speed,
    double* stick, double penalty, double tangential_ratio, double damping_ratio, double weight
#define OF_CONTACT , step, area, impedance, offset, travel, speed, penalty, tangential_ratio, \\
    damping_ratio, weight, stick
#else
#define OF_CONTACT
#endif
) {
    for (int step = 0; step < steps; step++) {
        ALL(elements, element_forces(elements, nodes, position, corner_node, quick_data,
            quick_start, general_data, general_start, shared, corner_force));
        ALL(middles, fibre_bending(middles, nodes, position, middle_nodes, bending_constants,
            bending_start, sent));
        ALL(nodes, move_nodes(nodes, valence, middles, slot, corner_force, middle_of_node, source,
            sent, share, inverse_mass, position, velocity, dt, damping OF_CONTACT));
    }
}
"""
ARRAYS = (
    "position", "velocity", "inverse_mass", "corner_node", "quick_data", "quick_start",
    "general_data", "general_start", "shared", "middle_nodes", "bending_constants",
    "bending_start", "slot", "middle_of_node", "source", "share",
)  # fmt: skip
ARRAYS_OF_CONTACT = ("area", "impedance", "offset", "travel", "speed", "stick")
NUMBERS_OF_CONTACT = ("penalty", "tangential_ratio", "damping_ratio", "weight")


@pytest.fixture
def trial(request, monkeypatch):
    folder = request.config.rootpath / "examples" / "gpu"
    monkeypatch.syspath_prepend(folder)
    return folder, importlib.import_module("prepare")


def check(prepare, folder, out, simulation, *, moves):
    """Compare the step with the program's where nodes move by so much at least [m], together."""
    prepare.write(out, simulation)
    given = dict(np.load(out / "arrays.npz"))
    found = run_one_after_the_other(folder, out, given)
    moved = np.linalg.norm(given["position_then"] - given["position"])
    assert moved > moves
    assert np.linalg.norm(found - given["position_then"]) < 1e-12 * moved
    return given


@pytest.mark.parametrize("angle", [0, pytest.param(30, marks=pytest.mark.slow)])
def test_the_recorded_step_is_that_of_a_plate(angle, trial, tmp_path):
    folder, prepare = trial
    simulation = free_plate(400, f"blank.fibre_angle={angle} deg", "process.mass_damping=200 1/s")
    simulation.set_velocity(prepare.bulging(simulation.state.position))
    given = check(prepare, folder, tmp_path, simulation, moves=0.01)
    assert (given["quick_start"] < 0).any() == (angle != 0)  # cut elements take the general way


def test_the_recorded_step_is_that_of_a_sheet_between_tools(trial, tmp_path):
    folder, prepare = trial
    overrides = ["blank.edge_length=15 mm", "process.time=20 ms", "process.gravity=true"]
    simulation = Simulation.from_scene(scene_from_text(SCENE, overrides=overrides))
    simulation.advance_to(0.008)
    given = check(prepare, folder, tmp_path, simulation, moves=0.01)
    assert (abs(given["stick"]).max(axis=(1, 2)) > 0.0).all()  # all three tools rub


def run_one_after_the_other(folder, out, given):
    """Return the positions after the steps of ``step.cu``, compiled for this processor."""
    source, library = out / "step.cpp", out / "step.so"
    source.write_text(ONE_AFTER_THE_OTHER, encoding="ascii")
    command = ["g++", "-std=c++17", "-O1", "-Dreal=double", f"-I{folder}", f"-I{out}"]
    subprocess.run([*command, "-shared", "-fPIC", "-o", library, source], check=True)
    arrays = [
        np.array(given[name], dtype=float if given[name].dtype.kind == "f" else "i4", order="C")
        for name in ARRAYS
    ]
    forces = [np.zeros(given[name].size * 384 + 64) for name in ("quick_start", "bending_start")]
    counts = (given["steps"], given["element_count"], given["position"].shape[1])
    counts += (given["share"].size, given["slot"].shape[0])
    numbers: tuple[str, ...] = ()
    if "travel" in given:
        numbers = NUMBERS_OF_CONTACT
        forces += [given[name] for name in ARRAYS_OF_CONTACT]
    ctypes.CDLL(str(library)).run(
        *map(ctypes.c_int, map(int, counts)),
        *(ctypes.c_double(float(given[name])) for name in ("dt", "damping")),
        *(array.ctypes.data_as(ctypes.c_void_p) for array in (*arrays, *forces)),
        *(ctypes.c_double(float(given[name])) for name in numbers),
    )
    return arrays[0]
