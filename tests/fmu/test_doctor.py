"""What a unit needs on this machine, told before anything of it is loaded."""

import json
import random
import re
import shutil
import subprocess
import sys
import venv
import zipfile
from pathlib import Path

import pytest
from typer.testing import CliRunner

from lcmchain.cli import app
from lcmchain.errors import InputError
from lcmchain.fmu.doctor import Level, examine
from lcmchain.fmu.doctor.binary import (
    SharedObject,
    newest_versions,
    platform_folders,
    read_shared_object,
)

FMI2, FMI3 = platform_folders()
TIME = '<Float64 name="time" valueReference="0" causality="independent"/>'
ON_LINUX = pytest.mark.skipif(
    not sys.platform.startswith("linux") or shutil.which("gcc") is None, reason="needs Linux, gcc"
)
ABILITIES = 'canGetAndSetFMUstate="true" canHandleVariableCommunicationStepSize="true"'


def make_unit(
    path, *, abilities=ABILITIES, kind="CoSimulation", binary=None, files=(), version="2.0", rows=""
):
    """Write a unit as another tool could: a description, a binary, resources."""
    description = (
        f'<fmiModelDescription fmiVersion="{version}" modelName="Pump" guid="1" '
        f'generationTool="Tool 7"><{kind} modelIdentifier="pump" {abilities}/>'
        f"<ModelVariables>{rows}</ModelVariables></fmiModelDescription>"
    )
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", description)
        if binary is not None:
            archive.writestr(f"binaries/{FMI2}/pump.so", Path(binary).read_bytes())
        for name, text in dict(files).items():
            archive.writestr(name, text)
    return path


def compiled(folder, name, text, *options):
    """Compile a shared library from C."""
    source = folder / f"{name}.c"
    source.write_text(text)
    library = folder / f"{name}.so"
    command = ["gcc", "-shared", "-fPIC", "-o", str(library), str(source), *map(str, options)]
    subprocess.run(command, check=True)
    return library


def told(diagnosis, level):
    return [finding for finding in diagnosis.findings if finding.level is level]


@pytest.fixture(scope="session")
def bare_python(tmp_path_factory):
    """A Python without any package."""
    folder = tmp_path_factory.mktemp("bare") / "environment"
    venv.create(folder, symlinks=True)
    return folder / "bin" / "python"


# --- units of lcmchain ----------------------------------------------------------------------------


def test_own_unit_can_run_in_this_python(unit):
    answer = CliRunner().invoke(app, ["fmu", "doctor", str(unit), "--json"])
    assert answer.exit_code == 0, answer.output
    found = json.loads(answer.output)
    assert found["runs"] is True and found["fmi_version"] == "2.0"
    assert FMI2 in found["platforms"]
    assert found["python"]["version"] == sys.version.split()[0]
    assert Path(found["python"]["prefix"]) == Path(sys.prefix)
    assert found["python"]["distributions"]["lcmchain"]
    levels = {finding["level"] for finding in found["findings"]}
    assert levels == {"ok"} or levels == {"ok", "note"}, found["findings"]


def test_other_python_without_lcmchain_gets_one_message_with_a_remedy(unit, bare_python):
    diagnosis = examine(unit, python=bare_python)
    (missing,) = told(diagnosis, Level.MISSING)
    assert "no module lcmchain" in missing.text and str(bare_python.parents[1]) in missing.text
    assert "-m pip install lcmchain==" in missing.remedy and str(bare_python) in missing.remedy
    answer = CliRunner().invoke(app, ["fmu", "doctor", str(unit), "--python", str(bare_python)])
    assert answer.exit_code == 1
    assert "cannot run here, 1 missing" in answer.output


def test_host_that_is_a_python_script_is_asked_for_its_own_python(unit, bare_python, tmp_path):
    script = tmp_path / "master"
    script.write_text(f"#!{bare_python}\nprint()\n")
    script.chmod(0o755)
    diagnosis = examine(unit, host=str(script))
    (missing,) = told(diagnosis, Level.MISSING)
    assert str(bare_python.parents[1]) in missing.text


def changed(unit, other, name, change):
    """Write a unit of which one file is what ``change`` makes of it, and left out for None."""
    with zipfile.ZipFile(unit) as old, zipfile.ZipFile(other, "w") as new:
        for entry in old.namelist():
            content = old.read(entry)
            if entry == name:
                content = change(content)
            if content is not None:
                new.writestr(entry, content)
    return other


