"""Runs sequences of FMI calls in a process of its own: `python calls.py FOLDER SEQUENCES.json`.

Every sequence has an instance of its own. A call is a name and arguments; what it ends with, or the
exception of the master's library, is printed as JSON. The process must end with "done".
"""

import contextlib
import ctypes
import json
import sys

from bare import KINDS, MODES, Bare
from fmpy import calloc, free, read_model_description
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import (
    FMU2Slave,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
)
from fmpy.fmi3 import FMU3Slave

STEP = 1e-4
ERROR = 3
# Calls that answer with a status instead of an exception.
BARE = ("move", "mode", "put_bytes")
# Outputs whose every bit must survive what is refused.
WATCHED = ("punch.travel", "thickness_min", "internal_energy", "external_work", "holder.force")


class Driver:
    """One instance, and the calls that sequences name."""

    def __init__(self, folder):
        description = read_model_description(folder, validate=False)
        self.version = int(description.fmiVersion[0])
        self.variables = {v.name: v for v in description.modelVariables}
        kind = FMU2Slave if self.version == 2 else FMU3Slave
        self.slave = kind(
            guid=description.guid if self.version == 2 else description.instantiationToken,
            unzipDirectory=folder,
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="fuzzed",
        )
        self.errors = []
        self.slave.instantiate(**self._logging())
        self.bare = Bare(folder, instance=ctypes.c_void_p(self._component))
        self.states, self.contents = [], []
        self.time = self.start = 0.0
        self.stop = None

    def _logging(self):
        """Keep what the unit logs as errors, to hold it against the statuses."""

        def hear2(environment, name, status, category, message):
            if status == ERROR:
                self.errors.append((category, message))

        def hear3(environment, status, category, message):
            hear2(environment, None, status, category, message)

        if self.version == 3:
            return {"logMessage": hear3, "loggingOn": True}
        callbacks = fmi2CallbackFunctions()
        callbacks.logger = fmi2CallbackLoggerTYPE(hear2)
        callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(calloc)
        callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(free)
        self._kept = callbacks
        return {"callbacks": callbacks, "loggingOn": True}

    def free(self):
        for state in self.states:
            free = "freeFMUstate" if self.version == 2 else "freeFMUState"
            getattr(self.slave, free)(state)
        self.slave.freeInstance()

    def reference(self, name):
        return name if isinstance(name, int) else self.variables[name].valueReference

    # --- calls ------------------------------------------------------------------------------------

    def set_up(self, start=0.0, stop=None):
        """Start and stop time; FMI 3.0 says them when it enters initialization mode."""
        self.start, self.stop = start, stop
        if self.version == 2:
            self.slave.setupExperiment(startTime=start, stopTime=stop)
        self.time = start

    def enter(self):
        times = {} if self.version == 2 else {"startTime": self.start, "stopTime": self.stop}
        self.slave.enterInitializationMode(**times)

    def leave(self):
        self.slave.exitInitializationMode()

    def initialize(self):
        self.set_up()
        self.enter()
        self.leave()

    def step(self, size=STEP, at=None):
        """A step from where the last one ended, unless ``at`` says from where.

        One that is discarded leaves the outputs as they were.
        """
        before = self.get("real", *WATCHED)
        time = self.time if at is None else at
        try:
            self.slave.doStep(currentCommunicationPoint=time, communicationStepSize=size)
        except FMICallException:
            after = self.get("real", *WATCHED)
            assert repr(after) == repr(before), (before, after)
            raise
        self.time = time + size

    def terminate(self):
        self.slave.terminate()

    def reset(self):
        self.slave.reset()
        self.time = self.start = 0.0
        self.stop = None

    def get(self, kind, *names):
        getter = {
            "real": ("getReal", "getFloat64"),
            "integer": ("getInteger", "getInt32"),
            "boolean": ("getBoolean", "getBoolean"),
            "text": ("getString", "getString"),
        }[kind][self.version - 2]
        found = getattr(self.slave, getter)([self.reference(name) for name in names])
        return [f.decode() if isinstance(f, bytes) else f for f in found]

    def put(self, kind, name, *values):
        setter = {
            "real": ("setReal", "setFloat64"),
            "integer": ("setInteger", "setInt32"),
            "boolean": ("setBoolean", "setBoolean"),
            "text": ("setString", "setString"),
        }[kind][self.version - 2]
        getattr(self.slave, setter)([self.reference(name)], list(values))

    def put_bytes(self, name):
        """A text that is no UTF-8."""
        text = (ctypes.c_char_p * 1)(b"/tmp/\xe4\xff")
        vr = (ctypes.c_uint32 * 1)(self.reference(name))
        size, pointer = ctypes.c_size_t, ctypes.c_void_p
        counts = [size] * (self.version - 2)
        prototype = ctypes.CFUNCTYPE(ctypes.c_int, pointer, pointer, size, pointer, *counts)
        function = prototype((f"fmi{self.version}SetString", self.slave.dll))
        component = ctypes.c_void_p(self._component)
        return function(component, vr, 1, text, *[1] * (self.version - 2))

    def move(self, verb, place, names, surplus=0):
        """Get or set many values at once: by any kind, any references, any number of values."""
        kinds = list(KINDS[self.version])
        kind = kinds[place % len(kinds)]
        count = max(self.bare.count(names) + (surplus if self.version == 3 else 0), 0)
        wrong = not all(self.bare.is_one(name, kind) for name in names) or (
            count != self.bare.count(names)
        )
        status, _ = self.bare.move(verb, kind, names, surplus if self.version == 3 else 0)
        assert status in (0, ERROR), status
        assert status == ERROR or not wrong, (verb, kind, names, surplus)
        return status

    def mode(self, place):
        """A mode that the unit does not offer, or a function of FMI 2.0 that it does not have."""
        names = ("CancelStep", "GetRealOutputDerivatives") if self.version == 2 else MODES
        status = self.bare.call(names[place % len(names)], *[None] * 4)
        assert status == ERROR
        return status

    def save(self):
        get = "getFMUstate" if self.version == 2 else "getFMUState"
        self.states.append(getattr(self.slave, get)())

    def restore(self, which=-1):
        if self.states:
            put = "setFMUstate" if self.version == 2 else "setFMUState"
            getattr(self.slave, put)(self.states[which % len(self.states)])

    def serialize(self):
        if self.states:
            name = "serializeFMUstate" if self.version == 2 else "serializeFMUState"
            self.contents.append(getattr(self.slave, name)(self.states[-1]))

    def deserialize(self, damage=None, place=0, value=0):
        if not self.contents:
            return
        content = damaged(bytes(self.contents[-1]), damage, place, value)
        name = "deSerializeFMUstate" if self.version == 2 else "deserializeFMUState"
        self.states.append(getattr(self.slave, name)(content))

    @property
    def _component(self):
        component = self.slave.component
        return getattr(component, "value", component)


