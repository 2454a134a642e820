"""The guard in the exporter's library: refused calls end with an error, no call ends the host."""

import io
import json
import os
import shutil
import struct
import subprocess
import sys
from importlib.resources import files
from pathlib import Path

import pytest
from elftools.elf.elffile import ELFFile
from fmpy import extract

from lcmchain.errors import InputError
from lcmchain.fmu import build
from lcmchain.fmu.description import model_description
from lcmchain.fmu.library.compile import compiled, hash_of_sources
from lcmchain.fmu.library.link import (
    FREE_OF_INSTANCES,
    LinkError,
    guard_object,
    guarded,
    unit_table,
)
from lcmchain.fmu.part import UnitDefinition
from lcmchain.fmu.variables import TIME, Kind, Variable

LIBRARIES = {2: "linux64", 3: "x86_64-linux"}
STEP = 1e-4
ERROR = 3

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the guard is that of Linux")


@pytest.fixture(scope="module", params=[2, 3])
def version(request):
    return request.param


@pytest.fixture(scope="module")
def folder(version, patch_file, tmp_path_factory):
    """The unpacked unit of the patch."""
    where = tmp_path_factory.mktemp(f"guard{version}")
    unit = build.build_fmu(patch_file, where / "patch.fmu", fmi=version)
    return extract(str(unit), unzipdir=str(where / "unpacked"))