def test_unit_of_another_version_is_a_warning(unit, tmp_path):
    def older(content):
        return json.dumps(json.loads(content) | {"lcmchain_version": "0.0.1"}).encode()

    diagnosis = examine(changed(unit, tmp_path / "other.fmu", "resources/unit.json", older))
    (warning,) = told(diagnosis, Level.WARNING)
    assert "built with lcmchain 0.0.1" in warning.text and diagnosis.runs


@pytest.mark.parametrize(
    "file, content",
    [("unit.json", b"{"), ("unit.json", None), ("scene/scene.toml", None), ("interface.nc", b"")],
)
def test_own_unit_with_damaged_resources_cannot_run(unit, tmp_path, file, content):
    other = changed(unit, tmp_path / "other.fmu", f"resources/{file}", lambda _: content)
    (missing,) = told(examine(other), Level.MISSING)
    assert missing.subject == "resources" and missing.remedy == "build the unit again"


def test_own_unit_with_the_identifier_of_another_cannot_run(unit, tmp_path):
    """Masters hand on the identifier of the description, which the unit compares at its start."""

    def renamed(content):
        return re.sub(rb'guid="[^"]*"', b'guid="changed"', content)

    other = changed(unit, tmp_path / "other.fmu", "modelDescription.xml", renamed)
    (missing,) = told(examine(other), Level.MISSING)
    assert missing.subject == "resources" and "another unit (changed instead" in missing.text


# --- units of others ------------------------------------------------------------------------------


def test_imports_and_requirements_of_a_python_unit_are_followed(tmp_path):
    files = {
        "resources/slavemodule.txt": "model",
        "resources/model.py": (
            "import json, helper\nfrom absent_one.part import x\n"
            "try:\n    import absent_two\nexcept ImportError:\n    absent_two = None\n"
            "try:\n    import absent_three\nexcept ImportError as e:\n    raise SystemExit from e\n"
            "def f():\n    import absent_four\n"
        ),
        "resources/helper.py": "import absent_five\nfrom . import nothing\n",
        "resources/unused.py": "import absent_six\n",
        "resources/requirements.txt": "numpy>=1.0  # arrays\nscipy<0.1\nabsent-seven\n-r x\n",
    }
    diagnosis = examine(make_unit(tmp_path / "a.fmu", files=files))
    missing = [f.text for f in told(diagnosis, Level.MISSING) if f.subject == "packages"]
    for name in ("absent_one", "absent_three", "absent_five"):
        assert sum(f"no module {name} " in text for text in missing) == 1, name
    assert any("scipy<0.1; it is" in text for text in missing)
    assert any("absent-seven; it is not installed" in text for text in missing)
    assert len(missing) == 5
    (warning,) = [f.text for f in told(diagnosis, Level.WARNING)]
    assert "absent_four, absent_two" in warning
    assert "absent_six" not in json.dumps(diagnosis.as_dict())


@pytest.mark.parametrize("name", ["", "model\r\n", "other", "json", "x" * 300, "\ufeffmodel"])
def test_a_module_that_is_not_in_the_unit_is_missing(tmp_path, name):
    files = {"resources/slavemodule.txt": name, "resources/model.py": ""}
    (missing,) = (
        finding
        for finding in told(examine(make_unit(tmp_path / "a.fmu", files=files)), Level.MISSING)
        if finding.subject == "python"
    )
    assert missing.text.startswith("slavemodule.txt names the module") and missing.remedy


def test_a_module_that_is_no_python_is_missing_and_one_that_it_imports_a_warning(tmp_path):
    broken = "class Model(:\n"
    for module, other, level in (
        (broken, "", Level.MISSING), ("import helper\n", broken, Level.WARNING),
    ):  # fmt: skip
        files = {
            "resources/slavemodule.txt": "model\n", "resources/model.py": module,
            "resources/helper.py": other,
        }  # fmt: skip
        diagnosis = examine(make_unit(tmp_path / "a.fmu", files=files))
        assert any("cannot be read as Python" in f.text for f in told(diagnosis, level))


