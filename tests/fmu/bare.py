"""A unit by the functions of its library alone, as a master in C calls them.

`python bare.py FOLDER OUT_DIR` does what masters must not, and prints as JSON what came of it.
"""

import ctypes
import gc
import io
import json
import shutil
import sys
from pathlib import Path
from urllib.parse import quote

from fmpy import read_model_description

STEP = 1e-4
MODES = ["EnterConfigurationMode", "ExitConfigurationMode", "EnterEventMode", "EnterStepMode",
         "EnterContinuousTimeMode"]  # fmt: skip
KINDS = {
    2: {"Real": ctypes.c_double, "Integer": ctypes.c_int, "Boolean": ctypes.c_int,
        "String": ctypes.c_char_p},
    3: {"Float64": ctypes.c_double, "Int32": ctypes.c_int, "Boolean": ctypes.c_bool,
        "String": ctypes.c_char_p, "Int64": ctypes.c_int64, "UInt64": ctypes.c_uint64,
        "Float32": ctypes.c_float, "UInt8": ctypes.c_uint8},
}  # fmt: skip
UNKNOWN = 4_000_000_000


class Callbacks(ctypes.Structure):
    _fields_ = [(name, ctypes.c_void_p) for name in ("log", "take", "give", "end", "environment")]


class Bare:
    """One instance, new or of another master; ``heard`` is what its own logger was told.

    ``resources`` and ``name`` are bytes that a master hands in, none for those that are right.
    """

    def __init__(
        self, folder, *, logger=True, logging=True, instance=None, resources=None, name=b"bare"
    ):
        description = read_model_description(folder, validate=False)
        self.version = int(description.fmiVersion[0])
        self.variables = {v.name: v for v in description.modelVariables}
        (library,) = Path(folder).glob("binaries/*linux*/*.so")
        self.library = ctypes.CDLL(str(library))
        self.heard, self.instance = [], instance
        if instance is None:
            place = Path(folder, "resources")
            right = place.as_uri() if self.version == 2 else str(place)
            token = description.guid if self.version == 2 else description.instantiationToken
            self._instantiate([name, token.encode(), resources or right.encode()], logger, logging)

    def _instantiate(self, names, logger, logging):
        pointer, text = ctypes.c_void_p, ctypes.c_char_p
        kind = (pointer, text) if self.version == 2 else (pointer,)
        self._log = ctypes.CFUNCTYPE(None, *kind, ctypes.c_int, text, text)(
            lambda *told: self.heard.append((told[-3], told[-1].decode()))
        )
        log = ctypes.cast(self._log, pointer) if logger else None
        if self.version == 2:
            self._callbacks = Callbacks(log=log)
            make, last = self.library.fmi2Instantiate, [ctypes.byref(self._callbacks), 0, logging]
            arguments = [names[0], 1, *names[1:], *last]
        else:
            make = self.library.fmi3InstantiateCoSimulation
            arguments = [*names, False, logging, False, False, None, ctypes.c_size_t(0), None, log,
                         None]  # fmt: skip
        make.restype = pointer
        self.instance = pointer(make(*arguments))

    def call(self, name, *arguments):
        """Return what a function of this version answers to the instance and arguments."""
        return getattr(self.library, f"fmi{self.version}{name}")(self.instance, *arguments)

    def free(self):
        self.call("FreeInstance")

    def initialize(self, start=0.0, stop=None):
        times = [ctypes.c_double(start), stop is not None, ctypes.c_double(stop or 0.0)]
        times = [False, ctypes.c_double(0.0), *times]
        statuses = [self.call("SetupExperiment", *times)] if self.version == 2 else []
        return [
            *statuses,
            self.call("EnterInitializationMode", *(times if self.version == 3 else [])),
            self.call("ExitInitializationMode"),
        ]

    def step(self, time, size=STEP):
        """Return the status of a step and the last successful time."""
        last = ctypes.c_double(-1.0)
        times = [ctypes.c_double(time), ctypes.c_double(size), False]
        if self.version == 2:
            status = self.call("DoStep", *times)
            self.call("GetRealStatus", 2, ctypes.byref(last))
        else:
            flags = [ctypes.byref(ctypes.c_bool()) for _ in range(3)]
            status = self.call("DoStep", *times, *flags, ctypes.byref(last))
        return status, last.value

    def terminated(self):
        value = ctypes.c_int(-1)
        self.call("GetBooleanStatus", 3, ctypes.byref(value))
        return value.value

    def reference(self, name):
        if isinstance(name, int):
            return name
        return self.variables[name].valueReference if name in self.variables else UNKNOWN

    def is_one(self, name, kind):
        """Return whether a name is that of a variable that is read and set by this kind."""
        kinds = {"Enumeration": ("Integer", "Int32", "Int64")}
        return any(
            v.valueReference == self.reference(name) and kind in kinds.get(v.type, (v.type,))
            for v in self.variables.values()
        )

    def count(self, names):
        """Return how many values references stand for, 1 for one that there is not."""
        sizes = {v.valueReference: v for v in self.variables.values()}
        found = 0
        for name in names:
            variable = sizes.get(self.reference(name))
            dimensions = variable.dimensions if variable and self.version == 3 else []
            found += int(dimensions[0].start) if dimensions else 1
        return found

    def move(self, verb, kind, names, surplus=0):
        """Get or set variables by a kind and with a wrong number of values; return all of it."""
        references = (ctypes.c_uint32 * len(names))(*map(self.reference, names))
        count = max(self.count(names) + surplus, 0)
        values = (KINDS[self.version][kind] * max(count, 1))()
        if verb == "Set" and kind == "String":
            values = (ctypes.c_char_p * max(count, 1))(*[b""] * count)
        sizes = [ctypes.c_size_t(count)] if self.version == 3 else []
        size = ctypes.c_size_t(len(names))
        return self.call(f"{verb}{kind}", references, size, values, *sizes), list(values)[:count]

    def number(self, name):
        return self.move("Get", "Real" if self.version == 2 else "Float64", [name])[1][0]