@pytest.fixture(scope="module")
def answers(folder):
    """What a unit answered in a process of its own, which has come to its end."""
    done = subprocess.run(
        [sys.executable, Path(__file__).with_name("bare.py"), folder, Path(folder).parent],
        capture_output=True,
        text=True,
        env={**os.environ, "NUMBA_NUM_THREADS": "1"},
        timeout=300,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    return json.loads(done.stdout.splitlines()[-1])


def test_a_master_without_a_logger_gets_every_status(answers):
    assert answers["unheard"] == [ERROR, 2, 0]


def test_without_debug_logging_only_what_went_wrong_is_told(answers):
    assert answers["quiet"] == [[ERROR], [0, ERROR]]


def test_an_error_of_a_category_that_is_not_heard_is_an_error(answers):
    """What was set is refused; heard with the second choice only; the third is no category."""
    assert answers["chosen"] == [[0, ERROR, 0], [0, ERROR, 1], [ERROR, ERROR, 1]]


def test_time_is_that_of_the_start_from_initialization_on(answers):
    assert set(answers["times"]["initialized"]) == {0}
    assert answers["times"]["time"] == 7.0


def test_last_successful_time_is_the_point_reached_and_terminated_that_of_the_last_step(
    answers, version
):
    statuses, reached, ends = zip(*answers["times"]["steps"])
    assert statuses == (2, 0, ERROR, 0)
    exact = [7.0, 7.0 + STEP, 7.0 + STEP, 7.0 + 2.5 * STEP]
    assert reached == pytest.approx(exact, rel=1e-14)
    assert ends == ((1, 0, 0, 0) if version == 2 else (None,) * 4)
    masters, back = answers["times"]["own"]
    assert back == masters, "a rounding behind its own time is a part of the step to a master"


def test_a_reset_forgets_start_and_stop_time(answers):
    statuses, time, step = answers["times"]["anew"]
    assert (set(statuses), time, step) == ({0}, 0.0, 0)


def test_states_that_are_null_and_memory_of_another_size_are_refused(answers):
    found = answers["states"]
    assert (found["null"], found["sizes"], found["left"]) == (ERROR, [ERROR, ERROR, 0], None)


def test_a_state_that_is_saved_again_takes_the_place_of_the_one_before(answers):
    assert answers["states"]["more"] == 0


def test_resources_are_found_by_every_form_of_their_location(answers):
    assert answers["instances"]["made"] == [[True, []]] * 5


def test_a_location_without_resources_is_told_and_makes_no_instance(answers, version):
    refused = answers["instances"]["refused"]
    assert [made for made, _ in refused] == [False] * 6
    for _, (told,) in refused:
        assert told.startswith("the resources of the unit are not at ")
    percent = "%%" if version == 2 else "%"
    (told,) = refused[0][1]
    assert f'"file:///nowhere/50{percent}"' in told and "hand in the folder resources" in told


def test_files_of_the_resources_that_were_altered_are_named_and_make_no_instance(answers, version):
    """The exporters ended the host with a segmentation fault, or never came back."""
    *refused, made = answers["altered"]
    assert [there for there, _ in refused] == [False] * 8 and made == [True, []]
    named = ["slavemodule.txt"] * 5 + [f"lcmchain_unit_fmi{version}.py"] * 2
    for name, (_, texts) in zip(named, refused):
        (told,) = texts
        assert told.startswith(f"resources/{name} is not as it was built; unpack the unit again")
    (told,) = refused[-1][1]
    assert "the resources of the unit are missing or damaged" in told


def test_an_instance_goes_on_where_nobody_reads_what_it_prints(answers):
    assert answers["unread"] == [ERROR, 2, 0]


def test_names_and_locations_that_are_no_utf8_make_no_instance(answers):
    assert answers["instances"]["named"] == [False] * 5 + [True]
    assert not answers["instances"]["latin"]


def test_a_logger_of_fmi_2_that_formats_its_texts_finds_no_value_in_them(answers, version):
    assert ("/proc/3 %% slower" if version == 2 else "/proc/3 % slower") in answers["percent"]


def test_a_host_without_lcmchain_gets_no_instance_and_the_reason(folder):
    """The exporter of FMI 3.0 hangs where the entry file raises."""
    program = (
        "import sys; sys.modules['lcmchain'] = None\n"
        f"sys.path.insert(0, {str(Path(__file__).parent)!r}); import bare\n"
        f"unit = bare.Bare({str(folder)!r}); print(unit.instance.value, unit.heard)"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("None "), done.stdout
    assert "this unit needs lcmchain in the Python" in done.stdout


def test_values_that_there_are_not_are_refused_whatever_their_type(answers, version):
    found = answers["values"]
    assert found["own"] == [0, 0, 0, 0]
    assert len(found["others"]) > 16 and set(found["others"]) == {ERROR}
    assert (found["nothing"], found["step"]) == (ERROR, 0)


def test_an_enumeration_is_read_as_the_integer_of_its_version(answers):
    assert answers["values"]["state"] == [0, [0]]


def test_getters_with_another_number_of_values_are_refused_and_read_what_there_is(answers, version):
    if version == 2:
        pytest.skip("FMI 2.0 has no arrays")
    found = answers["values"]
    assert len(found["counts"]) == 20 and set(found["counts"]) == {ERROR}
    assert found["read"][0] == found["read"][1] > 0.0
    assert found["first"] == 0, "masters without arrays ask for one value of a field"


def test_texts_of_another_number_than_their_references_are_refused(answers, version):
    if version == 2:
        pytest.skip("FMI 2.0 has one number for both")
    assert answers["values"]["texts"] == [ERROR] * 4
    assert answers["values"]["discarded"] == 2, "the step after a refused call"


def test_modes_that_are_not_offered_are_refused(answers, version):
    if version == 2:
        pytest.skip("FMI 2.0 has none")
    assert answers["values"]["modes"] == [ERROR] * 5


# --- linking --------------------------------------------------------------------------------------


def exporter(version):
    place = files(build.EXPORTERS[version]) / "resources" / "binaries" / LIBRARIES[version]
    (found,) = (path.read_bytes() for path in place.iterdir() if path.name.endswith(".so"))
    return found


def functions(content, version):
    """Addresses of the functions of the standard that a library offers."""
    symbols = ELFFile(io.BytesIO(content)).get_section_by_name(".dynsym").iter_symbols()
    return {s.name: s["st_value"] for s in symbols if s.name.startswith(f"fmi{version}")}


def test_every_function_that_takes_an_instance_is_the_guards(version):
    original = exporter(version)
    changed = guarded(original, version, [TIME], b"")
    before, after = functions(original, version), functions(changed, version)
    left = {name for name in before if before[name] == after[name]}
    assert left == FREE_OF_INSTANCES & set(before) and len(before) > 30
    segments = list(ELFFile(io.BytesIO(changed)).iter_segments())
    runs = [(s["p_vaddr"], s["p_vaddr"] + s["p_memsz"]) for s in segments if s["p_flags"] & 1]
    for name in set(after) - left:
        assert any(start <= after[name] < end for start, end in runs)


def test_the_guard_reads_the_time_wherever_it_stands_among_the_variables(version):
    """Behind a text and a field of three values, as the model description numbers it."""
    text = Variable("scene", Kind.STRING, "local", "constant", "title", start="")
    field = Variable("thickness", Kind.REAL, "input", "continuous", "of it", "m", start=0.0, size=3)
    unit = UnitDefinition("0", {}, "title", "name", (text, field, TIME), 1.0, 0.1)
    (told,) = (
        entry for entry in model_description(unit, version).iter() if entry.get("name") == "time"
    )
    _, time = struct.unpack_from("<2I", unit_table(unit.variables, b"", arrays=version == 3))
    assert time == int(told.get("valueReference")) == {2: 4, 3: 2}[version]


def test_an_exporter_that_the_guard_does_not_know_is_refused(
    version, patch_file, monkeypatch, tmp_path
):
    other = exporter(version).replace(f"fmi{version}Reset".encode(), f"fmi{version}Other".encode())
    with pytest.raises(LinkError, match=f"no fmi{version}Reset"):
        guarded(other, version, [TIME], b"")
    more = exporter(version).replace(
        f"fmi{version}GetVersion".encode(), b"fmi%dNewFeature" % version
    )
    with pytest.raises(LinkError, match=f"no fmi{version}NewFeature"):
        guarded(more, version, [TIME], b"")
    monkeypatch.setattr(build, "guarded", lambda *_: guarded(other, version, [TIME], b""))
    with pytest.raises(InputError, match="install an earlier one"):
        build.build_fmu(patch_file, tmp_path / "patch.fmu", fmi=version)


@pytest.mark.parametrize("content", [b"", b"MZ another system", b"\x7fELF\x02\x01\x01"])
def test_what_is_no_library_of_this_kind_is_left_as_it_is(content):
    assert guarded(content, 3, [TIME], b"") == content


def test_the_object_is_that_of_its_sources(version):
    (stamp,) = (
        section.data().rstrip(b"\0").decode()
        for section in guard_object(version).iter_sections()
        if section.name == ".comment.sources"
    )
    assert stamp == hash_of_sources(version), "run python -m lcmchain.fmu.library.compile"


def test_the_sources_compile_to_the_same_functions(version):
    if shutil.which("gcc") is None or os.uname().machine != "x86_64":
        pytest.skip("needs gcc on x86-64")
    made = ELFFile(io.BytesIO(compiled(version)))

    def names(file):
        symbols = file.get_section_by_name(".symtab").iter_symbols()
        return sorted(s.name for s in symbols if s["st_info"]["bind"] == "STB_GLOBAL")

    assert names(made) == names(guard_object(version))