def test_unit_without_a_binary_for_this_machine(tmp_path):
    diagnosis = examine(make_unit(tmp_path / "a.fmu", files={"binaries/beos32/pump.so": ""}))
    (missing,) = told(diagnosis, Level.MISSING)
    assert f"binaries/{FMI2}/pump" in missing.text and "only beos32" in missing.text
    with_sources = make_unit(tmp_path / "b.fmu", files={"sources/all.c": "int x;"})
    (missing,) = told(examine(with_sources), Level.MISSING)
    assert "fmpy compile" in missing.remedy


@ON_LINUX
def test_libraries_of_a_binary_are_found_or_named(tmp_path):
    flow = compiled(tmp_path, "libflow", "int flow(void) { return 1; }", "-Wl,-soname,libflow.so")
    use = "int flow(void); int step(void) { return flow(); }"
    binary = compiled(tmp_path, "pump", use, flow)
    (missing,) = told(examine(make_unit(tmp_path / "a.fmu", binary=binary)), Level.MISSING)
    assert "libflow.so, which pump.so needs" in missing.text
    found = compiled(tmp_path, "pump", use, flow, f"-Wl,-rpath,{tmp_path}")
    diagnosis = examine(make_unit(tmp_path / "b.fmu", binary=found), host="ls")
    assert diagnosis.runs and diagnosis.facts["libraries"]["libflow.so"] == str(flow)
    assert any("asks nothing of ls" in finding.text for finding in diagnosis.findings)
    # a symbol that no library has
    lone = compiled(tmp_path, "pump", use)
    (warning,) = told(examine(make_unit(tmp_path / "c.fmu", binary=lone)), Level.WARNING)
    assert "(flow)" in warning.text


@ON_LINUX
def test_too_old_a_library_is_named_with_the_version_that_is_there(tmp_path):
    script = tmp_path / "versions"

    def library(*versions):
        script.write_text("".join(f"{v} {{ global: *; }};\n" for v in versions))
        option = f"-Wl,-soname,libflow.so,--version-script={script}"
        return compiled(tmp_path, "libflow", "int flow(void) { return 1; }", option)

    newer = library("FLOW_1.10")
    text = "int flow(void); int step(void) { return flow(); }"
    binary = compiled(tmp_path, "pump", text, newer, f"-Wl,-rpath,{tmp_path}")
    unit = make_unit(tmp_path / "a.fmu", binary=binary)
    assert examine(unit).runs
    library("FLOW_1.9")
    (missing,) = told(examine(unit), Level.MISSING)
    assert "FLOW_1.10 of libflow.so; here it goes up to FLOW_1.9" in missing.text


def test_newest_versions_go_by_their_numbers():
    asked = {"libc.so.6": ("GLIBC_2.9", "GLIBC_2.32", "GLIBC_2.4"), "libx": ("X_1", "X_PRIVATE")}
    file = SharedObject(
        Path("pump.so"), ("x64", 64), (), (), asked, frozenset(), frozenset(), frozenset(), ""
    )
    assert newest_versions(file) == {"GLIBC": "2.32", "X": "1"}


@ON_LINUX
def test_binary_that_is_none(tmp_path):
    text = tmp_path / "text.so"
    text.write_text("not a library")
    (missing,) = told(examine(make_unit(tmp_path / "a.fmu", binary=text)), Level.MISSING)
    assert "no shared library" in missing.text


@ON_LINUX
def test_damaged_binaries_are_read_or_refused(tmp_path):
    content = compiled(tmp_path, "pump", "int step(void) { return 1; }").read_bytes()
    chance, path, outcomes = random.Random(4), tmp_path / "damaged.so", set()
    for _ in range(150):
        damaged = bytearray(content)
        for _ in range(chance.randrange(1, 30)):
            damaged[chance.randrange(len(damaged))] = chance.randrange(256)
        path.write_bytes(
            damaged[: chance.randrange(len(damaged))] if chance.random() < 0.3 else damaged
        )
        outcomes.add(read_shared_object(path) is None)
    assert outcomes == {True, False}