def instances(folder, out):
    """Whether there is an instance, and what was told, by name and location of the resources."""
    moved = Path(out, "spä ce %41#")
    shutil.copytree(folder, moved)
    plain, letters = str(moved / "resources"), quote(str(moved / "resources"))
    found = {}
    made = ("file://" + letters, "file:" + letters, "File://localhost" + letters + "/", plain,
            "file://" + plain)  # fmt: skip
    refused = ("file:///nowhere/50%", "file://elsewhere" + letters, "file:", out, "x" * 5000)
    incomplete = Path(out, "incomplete")
    shutil.copytree(Path(folder, "resources"), incomplete)
    (module,) = incomplete.glob("lcmchain_unit_fmi?.py")
    module.unlink()
    for kind, places in (("made", made), ("refused", (*refused, str(incomplete)))):
        units = [Bare(folder, resources=place.encode()) for place in places]
        found[kind] = [[bool(u.instance.value), [text for _, text in u.heard]] for u in units]
        for unit in units:
            if unit.instance.value:
                unit.free()
    names = (b"\xff", b"\xe4bc", b"\xed\xa0\x80", b"\xc0\x80", b"\xe2\x82", "ä€😀".encode())
    units = [Bare(folder, name=name) for name in names]
    found["named"] = [bool(unit.instance.value) for unit in units]
    found["latin"] = bool(Bare(folder, resources=b"/tmp/\xe4").instance.value)
    units[-1].free()
    return found


