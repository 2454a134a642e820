"""Functions of FMI 3.0 that the exporter does not have end no host."""

import io
import subprocess
import sys
from importlib.resources import files
from pathlib import Path

import pytest
from elftools.elf.elffile import ELFFile
from fmpy import extract

from lcmchain.fmu.build import build_fmu
from lcmchain.fmu.unanswered import WITH_ERROR, WITH_NOTHING, answered

CALLS = """
import ctypes, sys
from fmpy import read_model_description
from fmpy.fmi3 import FMU3Slave
folder, *names = sys.argv[1:]
description = read_model_description(folder, validate=False)
slave = FMU3Slave(
    guid=description.instantiationToken, unzipDirectory=folder,
    modelIdentifier=description.coSimulation.modelIdentifier, instanceName="asked",
)
slave.instantiate()
slave.enterInitializationMode()
slave.exitInitializationMode()
some = [ctypes.cast((ctypes.c_int64 * 8)(), ctypes.c_void_p)] * 9
for name in names:
    makes = "Instantiate" in name
    function = ctypes.CFUNCTYPE(ctypes.c_void_p if makes else ctypes.c_int, *[ctypes.c_void_p] * 10)
    answer = function((name, slave.dll))(None if makes else slave.component, *some)
    assert answer == (None if makes else 3), (name, answer)
# more values than there are
status = [v.valueReference for v in description.modelVariables if v.name == "status"]
integers, truths = (ctypes.c_int32 * 1000)(), (ctypes.c_bool * 1000)()
one = (ctypes.c_uint32 * 1)(*status)
for name, memory in (("fmi3GetInt32", integers), ("fmi3GetBoolean", truths)):
    kinds = [ctypes.c_void_p] * 2 + [ctypes.c_size_t, ctypes.c_void_p, ctypes.c_size_t]
    read = ctypes.CFUNCTYPE(ctypes.c_int, *kinds)((name, slave.dll))
    places = [ctypes.cast(m, ctypes.c_void_p) for m in (one, memory)]
    assert read(slave.component, places[0], 1, places[1], 1000) == 0
slave.doStep(currentCommunicationPoint=0.0, communicationStepSize=1e-4)
slave.terminate()
slave.freeInstance()
print(len(names), "answered")
"""


@pytest.fixture(scope="module")
def folder(patch_file, tmp_path_factory):
    where = tmp_path_factory.mktemp("answers")
    return extract(
        str(build_fmu(patch_file, where / "patch.fmu", fmi=3)), unzipdir=str(where / "u")
    )


def functions(content):
    """Every function of the standard that a library offers, with its first bytes."""
    file = ELFFile(io.BytesIO(content))
    found = {}
    for symbol in file.get_section_by_name(".dynsym").iter_symbols():
        if symbol.name.startswith("fmi") and symbol["st_shndx"] != "SHN_UNDEF":
            section = file.get_section(symbol["st_shndx"])
            place = symbol["st_value"] - section["sh_addr"] + section["sh_offset"]
            found[symbol.name] = content[place : place + symbol["st_size"]]
    return found


def test_functions_that_the_exporter_lacks_answer_and_the_unit_goes_on(folder):
    (library,) = (path for path in Path(folder).rglob("*.so"))
    offered = set(functions(library.read_bytes()))
    asked = sorted((WITH_ERROR | WITH_NOTHING) & offered)
    assert len(asked) > 20 and {"fmi3GetFloat32", "fmi3GetVariableDependencies"} < set(asked)
    done = subprocess.run(
        [sys.executable, "-P", "-c", CALLS, folder, *asked], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr[-2000:]
    assert f"{len(asked)} answered" in done.stdout


def test_all_other_functions_are_those_of_the_exporter(folder):
    place = files("pythonfmu3") / "resources" / "binaries" / "x86_64-linux"
    (original,) = (path.read_bytes() for path in place.iterdir() if path.name.endswith(".so"))
    before, after = functions(original), functions(answered(original))
    changed = {name for name in before if before[name] != after[name]}
    assert changed == (WITH_ERROR | WITH_NOTHING) & set(before)
    assert answered(answered(original)) == answered(original)


@pytest.mark.parametrize("content", [b"", b"MZ another system", b"\x7fELF\x02\x01\x01"])
def test_what_is_no_library_of_this_kind_is_left_as_it_is(content):
    assert answered(content) == content