@pytest.mark.parametrize(
    ("abilities", "kind", "words"),
    [
        ('canHandleVariableCommunicationStepSize="true"', "CoSimulation", "canGetAndSetFMUstate"),
        ('canGetAndSetFMUstate="true"', "CoSimulation", "steps of one size"),
        (f'{ABILITIES} needsExecutionTool="true"', "CoSimulation", "needsExecutionTool"),
        (ABILITIES, "ModelExchange", "no co-simulation"),
    ],
)  # fmt: skip
def test_what_a_unit_cannot_do_is_a_warning(tmp_path, abilities, kind, words):
    diagnosis = examine(make_unit(tmp_path / "a.fmu", abilities=abilities, kind=kind))
    (warning,) = told(diagnosis, Level.WARNING)
    assert words in warning.text
    whole = examine(make_unit(tmp_path / "b.fmu"))
    assert told(whole, Level.WARNING) == []


@pytest.mark.parametrize(
    ("version", "rows", "words"),
    [
        ("2.0", 2 * '<ScalarVariable name="p" valueReference="1"><Real/></ScalarVariable>',
         "names of variables are not unique (p)"),
        ("3.0", f'{TIME}<Clock name="tick" valueReference="1" intervalVariability="triggered"/>',
         "its clocks (tick) do not tick"),
        ("3.0", f'{TIME}<Binary name="blob" valueReference="1"/>', "(blob) are left out"),
        ("3.0-beta.2", "", 'lcmchain cosim refuses it: it is of FMI "3.0-beta.2", a draft'),
    ],
)  # fmt: skip
def test_what_the_master_does_not_take_of_a_unit_is_a_warning(tmp_path, version, rows, words):
    abilities = f'{ABILITIES} hasEventMode="true"'
    unit = make_unit(tmp_path / "a.fmu", version=version, rows=rows, abilities=abilities)
    (warning,) = told(examine(unit), Level.WARNING)
    assert words in warning.text


def test_a_unit_for_one_instance_per_process_is_one_for_the_master_too(tmp_path):
    once = f'{ABILITIES} canBeInstantiatedOnlyOncePerProcess="true"'
    diagnosis = examine(make_unit(tmp_path / "a.fmu", abilities=once))
    assert any("gives each a process of its own" in f.text for f in told(diagnosis, Level.NOTE))


def test_the_step_of_a_unit_is_told_as_the_master_tells_it(tmp_path):
    own = f'{ABILITIES} fixedInternalStepSize="1e-3"'
    diagnosis = examine(make_unit(tmp_path / "a.fmu", abilities=own, version="3.0", rows=TIME))
    (note,) = [f for f in told(diagnosis, Level.NOTE) if f.subject == "abilities"
               and "fixedInternalStepSize" in f.text]  # fmt: skip
    assert "steps of 1e-3 s" in note.text


def test_program_that_a_unit_starts_must_be_there(tmp_path):
    for number, (program, is_there) in enumerate([("no-such-program", False), ("sh", True)]):
        launch = f'backend = "grpc"\n[grpc]\nlinux = ["{program}", "x"]\nwindows = ["cmd"]\n'
        files = {"resources/launch.toml": launch}
        diagnosis = examine(make_unit(tmp_path / f"{number}.fmu", files=files))
        missing = [f for f in told(diagnosis, Level.MISSING) if f.subject == "command"]
        assert bool(missing) is not is_there


def test_what_a_unit_says_of_itself_is_passed_on(tmp_path):
    page = "<html><head><title>no</title></head><body>Needs <b>Tool 7</b>\n licence</body></html>"
    files = {"documentation/externalDependencies.html": page}
    diagnosis = examine(make_unit(tmp_path / "a.fmu", files=files))
    assert diagnosis.facts["external_dependencies"] == "Needs Tool 7 licence"


def test_what_is_no_unit_is_refused(tmp_path, unit):
    text = tmp_path / "a.fmu"
    text.write_text("no archive")
    with pytest.raises(InputError, match="no ZIP archive"):
        examine(text)
    with zipfile.ZipFile(tmp_path / "b.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", "<fmiModelDescription fmiVersion='4.0'/>")
    with pytest.raises(InputError, match=r"fmiVersion \"4\.0\""):
        examine(tmp_path / "b.fmu")
    with zipfile.ZipFile(tmp_path / "c.fmu", "w") as archive:
        archive.writestr("../outside", "x")
    with pytest.raises(InputError, match="outside of the folder"):
        examine(tmp_path / "c.fmu")
    with pytest.raises(InputError, match="no Python"):
        examine(unit, python=tmp_path / "python")
    with pytest.raises(InputError, match="no program"):
        examine(unit, host="no-such-host")