def altered(folder, out):
    """Whether there is an instance, and what was told, where a file of the resources is another."""
    moved = Path(out, "altered")
    shutil.copytree(Path(folder, "resources"), moved)
    (module,) = moved.glob("lcmchain_unit_fmi?.py")
    first, unit = moved / "slavemodule.txt", moved / "unit.json"
    name = first.read_bytes()
    changes = [(first, content) for content in (b"", b"os", name + b"\r\n", name + b"x", b"\xff")]
    changes += [(module, content) for content in (b"class LcmchainUnit(:\n", b"")]
    changes += [(unit, b"[" * 100_000), (first, name + b"\nanything")]
    found = []
    for path, content in changes:
        before = path.read_bytes()
        path.write_bytes(content)
        made = Bare(folder, resources=bytes(moved))
        found.append([bool(made.instance.value), [text for _, text in made.heard]])
        if made.instance.value:
            made.free()
        path.write_bytes(before)
    return found


def unread(folder):
    """The statuses where nobody reads what is printed: an error, a discarded step, a good one."""
    unit = Bare(folder)
    unit.initialize()
    stderr, sys.stderr = sys.stderr, io.StringIO()
    sys.stderr.close()
    try:
        real = next(iter(KINDS[unit.version]))
        found = [unit.move("Set", real, ["punch.travel"])[0], unit.step(0.0)[0], unit.step(0.0)[0]]
    finally:
        sys.stderr = stderr
    unit.free()
    return found


def percent(folder):
    """The text of an error that holds a %."""
    unit = Bare(folder)
    text = (ctypes.c_char_p * 1)(b"/proc/3 % slower")
    one = (ctypes.c_uint32 * 1)(unit.reference("out_dir"))
    sizes = [ctypes.c_size_t(1)] if unit.version == 3 else []
    unit.call("SetString", one, ctypes.c_size_t(1), text, *sizes)
    unit.initialize()
    unit.free()
    return unit.heard[-1][1]


def unheard(folder):
    """Without a logger: an event, an error, a discarded step."""
    unit = Bare(folder, logger=False)
    unit.initialize()
    real = next(iter(KINDS[unit.version]))
    found = [unit.move("Set", real, ["punch.travel"])[0], unit.step(0.0)[0], unit.step(0.0)[0]]
    unit.free()
    return found


def quiet(folder, out):
    """Without debug logging: what the logger hears nonetheless, and what with it."""
    found = []
    for logging in (False, True):
        unit = Bare(folder, logging=logging)
        text = (ctypes.c_char_p * 1)(out.encode())
        one = (ctypes.c_uint32 * 1)(unit.reference("out_dir"))
        sizes = [ctypes.c_size_t(1)] if unit.version == 3 else []
        unit.call("SetString", one, ctypes.c_size_t(1), text, *sizes)
        unit.initialize()
        unit.call("GetString", None, ctypes.c_size_t(1), None, *sizes)
        unit.call("Terminate")
        found.append(sorted({status for status, _ in unit.heard}))
        unit.free()
    return found


def chosen(folder):
    """Texts of the categories that a master names; what it does not hear is an error too."""
    unit = Bare(folder)
    names = [(ctypes.c_char_p * 1)(name) for name in (b"logStatusDiscard", b"logAll", b"other")]
    found = []
    for name in names:
        status = unit.call("SetDebugLogging", True, ctypes.c_size_t(1), name)
        before = len(unit.heard)
        refused = unit.move("Set", next(iter(KINDS[unit.version])), [123456])[0]
        found.append([status, refused, len(unit.heard) - before])
    unit.free()
    return found


def times(folder):
    """A start, a discarded step, a good one, one past the stop time, one up to it."""
    unit = Bare(folder)
    found = {"initialized": unit.initialize(7.0, 7.0 + 2.5 * STEP), "time": unit.number("time")}
    ends = unit.terminated if unit.version == 2 else lambda: None
    # What a master has summed up is another number than the unit's: it gets its own back.
    summed = 7.0 + STEP + 1e-14
    steps = [(5.0, STEP), (7.0, STEP), (summed, 2 * STEP), (summed, 1.5 * STEP), (summed, 0.0)]
    found["steps"] = [[*unit.step(*step), ends()] for step in steps[:-2]]
    found["own"] = [summed, unit.step(*steps[-1])[1]]
    found["steps"].append([*unit.step(*steps[-2]), ends()])
    unit.call("Reset")
    found["anew"] = [unit.initialize(), unit.number("time"), unit.step(0.0, 4 * STEP)[0]]
    unit.free()
    return found