def damaged(content, damage, place, value):
    """Return bytes with a flipped bit, cut, extended, or of something else."""
    place %= max(len(content), 1)
    if damage == "flip":
        return content[:place] + bytes([content[place] ^ (1 << value % 8)]) + content[place + 1 :]
    if damage == "cut":
        return content[:place]
    if damage == "extend":
        return content + bytes([value % 256]) * (place + 1)
    if damage == "zeros":
        return bytes(len(content))
    if damage == "noise":
        return bytes((place * 31 + value * k) % 256 for k in range(place % 4096))
    if damage == "swap":
        return content[place:] + content[:place]
    return content


def run(folder, sequence, expected):
    """Return what the calls ended with; the instance must be a sound one after all of them."""
    driver = Driver(folder)
    results = []
    for name, *arguments in sequence:
        told = len(driver.errors)
        result = {"status": 0}
        try:
            result["answer"] = getattr(driver, name)(*arguments)
        except FMICallException as error:
            result["status"] = error.status
        refused = len(driver.errors) > told
        raw = result.get("answer") if name in BARE else None
        assert refused == (ERROR in (result["status"], raw)), (name, arguments, result, refused)
        results.append(result | {"refused": refused})
    found = after_a_step(driver)
    assert expected is None or repr(found) == repr(expected), (found, expected)
    driver.free()
    return results


def after_a_step(driver):
    """Return the outputs of a fresh start and one step."""
    driver.reset()
    driver.initialize()
    driver.step()
    return driver.get("real", *WATCHED)


if __name__ == "__main__":
    with open(sys.argv[2], encoding="utf-8") as opened:
        sequences = json.load(opened)
    found = []
    with contextlib.redirect_stdout(sys.stderr):
        untouched = Driver(sys.argv[1])
        expected = after_a_step(untouched)
        untouched.free()
        for number, sequence in enumerate(sequences):
            print(f"sequence {number}", flush=True)
            found.append(run(sys.argv[1], sequence, expected))
    print(json.dumps({"results": found, "end": "done"}))
