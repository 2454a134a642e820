"""A small dome, its unit, and the masters that drive it."""

import sys
import warnings
from pathlib import Path

import numpy as np
import pytest
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave

from lcmchain.fmu.build import build_fmu

# Lets the tests of this folder import what they share.
sys.path.insert(0, str(Path(__file__).parent))

# Short and coarse: 400 elements, about 900 time steps.
SCENE = """
title = "Dome"
[process]
time = "3 ms"
frames = 4
[blank]
size = ["100 mm", "100 mm"]
edge_length = "5 mm"
height = "0.502 mm"
[material]
preset = "MD600"
[contact]
friction = 0.157
[[tools]]
name = "punch"
shape = { type = "sphere_capped_punch", radius = "25 mm" }
position = "0 0 1.004 mm"
motion = { type = "stroke", direction = [0, 0, -1], distance = "3 mm", profile = "linear" }
[[tools]]
name = "die"
shape = { type = "plate_with_hole", hole_radius = "27 mm", fillet_radius = "6 mm", side = "below" }
[[tools]]
name = "blank-holder"
shape = { type = "plate_with_hole", hole_radius = "27 mm", fillet_radius = "6 mm", side = "above" }
position = "0 0 1.004 mm"
motion = { type = "guided", direction = [0, 0, -1], mass = "0.5 kg" }
"""
ELEMENT_COUNT = 400

# The smallest unit that has everything, for thousands of calls: 16 elements.
PATCH = """
title = "Patch"
[process]
time = "3 ms"
frames = 4
[blank]
size = ["20 mm", "20 mm"]
edge_length = "5 mm"
height = "0.502 mm"
[material]
preset = "MD600"
[contact]
friction = 0.157
[fmu]
parameters = ["tools.holder.motion.mass"]
[[tools]]
name = "punch"
shape = { type = "plate", side = "above" }
position = "0 0 1.004 mm"
motion = { type = "stroke", direction = [0, 0, -1], distance = "0.1 mm", profile = "linear" }
[[tools]]
name = "die"
shape = { type = "plate", side = "below" }
[[tools]]
name = "holder"
shape = { type = "plate", side = "above" }
position = "0 0 5 mm"
motion = { type = "guided", direction = [0, 0, -1], mass = "0.5 kg" }
"""


@pytest.fixture(scope="session")
def scene_file(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("scene") / "dome.toml"
    path.write_text(SCENE, encoding="utf-8")
    return path


@pytest.fixture(scope="session")
def patch_file(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("patch") / "patch.toml"
    path.write_text(PATCH, encoding="utf-8")
    return path


@pytest.fixture(scope="session")
def unit(scene_file, tmp_path_factory) -> Path:
    """The built unit of the dome."""
    path = tmp_path_factory.mktemp("unit") / "dome.fmu"
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert build_fmu(scene_file, path) == path
    return path


@pytest.fixture(scope="session")
def unit3(scene_file, tmp_path_factory) -> Path:
    """The dome's unit of FMI 3.0."""
    return build_fmu(scene_file, tmp_path_factory.mktemp("unit3") / "dome.fmu", fmi=3)


class Master:
    """One instance of a unit, with access to its variables by name."""

    def __init__(self, folder, description, name="dome"):
        self.references = {v.name: v.valueReference for v in description.modelVariables}
        self.slave = FMU2Slave(
            guid=description.guid,
            unzipDirectory=folder,
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName=name,
        )
        self.slave.instantiate()

    def initialize(self, start_time=0.0, **settings):
        self.slave.setupExperiment(startTime=start_time)
        for name, value in settings.items():
            self.set(name.replace("__", "."), value)
        self.slave.enterInitializationMode()
        self.slave.exitInitializationMode()
        return self

    def set(self, name, value):
        vr = [self.references[name]]
        if isinstance(value, bool):
            self.slave.setBoolean(vr, [value])
        elif isinstance(value, str):
            self.slave.setString(vr, [value])
        elif isinstance(value, int):
            self.slave.setInteger(vr, [value])
        else:
            self.slave.setReal(vr, [value])

    def get(self, *names):
        values = self.slave.getReal([self.references[name] for name in names])
        return values if len(values) > 1 else values[0]

    def field(self, name):
        return np.array(self.get(*(f"{name}[{i + 1}]" for i in range(ELEMENT_COUNT))))

    def step(self, time, size):
        self.slave.doStep(currentCommunicationPoint=time, communicationStepSize=size)
        return time + size


@pytest.fixture(scope="session")
def unpacked(unit, tmp_path_factory):
    folder = tmp_path_factory.mktemp("unpacked")
    return extract(str(unit), unzipdir=str(folder)), read_model_description(str(unit))


@pytest.fixture
def new_master(unpacked):
    """Make instances of the dome's unit; they are freed after the test."""
    masters = []

    def make(name="dome"):
        masters.append(Master(*unpacked, name))
        return masters[-1]

    yield make
    for master in masters:
        master.slave.freeInstance()