def states(folder):
    """A state that is null, memory of the wrong size, the right one."""
    unit = Bare(folder)
    unit.initialize()
    ending = "FMUstate" if unit.version == 2 else "FMUState"
    state, size = ctypes.c_void_p(), ctypes.c_size_t()
    found = {"null": unit.call(f"Set{ending}", None)}
    unit.call(f"Get{ending}", ctypes.byref(state))
    unit.call(f"Serialized{ending}Size", state, ctypes.byref(size))
    memory = (ctypes.c_char * (size.value + 8))()
    found["sizes"] = [
        unit.call(f"Serialize{ending}", state, memory, ctypes.c_size_t(size.value + change))
        for change in (-1, 8, 0)
    ]
    before = _state_count()
    for _ in range(3):
        unit.call(f"Get{ending}", ctypes.byref(state))
    found["more"] = _state_count() - before
    unit.call(f"Free{ending}", ctypes.byref(state))
    found["left"] = state.value
    unit.free()
    return found


def _state_count():
    return sum(type(one).__name__ == "SavedState" for one in gc.get_objects())


def values(folder):
    """Getters with what there is not, and with wrong numbers of values."""
    unit = Bare(folder)
    unit.initialize()
    kinds = list(KINDS[unit.version])
    known = {0: "punch.travel", 1: "status", 2: "punch.drive", 3: "message"}
    found = {"own": [unit.move("Get", kinds[k], [name])[0] for k, name in known.items()]}
    found["others"] = [
        unit.move("Get", kind, [name])[0]
        for place, kind in enumerate(kinds)
        for name in (*[n for k, n in known.items() if k != place], 123456, 2**31 + 5)
    ]
    by = "Integer" if unit.version == 2 else "Int64"
    found["state"] = unit.move("Get", by, ["step_outcome"])
    if unit.version == 3:
        found["counts"] = [
            unit.move("Get", kinds[k], names, surplus)[0]
            for k, names in ((0, ["thickness"]), (0, ["thickness", "punch.travel"]),
                             (1, ["status"]), (2, ["punch.drive"]), (3, ["message"] * 5))
            for surplus in (-1, 1, 1150, 100_000)
        ]  # fmt: skip
        found["first"] = unit.move("Get", kinds[0], ["thickness"], 1 - unit.count(["thickness"]))[0]
        found["texts"] = [
            unit.move("Set", "String", ["out_dir"] * count, surplus)[0]
            for count, surplus in ((1, 1), (2, 5000), (2, -1), (1, -1))
        ]
        found["discarded"] = unit.step(0.0)[0]
        found["modes"] = [unit.call(mode) for mode in MODES]
        found["read"] = unit.move("Get", kinds[0], ["punch.travel", "thickness"], 3)[1][1:3]
    missing = type(unit.instance)()
    there, unit.instance = unit.instance, missing
    found["nothing"] = unit.call("Terminate")
    unit.instance = there
    found["step"] = unit.step(0.0)[0]
    unit.free()
    return found


if __name__ == "__main__":
    where, out_dir = sys.argv[1:]
    tried = {
        "unheard": unheard(where), "quiet": quiet(where, out_dir), "chosen": chosen(where),
        "times": times(where), "states": states(where), "values": values(where),
        "instances": instances(where, out_dir), "percent": percent(where),
        "altered": altered(where, out_dir), "unread": unread(where),
    }  # fmt: skip
    print(json.dumps(tried))
