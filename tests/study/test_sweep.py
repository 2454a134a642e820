"""Samples of a sweep, and how their values stand in its files."""

import math

import numpy as np
import pytest
import xarray as xr

from lcmchain.errors import InputError
from lcmchain.study.results import RESULTS
from lcmchain.study.runs import LONGEST_NAME, Study, file_name
from lcmchain.study.sources import Variant
from lcmchain.study.sweep import SweptRun, in_si, number_and_unit, read_entry, samples, write_sweep


def test_a_value_that_is_added_leaves_the_names_of_the_others(dent, tmp_path):
    few = samples([read_entry("contact.friction=0.1|0.2")], None)
    more = samples([read_entry("contact.friction=0.05|0.1|0.2")], None)
    assert [v.name for v in few] == [v.name for v in more[1:]]
    study = Study(dent, tmp_path)
    assert study._file(few[0].name) == study._file(more[1].name)


def test_long_names_become_files_that_any_file_system_takes():
    long = ", ".join(f"material.membrane.entry_{i}={i}" for i in range(30))
    name = file_name(long)
    assert len(name) <= LONGEST_NAME + len(".nc")
    assert name.startswith("material.membrane.entry_0_0_material")
    assert name != file_name(long + "0")
    assert name == file_name(long)
    assert file_name("10 mm, 8 ms") == "10_mm_8_ms.nc"


@pytest.mark.parametrize(
    ("entry", "count", "told"),
    [
        ("contact.friction=0.1|0.2", 7, "--samples"),
        ("contact.friction=0.1|0.1", None, "given twice"),
        ("contact.friction=0.1..0.2", None, "--samples"),
    ],
)
def test_samples_that_make_no_sense_are_told(entry, count, told):
    with pytest.raises(InputError, match=told):
        samples([read_entry(entry)], count)


def test_rows_are_no_numbers_and_units_may_begin_with_one():
    assert number_and_unit("200 1/s") == (200.0, "1/s")
    assert number_and_unit("2.5mm") == (2.5, "mm")
    for text in ("100 60 mm", "MD600", "[1, 2]", '["1 mm", "2 mm"]'):
        with pytest.raises(InputError, match="no number"):
            number_and_unit(text)
    with pytest.raises(InputError, match="no range"):
        read_entry("blank.size=100 60 mm..120 60 mm")


def test_quantities_of_any_unit_are_in_si():
    assert in_si(["10 mm", "2 cm"]) == ([0.01, 0.02], "m")
    assert in_si(["100 1/s", "0.2 1/ms"]) == ([100.0, pytest.approx(200.0)], "1/s")
    assert in_si(["90 deg"]) == ([pytest.approx(0.5 * math.pi)], "rad")
    assert in_si(["0.1", "2e-1"]) == ([0.1, 0.2], "")
    assert in_si(["10 mm", "2 s"]) is None
    assert in_si(["10 mm", "2"]) is None
    assert in_si(["100 60 mm"]) is None


def test_entries_stand_in_the_file_in_si_with_their_unit(tmp_path):
    results = {r.name: math.nan for r in RESULTS}
    entries = (
        {"blank.edge_length": "10 mm", "blank.size": "100 60 mm", "contact.friction": "0.1"},
        {"blank.edge_length": "2 cm", "blank.size": "100 80 mm", "contact.friction": "0.2"},
    )
    runs = [
        SweptRun(Variant(str(i), "sweep"), e, results, 1.0, f)
        for i, (e, f) in enumerate(zip(entries, ("", "no contact"), strict=True))
    ]
    write_sweep(tmp_path, "a sweep", runs)
    with xr.open_dataset(tmp_path / "sweep.nc") as data:
        edge = data["entry_blank_edge_length"]
        np.testing.assert_allclose(edge.values, [0.01, 0.02])
        assert edge.attrs["units"] == "m"
        assert [str(text) for text in data["entry_blank_size"].values] == ["100 60 mm", "100 80 mm"]
        assert "units" not in data["entry_contact_friction"].attrs
        assert data["forming_work"].attrs == {"units": "J", "long_name": "forming work"}
        assert {data[r.name].attrs["units"] for r in RESULTS} == {"m", "rad", "1", "N", "J"}
        assert [str(text) for text in data["failure"].values] == ["", "no contact"]


@pytest.mark.parametrize(
    "key",
    ["process.frames=5", "output.pictures=true", "mapping=[]", "infiltration=none"],
)
def test_what_a_study_sets_itself_cannot_be_varied(dent, key):
    with pytest.raises(InputError, match="the study sets it"):
        dent.job(Variant("odd", "sweep", (key,)))
