"""Archives and XML from elsewhere are unpacked safely or refused, with the reason."""

import os
import stat
import struct
import zipfile

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from lcmchain.coupling.cosimulation.archive import (
    Limits,
    read_member,
    read_xml,
    unpack,
)
from lcmchain.errors import InputError


def archive_of(path, *entries, compression=zipfile.ZIP_DEFLATED):
    with zipfile.ZipFile(path, "w", compression) as archive:
        for name, content in entries:
            archive.writestr(name, content)
    return path


def test_an_archive_is_unpacked_with_its_folders(tmp_path):
    path = archive_of(
        tmp_path / "a.fmu", ("modelDescription.xml", "<x/>"), ("resources/deep/a.txt", "text"),
        ("binaries/", ""),
    )  # fmt: skip
    folder = unpack(path, tmp_path / "out")
    assert (folder / "resources/deep/a.txt").read_text() == "text"
    assert (folder / "binaries").is_dir()
    assert read_member(path, "modelDescription.xml") == b"<x/>"


@pytest.mark.skipif(os.name != "posix", reason="limits of POSIX")
def test_a_folder_without_room_is_not_blamed_on_the_archive(tmp_path):
    import resource

    path = archive_of(tmp_path / "a.fmu", ("small", "1"), ("large", bytes(1 << 20)))
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1 << 16, before[1]))
    try:
        with pytest.raises(InputError, match="out.*free some space there.*TMPDIR") as caught:
            unpack(path, tmp_path / "out")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert "ask for a sound one" not in str(caught.value)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    "name", ["../evil", "/etc/evil", "a/../../evil", "C:/evil", "a\\..\\..\\evil", "resources/.."]
)
def test_nothing_leaves_the_folder(tmp_path, name):
    path = archive_of(tmp_path / "a.fmu", ("fine", "1"), (name, "evil"))
    with pytest.raises(InputError, match="not unpacked, because its entry") as caught:
        unpack(path, tmp_path / "in" / "out")
    assert str(path) in str(caught.value)
    assert sorted(tmp_path.rglob("*")) == [path]


@pytest.mark.parametrize("kind", [stat.S_IFLNK, stat.S_IFIFO, stat.S_IFCHR])
def test_links_and_devices_are_refused(tmp_path, kind):
    entry = zipfile.ZipInfo("link")
    entry.external_attr = (kind | 0o777) << 16
    path = archive_of(tmp_path / "a.fmu", (entry, "/etc/passwd"))
    with pytest.raises(InputError, match="is a link|is no file and no folder"):
        unpack(path, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_bomb_is_refused_by_its_size(tmp_path):
    path = archive_of(tmp_path / "a.fmu", ("big", bytes(1 << 20)))
    assert path.stat().st_size < 5000
    with pytest.raises(InputError, match=r"would unpack to 1,048,576 bytes"):
        unpack(path, tmp_path / "out", Limits(total=1 << 19))
    with pytest.raises(InputError, match="more than 2 are not unpacked"):
        unpack(archive_of(tmp_path / "b.fmu", *((str(i), "") for i in range(3))),
               tmp_path / "out", Limits(entries=2))  # fmt: skip
    assert not (tmp_path / "out").exists()


def test_a_wrong_size_in_the_directory_does_not_help_a_bomb(tmp_path):
    path = archive_of(tmp_path / "a.fmu", ("big", bytes(1 << 20)))
    content = bytearray(path.read_bytes())
    at = content.rindex(b"PK\x01\x02")
    struct.pack_into("<I", content, at + 24, 100)  # uncompressed size
    path.write_bytes(content)
    with pytest.raises(InputError):
        unpack(path, tmp_path / "out", Limits(total=1 << 19))
    assert not (tmp_path / "out").exists()


def test_names_that_collide_are_refused(tmp_path):
    with pytest.warns(UserWarning, match="Duplicate"):
        path = archive_of(tmp_path / "a.fmu", ("a", "1"), ("a", "2"))
    with pytest.raises(InputError, match="stands in it twice"):
        unpack(path, tmp_path / "out")
    path = archive_of(tmp_path / "b.fmu", ("a", "1"), ("a/b", "2"))
    with pytest.raises(InputError, match="a file of the archive too"):
        unpack(path, tmp_path / "out")


def test_what_is_no_archive_is_told(tmp_path):
    path = tmp_path / "a.fmu"
    with pytest.raises(InputError, match="no such file"):
        unpack(path, tmp_path / "out")
    path.write_bytes(b"no archive")
    with pytest.raises(InputError, match="no ZIP archive"):
        unpack(path, tmp_path / "out")
    with pytest.raises(InputError, match="is a folder"):
        unpack(tmp_path, tmp_path / "out")
    with pytest.raises(InputError, match='holds no file "b"'):
        read_member(archive_of(path, ("a", "1")), "b")


def test_only_an_empty_folder_is_filled(tmp_path):
    path = archive_of(tmp_path / "a.fmu", ("a", "1"))
    with pytest.raises(InputError, match="empty folder"):
        unpack(path, tmp_path)


@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture],
          derandomize=True, deadline=None)  # fmt: skip
@given(data=st.data())
def test_damaged_archives_are_refused_or_unpacked_whole(tmp_path, data):
    path = archive_of(tmp_path / "a.fmu", ("a.txt", "text " * 50), ("b/c.txt", "more " * 50))
    content = bytearray(path.read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    damaged = tmp_path / "damaged.fmu"
    damaged.write_bytes(content[: data.draw(st.integers(1, len(content)))])
    out = tmp_path / "out"
    try:
        unpack(damaged, out)
    except InputError:
        assert not out.exists()
    else:
        import shutil

        assert all(p.resolve().is_relative_to(out.resolve()) for p in out.rglob("*"))
        shutil.rmtree(out)


LAUGHS = b"""<?xml version="1.0"?><!DOCTYPE x [<!ENTITY a "ha"><!ENTITY b "&a;&a;">]><x>&b;</x>"""
OUTSIDE = b"""<!DOCTYPE x [<!ENTITY a SYSTEM "file:///etc/passwd">]><x>&a;</x>"""
FETCHED = b"""<!DOCTYPE x SYSTEM "http://localhost/evil.dtd"><x/>"""


@pytest.mark.parametrize("content", [LAUGHS, OUTSIDE, FETCHED])
def test_xml_with_a_document_type_is_not_parsed(content):
    with pytest.raises(InputError, match=r"m\.xml: has a document type declaration"):
        read_xml(content, "m.xml")


def test_xml_is_parsed_within_limits():
    assert read_xml(b'<x a="1"><y/></x>', "m.xml").get("a") == "1"
    with pytest.raises(InputError, match="not well-formed"):
        read_xml(b"<x>", "m.xml")
    with pytest.raises(InputError, match="deep"):
        read_xml(b"<x>" * 200 + b"</x>" * 200, "m.xml")
    with pytest.raises(InputError, match="bytes"):
        read_xml(b"<x/>", "m.xml", Limits(xml=3))
    with pytest.raises(InputError, match="not well-formed"):
        read_xml(b'<?xml version="1.0" encoding="nonsense"?><x/>', "m.xml")
