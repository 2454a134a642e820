"""Exports of testing machines: layouts after the descriptions of four makers, against a clean CSV.

Every layout is written from the same numbers, so that the fit must be the same.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from lcmchain.cli import app
from lcmchain.errors import InputError
from lcmchain.identification.data import find_specimens, grid_of
from lcmchain.identification.from_file import identify_shear_file

CLEAN = Path(__file__).parents[2] / "examples" / "identification" / "shear.csv"
ROWS = [line.split(",") for line in CLEAN.read_text(encoding="utf-8").splitlines()[2:]]
SPEED = 2.0  # of the crosshead [mm/s]
TIME = [f"{float(way) / SPEED:.6f}" for way, _ in ROWS]


def comma(text):
    return text.replace(".", ",")


def bluehill_us():
    """Quoted cells, units in a row of their own, numbers in groups of three."""
    head = '"Specimen label","biax-1"\n"Test rate","120 mm/min"\n\n'
    head += '"Time","Extension","Load"\n"(s)","(mm)","(N)"\n'
    lines = [f'"{t}","{float(w):,.4f}","{f}"' for t, (w, f) in zip(TIME, ROWS)]
    return head + "\n".join(lines), "displacement=Extension,force=Load,time=Time"


def bluehill_german():
    """Windows-1252, semicolons, decimal commas, kilonewtons."""
    head = "Prüfbericht;;\nProbe;1;\n\nZeit;Verlängerung;Last\n(s);(mm);(kN)\n"
    lines = [
        f"{comma(t)};{comma(w)};{comma(repr(float(f) / 1e3))}" for t, (w, f) in zip(TIME, ROWS)
    ]
    text = (head + "\n".join(lines)).encode("cp1252")
    return text, "displacement=Verlängerung,force=Last,time=Zeit"


def bluehill_french():
    """Names with their units in brackets; a column that is not wanted."""
    head = "Essai : traction biais\n\nTemps (s)\tDéplacement (mm)\tCharge (N)\tDéformation (%)\n"
    lines = [
        f"{comma(t)}\t{comma(w)}\t{comma(f)}\t{comma(repr(float(w) / 3.2))}"
        for t, (w, f) in zip(TIME, ROWS)
    ]
    return head + "\n".join(lines), "displacement=Déplacement,force=Charge,time=Temps"


def zwick():
    """Tabs, units in square brackets, a preload in a line above."""
    head = "Vorkraft\t0,5\tN\nPrüfgeschwindigkeit\t120\tmm/min\n\n"
    head += "Prüfzeit [s]\tStandardweg [mm]\tStandardkraft [N]\n"
    lines = [f"{comma(t)}\t{comma(w)}\t{comma(f)}" for t, (w, f) in zip(TIME, ROWS)]
    return head + "\n".join(lines), "displacement=Standardweg,force=Standardkraft,time=Prüfzeit"


def zwick_side_by_side():
    """Two specimens beside each other, the second one shorter."""
    head = "biax 1;;biax 2;\nStandardweg;Standardkraft;Standardweg;Standardkraft\nmm;N;mm;N\n"
    first, second = ROWS[::2], ROWS[1::2]
    lines = []
    for k in range(len(first)):
        own = second[k] if k < len(second) else ("", "")
        lines.append(";".join(comma(cell) for cell in (*first[k], *own)))
    return head + "\n".join(lines), "displacement=Standardweg,force=Standardkraft"


def mts_dat():
    """Tabs, blank line, UTF-16 as a Windows program writes it."""
    head = "MTS793|MPT|ENU|1|2\nStation name: biax\n\nTime\tAxial Displacement\tAxial Force\n"
    head += "s\tmm\tkN\n"
    lines = [f"{t}\t{w}\t{float(f) / 1e3!r}" for t, (w, f) in zip(TIME, ROWS)]
    text = (head + "\n".join(lines)).encode("utf-16")
    return text, "displacement=Axial Displacement,force=Axial Force,time=Time"


def mts_below_each_other():
    """A block for each specimen, with its header again; units behind a comma."""
    blocks = []
    for number, rows in enumerate((ROWS[::2], ROWS[1::2])):
        head = f"Specimen {number + 1}\nCrosshead, mm\tLoad, N\n"
        blocks.append(head + "\n".join("\t".join(row) for row in rows))
    return "\n\n".join(blocks), "displacement=Crosshead,force=Load"


def inches_and_pounds():
    """US units; names with them in round brackets."""
    head = "Position (in),Load (lbf)\n"
    inch, pound = 25.4, 4.4482216152605
    lines = [f"{float(w) / inch!r},{float(f) / pound!r}" for w, f in ROWS]
    return head + "\n".join(lines), "displacement=Position,force=Load"


def spaces():
    """Columns that stand below each other."""
    head = "Carrera (mm)    Fuerza (N)\n"
    lines = [f"{w:>12}    {f:>12}" for w, f in ROWS]
    return head + "\n".join(lines), "displacement=Carrera,force=Fuerza"


def workbook(path):
    """A workbook whose first sheet tells about the test."""
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    book.active.append(["Report of a test", None])
    sheet = book.create_sheet("Specimen 1")
    sheet.append(["Verplaatsing", "Kracht"])
    sheet.append(["mm", "N"])
    for way, force in ROWS:
        sheet.append([float(way), float(force)])
    book.save(path)
    return "displacement=Verplaatsing,force=Kracht"


LAYOUTS = [
    bluehill_us, bluehill_german, bluehill_french, zwick, zwick_side_by_side, mts_dat,
    mts_below_each_other, inches_and_pounds, spaces,
]  # fmt: skip


def written(folder, layout):
    """Write an export; return its path and what confirms it."""
    path = folder / "export.txt"
    if layout is workbook:
        return (path := folder / "export.xlsx"), workbook(path)
    content, option = layout()
    path.write_bytes(content if isinstance(content, bytes) else content.encode("utf-8"))
    return path, option


@pytest.fixture(scope="module")
def clean():
    return identify_shear_file(CLEAN, {})


@pytest.mark.parametrize("layout", [*LAYOUTS, workbook])
def test_an_export_gives_the_parameters_of_the_clean_file(layout, tmp_path, clean):
    path, option = written(tmp_path, layout)
    found = identify_shear_file(path, {}, columns=option)
    for one, other in zip(found.parameters, clean.parameters, strict=True):
        assert one.value == pytest.approx(other.value, rel=1e-9)


@pytest.mark.parametrize("layout", [*LAYOUTS, workbook])
def test_what_columns_seem_to_be_must_be_confirmed(layout, tmp_path):
    """The message has the option that confirms them, as it is to be typed."""
    path, option = written(tmp_path, layout)
    with pytest.raises(InputError) as error:
        identify_shear_file(path, {})
    assert f'--columns "{option}"' in str(error.value)
    assert str(path) in str(error.value)


def test_the_command_reads_an_export(tmp_path):
    path, option = written(tmp_path, zwick)
    done = CliRunner().invoke(
        app, ["identify", "shear", str(path), "--columns", option, "--out", str(tmp_path / "out")]
    )
    assert done.exit_code == 0, done.output
    assert (tmp_path / "out" / "parameters.toml").is_file()


def test_rows_keep_the_lines_of_their_file(tmp_path):
    path, _ = written(tmp_path, mts_below_each_other)
    found = find_specimens(grid_of(path), path)
    first = len(ROWS[::2])
    assert found[0].lines == tuple(range(3, 3 + first))
    assert found[1].lines[0] == 3 + first + 3
    text = path.read_text(encoding="utf-8").splitlines()
    assert text[found[1].lines[0] - 1] == "\t".join(ROWS[1])


BOTH = "displacement=Weg,force=Kraft"
WRONG = {
    "two forces": ("Weg [mm];Kraft [N];Last [N]", "1,0;2,0;3,0", None, "may be Kraft or Last"),
    "no force": ("Weg [mm];Strom [A]", "1,0;2,0", None, "force [N] is not recognised"),
    "a time is no force": ("Weg [mm];Kraft [s]", "1,0;2,0", None, "force [N] is not recognised"),
    "another name": ("Weg [mm];Kraft [N]", "1,0;2,0", "force=Last", "the names Weg, Kraft"),
    "no pair": ("Weg [mm];Kraft [N]", "1,0;2,0", "Kraft", "COLUMN=NAME"),
    "thousands": ("Weg [mm];Kraft [N]", "1,000;2,000", BOTH, "a thousand"),
    "both signs": ("Weg [mm];Kraft [N]", "1,05;2.0\n1.05;2.0", BOTH, "others with points"),
    "no unit": ("Weg [mm];Kraft", "1,0;2,0", BOTH, "has no unit"),
}


@pytest.mark.parametrize(("header", "row", "option", "said"), WRONG.values(), ids=WRONG)
def test_a_wrong_export_is_refused_by_name(header, row, option, said, tmp_path):
    path = tmp_path / "export.txt"
    path.write_bytes("\n".join([header, *[row] * 9]).encode("cp1252"))
    with pytest.raises(InputError) as error:
        identify_shear_file(path, {}, columns=option)
    assert said in str(error.value)


def test_tables_of_unlike_columns_are_refused(tmp_path):
    path = tmp_path / "export.txt"
    path.write_text(
        "Weg [mm];Kraft [N]\n" + "1,0;2,0\n" * 5 + "\nZeit [s];Weg [mm]\n" + "1,0;2,0\n" * 5
    )
    with pytest.raises(InputError, match="unlike columns"):
        identify_shear_file(path, {})


def test_an_old_workbook_is_named(tmp_path):
    path = tmp_path / "export.xls"
    path.write_bytes(b"\xd0\xcf\x11\xe0" + bytes(100))
    with pytest.raises(InputError, match="xlsx"):
        identify_shear_file(path, {})


def test_the_option_is_refused_where_the_names_are_right_already():
    with pytest.raises(InputError, match="leave out --columns"):
        identify_shear_file(CLEAN, {}, columns="force=force")


def test_numbers_in_groups_are_read_as_what_they_are(tmp_path):
    path = tmp_path / "export.txt"
    path.write_text(
        "Extension (mm)\tLoad (N)\n" + "1.5\t1,234.5\n2.5\t12,345.0\n3.5\t1,234,567.0\n"
    )
    from lcmchain.identification.data import read_coupon
    from lcmchain.identification.shear import COLUMNS

    data = read_coupon(path, COLUMNS, columns="displacement=Extension,force=Load")
    np.testing.assert_allclose(data["force"], [1234.5, 12345.0, 1234567.0])
