"""Many instances, of one unit and of several, in one process; and what they leave behind."""

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from fmpy import extract, read_model_description

from lcmchain.coupling.solids.explicit import ExplicitForming
from lcmchain.errors import InputError
from lcmchain.fmu.build import build_fmu
from lcmchain.fmu.conduct import Status
from lcmchain.fmu.instances import open_unit
from lcmchain.fmu.variables import Kind
from lcmchain.scene import read_scene

CALLS = Path(__file__).with_name("calls.py")
STEP = 1e-4


@pytest.fixture(scope="module")
def folders(patch_file, tmp_path_factory):
    """Unpacked units: by version and edge length [mm]."""
    found = {}
    for version in (2, 3):
        for edge in (5, 10):
            where = tmp_path_factory.mktemp(f"unit{version}-{edge}")
            shutil.copy(patch_file, where / "patch.toml")
            unit = build_fmu(
                where / "patch.toml", where / "patch.fmu", fmi=version,
                overrides=[f"blank.edge_length={edge} mm"],
            )  # fmt: skip
            (where / "patch.toml").unlink()  # the unit needs it no more
            found[version, edge] = str(extract(str(unit), unzipdir=str(where / "unpacked")))
    return found


TOGETHER = """
import sys
sys.path.insert(0, {here!r})
from calls import Driver, WATCHED
drivers = [Driver(folder) for folder in {folders!r}]
for driver in drivers:
    driver.initialize()
for k in range(3):
    for driver in drivers:
        driver.step()
print([[x.hex() for x in driver.get("real", *WATCHED)] for driver in drivers])
print(len([path for path in sys.path if "unpacked" in path]))
for driver in drivers:
    driver.free()
"""


def together(folders):
    program = TOGETHER.format(here=str(CALLS.parent), folders=folders)
    done = subprocess.run([sys.executable, "-P", "-c", program], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-2000:]
    found = [line for line in done.stdout.splitlines() if not line.startswith("[OK]")]
    return eval(found[-2]), int(found[-1])


def test_units_in_one_process_do_not_disturb_each_other(folders):
    """Two instances of one, of another scene, and of another version of the standard."""
    five2, ten2, five3 = folders[2, 5], folders[2, 10], folders[3, 5]
    (a, b, c, d), left = together([five2, five2, ten2, five3])
    assert left == 0, "the search path is as it was"
    assert a == b == d != c
    (alone,), _ = together([ten2])
    assert alone == c


