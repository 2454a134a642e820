"""Scenes and test data as editors and spreadsheets save them: marks, line ends, encodings."""

from __future__ import annotations

from pathlib import Path

import pytest

from lcmchain.errors import InputError
from lcmchain.identification.data import Column, read_coupon
from lcmchain.quantities.units import FORCE, LENGTH
from lcmchain.scene import read_scene

SCENE = """# Größe in mm
process = { time = "1 s" }
blank = { size = ["20 mm", "20 mm"], edge_length = "5 mm" }
material = { preset = "MD600" }
"""
DATA = "displacement [mm],force [N]\n0.5,0.3\n1,0.6\n2,0.9\n"
LAYOUT = ((Column("displacement", LENGTH, 1), Column("force", FORCE, 1)),)


def written(folder: Path, content: bytes, name: str = "scene.toml") -> Path:
    path = folder / name
    path.write_bytes(content)
    return path


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig"])
@pytest.mark.parametrize("line_end", ["\n", "\r\n"])
def test_a_scene_reads_with_mark_and_with_either_line_end(tmp_path, encoding, line_end) -> None:
    content = SCENE.replace("\n", line_end).encode(encoding)
    scene = read_scene(written(tmp_path, content))
    assert scene.blank.edge_length == 0.005
    assert not scene.source.text.startswith("\ufeff")


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig"])
@pytest.mark.parametrize("line_end", ["\n", "\r\n"])
def test_test_data_read_with_mark_and_with_either_line_end(tmp_path, encoding, line_end) -> None:
    content = DATA.replace("\n", line_end).encode(encoding)
    data = read_coupon(written(tmp_path, content, "shear.csv"), LAYOUT)
    assert list(data["displacement"]) == [0.0005, 0.001, 0.002]
    assert list(data.lines) == [2, 3, 4]


@pytest.mark.parametrize(
    ("encoding", "name"),
    [("utf-16", "UTF-16"), ("utf-32", "UTF-32"), ("utf-16-be", "zero byte in line 1, as UTF-16")],
)
def test_other_encodings_are_named(tmp_path, encoding, name) -> None:
    for text, read in ((SCENE, read_scene), (DATA, lambda path: read_coupon(path, LAYOUT))):
        with pytest.raises(InputError, match=name) as error:
            read(written(tmp_path, text.encode(encoding), "file.csv"))
        assert "save the file as UTF-8" in str(error.value)


@pytest.mark.parametrize("mark", [b"", b"\xef\xbb\xbf"])
def test_a_byte_that_is_no_text_is_named_by_line_and_column(tmp_path, mark) -> None:
    content = mark + 'process = { time = "1 s" }\n# Ä, Gr'.encode() + b"\xf6\xdfe in mm\n"
    with pytest.raises(InputError) as error:
        read_scene(written(tmp_path, content))
    assert 'byte 0xF6 at line 2, column 8 (in Windows-1252 it is "ö")' in str(error.value)
