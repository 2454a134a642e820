"""``lcmchain docs``: builds once into the cache, opens the right page, and says what is wrong."""

from __future__ import annotations

import os
import time
import webbrowser
from pathlib import Path

import pytest

from lcmchain.cli import main
from lcmchain.errors import InputError
from lcmchain.manual import site
from lcmchain.manual.contents import TOPICS


@pytest.fixture
def cache(tmp_path, monkeypatch):
    folder = tmp_path / "cache"
    monkeypatch.setattr(site.platformdirs, "user_cache_path", lambda *args, **kwargs: folder)
    return folder


@pytest.fixture
def opened(monkeypatch):
    """Addresses handed to the browser, on a machine with a display."""
    addresses = []
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr(webbrowser, "open", lambda address: addresses.append(address) or True)
    return addresses


def docs(*arguments) -> int:
    with pytest.raises(SystemExit) as stop:
        main(["docs", *map(str, arguments)])
    return stop.value.code or 0


def test_a_topic_opens_in_the_browser(cache, opened, capsys):
    assert docs("limits") == 0
    file = Path(capsys.readouterr().out.strip())
    assert file.name == "limits.html" and cache in file.parents
    assert "<h1" in file.read_text("utf-8")
    assert opened == [file.as_uri()]


def test_without_a_topic_the_first_page_opens(cache, opened):
    assert docs() == 0
    assert opened[0].endswith("/index.html")


def test_no_browser_and_no_display_only_print(cache, opened, monkeypatch, capsys):
    assert docs("--no-browser") == 0
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.delenv("DISPLAY")
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    assert docs() == 0
    assert opened == []
    first, second = capsys.readouterr().out.split()
    assert first == second and Path(first).is_file()


def test_a_browser_that_does_not_start_is_told(cache, opened, monkeypatch, capsys):
    monkeypatch.setattr(webbrowser, "open", lambda address: False)
    assert docs() == 2
    assert "index.html: no browser can be started" in capsys.readouterr().err


def test_the_list_names_every_topic(capsys):
    assert docs("--list") == 0
    words = capsys.readouterr().out.split()
    assert all(topic in words for topic in TOPICS)


@pytest.mark.parametrize(
    "topic, nearest", [("limit", "limits"), ("tutoral", "tutorial"), ("shell", "membrane-shell")]
)
def test_an_unknown_topic_names_the_nearest(cache, capsys, topic, nearest):
    assert docs(topic) == 2
    assert f'did you mean "{nearest}"?' in capsys.readouterr().err
    assert not cache.exists()


def test_the_manual_is_built_once_per_version_and_content(cache, monkeypatch):
    first = site.cached_site()
    mark = first / "mark"
    mark.touch()
    assert site.cached_site() == first and mark.exists()
    monkeypatch.setattr(site, "version", lambda name: "9.9")
    other = site.cached_site()
    assert other.name.startswith("9.9-") and not (other / "mark").exists()
    monkeypatch.setattr(site, "_content_key", lambda: "changed")
    assert site.cached_site() != other


def test_the_content_key_follows_the_pages(tmp_path, monkeypatch):
    before = site._content_key()
    folder = tmp_path / "manual"
    site.shutil.copytree(site.FOLDER, folder)
    monkeypatch.setattr(site, "FOLDER", folder)
    assert site._content_key() == before
    with (folder / "limits.md").open("a", encoding="utf-8") as page:
        page.write("more\n")
    assert site._content_key() != before


def test_a_failed_build_leaves_nothing(cache, monkeypatch):
    def fail(folder):
        (folder / "index.html").write_text("half")
        raise RuntimeError("stopped")

    monkeypatch.setattr(site, "_write_site", fail)
    with pytest.raises(RuntimeError):
        site.cached_site()
    assert list((cache / "manual").iterdir()) == []


def test_two_builds_at_once_leave_one(cache, monkeypatch):
    write = site._write_site

    def write_second(folder):
        write(folder)
        monkeypatch.setattr(site, "_write_site", write)
        site.build_site(target)

    target = cache / "manual" / "site"
    monkeypatch.setattr(site, "_write_site", write_second)
    site.build_site(target)
    assert [path.name for path in target.parent.iterdir()] == ["site"]
    assert (target / "index.html").is_file()


def test_stale_manuals_are_removed_after_a_month(cache):
    kept, stale = cache / "manual" / "young", cache / "manual" / "old"
    month_ago = time.time() - 31 * 86400
    for folder in (kept, stale):
        folder.mkdir(parents=True)
    os.utime(stale, (month_ago, month_ago))
    folder = site.cached_site()
    assert kept.exists() and not stale.exists()
    os.utime(folder, (month_ago, month_ago))
    assert site.cached_site().stat().st_mtime > month_ago + 86400  # in use, hence not stale


def test_out_names_a_new_folder(tmp_path, opened, capsys):
    assert docs("fields", "--out", tmp_path / "pages") == 0
    assert (tmp_path / "pages" / "fields.html").is_file()
    assert docs("--out", tmp_path / "pages") == 2
    assert "exists already" in capsys.readouterr().err


def test_a_cache_that_cannot_be_written_is_told(tmp_path, monkeypatch):
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="--out"):
        site.build_site(tmp_path / "file" / "manual" / "site")


def test_regenerate_writes_the_reference_pages(tmp_path, monkeypatch, capsys):
    from lcmchain.manual import generated

    monkeypatch.setattr(generated, "FOLDER", tmp_path)
    assert docs("--regenerate") == 0
    written = {file.name for file in tmp_path.iterdir()}
    topics = ("scene-reference", "effects", "presets", "fields", "commands")
    assert written == {f"{topic}.md" for topic in topics}
    assert (tmp_path / "commands.md").read_text("utf-8") == (site.FOLDER / "commands.md").read_text(
        "utf-8"
    )