def test_edge_length_is_chosen_when_the_unit_is_built(folders):
    for (_, edge), folder in folders.items():
        starts = {v.name: v.start for v in read_model_description(folder).modelVariables}
        assert float(starts["edge_length"]) == pytest.approx(1e-3 * edge)
        assert int(starts["element_count"]) == (20 // edge) ** 2


def test_a_description_of_another_unit_is_told(folders, tmp_path, capfd):
    """The identifier that a master instantiates with comes from there."""
    shutil.copytree(folders[2, 5], tmp_path / "mixed")
    shutil.copy(Path(folders[2, 10], "modelDescription.xml"), tmp_path / "mixed")
    with pytest.raises(InputError, match="another unit"):
        open_unit(str(tmp_path / "mixed" / "resources"), "one", lambda *_: None, arrays=False)
    assert "one: " in capfd.readouterr().err


def test_a_number_below_its_limit_is_refused_with_what_to_set(folders):
    said = []
    unit = open_unit(
        f"{folders[2, 5]}/resources", "one", lambda *told: said.append(told), arrays=False
    )
    names = [v.name for v in unit.definition.variables]
    reference = [int(unit.layout.slots["threads"].start)]
    assert names[unit.layout.of_slot[reference[0]]] == "threads"
    assert unit.set_numbers(reference, [-5], Kind.INTEGER) is Status.ERROR
    assert said[-1][-1] == "one: threads was set to -5; set it to 0 or more"
    assert unit.get_numbers(reference, Kind.INTEGER) == [0.0]
    assert unit.set_numbers(reference, [1], Kind.INTEGER) is Status.OK


@pytest.mark.parametrize("damage", ["absent", "no JSON", "another part"])
def test_resources_that_are_none_are_told(folders, tmp_path, damage):
    shutil.copytree(folders[2, 5], tmp_path / "unit")
    file = tmp_path / "unit" / "resources" / "unit.json"
    if damage == "absent":
        file.unlink()
    else:
        text = "{" if damage == "no JSON" else file.read_text().replace('"forming"', '"flying"')
        file.write_text(text)
    with pytest.raises(InputError, match="missing or damaged|knows no unit"):
        open_unit(str(tmp_path / "unit" / "resources"), "one", lambda *_: None, arrays=False)


def test_a_reset_needs_the_folder_no_more(folders, tmp_path):
    """A reset that failed would be the end of the host."""
    shutil.copytree(folders[2, 5], tmp_path / "unit")
    where = str(tmp_path / "unit" / "resources")
    open_unit(where, "one", lambda *_: None, arrays=False)
    shutil.rmtree(tmp_path / "unit")
    again = open_unit(where, "again", lambda *_: None, arrays=False)
    assert again.set_up(0.0) is again.enter_initialization() is Status.OK


def test_two_instances_that_write_one_file_are_told(folders, tmp_path):
    """The later one replaces the results of the earlier one; what has ended may be replaced."""
    where = str(Path(folders[2, 5], "resources"))
    told = []

    def begun(name, folder):
        hear = lambda status, _, text: told.append((status, text))  # noqa: E731
        unit = open_unit(where, name, hear, arrays=False)
        unit.set_up(0.0)
        unit.enter_initialization()
        unit.set_texts([unit.layout.slots["out_dir"].start], [str(folder)])
        unit.exit_initialization()
        return unit

    def warnings():
        found = [text for status, text in told if status == Status.WARNING]
        told.clear()
        return found

    here = tmp_path / "here"
    one, other = begun("one", here), begun("other", tmp_path / "there")
    assert warnings() == []
    again = begun("again", here / ".." / "here")
    (warning,) = warnings()
    assert warning.startswith(f"again: the instance one of this process writes {here}/forming.nc")
    for unit in (one, again, other):
        unit.terminate()
    begun("later", here)
    begun("last", here)
    assert warnings() == [], "those before have ended, or are gone"


CYCLES = """
import gc, sys
sys.path.insert(0, {here!r})
from calls import Driver
def cycle():
    driver = Driver({folder!r})
    driver.initialize()
    driver.step()
    driver.free()
def resident():
    with open("/proc/self/statm") as opened:
        return int(opened.read().split()[1]) * 4096
for _ in range(80):  # until the allocators have what they need
    cycle()
gc.collect()
before = resident()
for _ in range({count}):
    cycle()
gc.collect()
print("grown", resident() - before)
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.slow
def test_instances_leave_no_memory_behind(folders, version):
    program = CYCLES.format(here=str(CALLS.parent), folder=folders[version, 5], count=200)
    done = subprocess.run([sys.executable, "-P", "-c", program], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-2000:]
    assert int(done.stdout.split()[-1]) < 1_000_000


# --- a fluid in the pores -------------------------------------------------------------------------


def test_wet_unit_is_the_solid_side_of_a_coupling(patch_file, tmp_path):
    """Bit for bit what :class:`ExplicitForming` does with the same pressures."""
    unit = build_fmu(patch_file, tmp_path / "wet.fmu", fmi=3, pore_pressure=True)
    folder = extract(str(unit), unzipdir=str(tmp_path / "unpacked"))
    wet = open_unit(f"{folder}/resources", "wet", lambda *_: None, arrays=True)
    wet.enter_initialization()
    wet.exit_initialization()
    part = ExplicitForming.from_scene(read_scene(patch_file))
    reference = {v.name: k for k, v in enumerate(wet.definition.variables)}
    names = {
        "volume": "volume", "volume_rate": "volume_rate", "area": "area", "area_rate": "area_rate",
        "volume_rate_slope": "volume_rate_slope", "reference_pressure": "reference_pressure",
        "fluid_thickness": "thickness", "fluid_thickness_rate": "thickness_rate",
    }  # fmt: skip
    rng = np.random.default_rng(0)
    saved = None
    for k in range(6):
        pressure = rng.uniform(0.0, 2e4, 16)
        pore = [reference["pore_pressure"]]
        assert wet.set_numbers(pore, pressure.tolist(), Kind.REAL) is Status.OK
        part.set_fields({"pore_pressure": pressure})
        if k == 3:
            saved = wet.save(), part.save()
        assert wet.step(k * STEP, STEP) is Status.OK
        part.advance(STEP)
        expected = part.get_fields(list(names.values()))
        for own, name in names.items():
            found = wet.get_numbers([reference[own]], Kind.REAL)
            assert found.tobytes() == expected[name].tobytes(), (own, k)
    assert np.ptp(expected["volume_rate"]) > 0.0
    last = wet.get_numbers([reference["volume"]], Kind.REAL)
    assert wet.restore(saved[0]) is Status.OK
    for k in range(3, 6):
        assert wet.step(k * STEP, STEP) is Status.OK  # under the pressure of then
    part.restore(saved[1])
    for _ in range(3):
        part.advance(STEP)
    again = wet.get_numbers([reference["volume"]], Kind.REAL)
    assert again.tobytes() == part.get_fields(["volume"])["volume"].tobytes() != last.tobytes()


def test_a_pressure_that_is_no_number_is_refused(patch_file, tmp_path):
    unit = build_fmu(patch_file, tmp_path / "wet.fmu", fmi=2, pore_pressure=True)
    folder = extract(str(unit), unzipdir=str(tmp_path / "unpacked"))
    told = []
    hear = lambda status, category, text: told.append(text)  # noqa: E731
    wet = open_unit(f"{folder}/resources", "wet", hear, arrays=False)
    wet.set_up(0.0)
    wet.enter_initialization()
    wet.exit_initialization()
    first = wet.layout.slots["pore_pressure"].start
    wet.set_numbers([first + 4], [float("nan")], Kind.REAL)
    assert wet.step(0.0, STEP) is Status.DISCARD
    assert "pore_pressure[5] is nan" in told[-1]
