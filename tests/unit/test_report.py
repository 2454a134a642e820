"""``report.html``: what it holds, that it is one file, and that it works in a real browser."""

import base64
import hashlib
import io
import json
import re
import shutil
import time
import tomllib
from html.parser import HTMLParser
from pathlib import Path

import meshio
import numpy as np
import pytest
from PIL import Image

from lcmchain.errors import InputError, OutputError, SimulationError
from lcmchain.fields import sheet_positions
from lcmchain.pipeline import run
from lcmchain.provenance import LIBRARIES, provenance
from lcmchain.quantities.fields import FIELDS
from lcmchain.report import write_report
from lcmchain.report.html import _SHOWN, BUDGET, MOST_FRAMES, chosen_frames, view_data
from lcmchain.report.numbers import grouped_warnings
from lcmchain.scene import read_scene
from lcmchain.solver.simulation import Simulation

TITLE = "<script>alert(1)</script> & dome"
SCENE = f"""
title = "{TITLE}"
process = {{ time = "5 ms", frames = 3 }}
output = {{ vtu = false }}
blank = {{ size = ["60 mm", "60 mm"], edge_length = "10 mm", height = "0.502 mm" }}
material = {{ preset = "MD600" }}

[[tools]]
name = "punch"
shape = {{ type = "sphere_capped_punch", radius = "20 mm" }}
position = "0 0 1.004 mm"
motion = {{ type = "stroke", direction = [0, 0, -1], distance = "3 mm" }}

[[tools]]
name = "block"
shape = {{ type = "surface_mesh", file = "block.stl", length_unit = "m" }}
position = "0 0 -10 mm"

[[mapping]]
name = "part"
mesh = "part.vtu"
kind = "structure"
maximum_distance = "5 mm"
verify = true
all_frames = true
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("report")
    corners = 1e-3 * np.array([[-9, -9, 0], [9, -9, 0], [9, 9, 0], [-9, 9, 0.0]])
    lower = corners - [0, 0, 0.004]
    points = np.concatenate([lower, corners])
    quads = [[3, 2, 1, 0], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]
    triangles = [[q[i] for i in half] for q in quads for half in ((0, 1, 2), (0, 2, 3))]
    meshio.write(folder / "block.stl", meshio.Mesh(points, [("triangle", triangles)]))
    meshio.write(folder / "part.vtu", meshio.Mesh(corners, [("quad", [[0, 1, 2, 3]])]))
    (folder / "scene.toml").write_text(SCENE, encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def result(folder):
    return run(read_scene(folder / "scene.toml"), folder / "out")


@pytest.fixture(scope="module")
def page(result):
    return Page(result.folder / "report.html")


class Page(HTMLParser):
    """Text by the section that it stands in, sources, and the numbers for scripts."""

    def __init__(self, path):
        super().__init__()
        self.text, self.sources, self.scripts = {}, [], []
        self._section, self._script, self._data = "", False, False
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attrs):
        values = dict(attrs)
        self._script = tag in ("script", "style")
        self._data = values.get("id") == "data"
        if tag == "section":
            self._section = values["id"]
        self.sources += [values[key] for key in ("src", "href") if key in values]

    def handle_endtag(self, tag):
        self._script = False

    def handle_data(self, data):
        if self._data and self._script:
            self.data = json.loads(data)
        elif self._script:
            self.scripts.append(data)
        else:
            self.text[self._section] = self.text.get(self._section, "") + data


# --- content --------------------------------------------------------------------------------------


def test_sections_stand_in_their_order(page):
    sections = "verdicts numbers warnings pictures curves shape effects settings mapping provenance"
    assert list(page.text) == ["", *sections.split()]


def test_it_says_title_state_and_how_many_checks_are_good(page):
    assert TITLE in page.text[""]
    assert re.search(r"\d+ good\s+of \d+ checks", page.text[""])
    assert "complete" in page.text[""]


def test_nothing_of_a_scene_becomes_markup(result):
    text = (result.folder / "report.html").read_text(encoding="utf-8")
    assert TITLE not in text
    assert text.count("&lt;script&gt;alert(1)&lt;/script&gt;") >= 3  # title, headline, scene


def test_it_is_one_file_that_asks_for_nothing(page, result):
    outside = [s for s in page.sources if not s.startswith(("#", "data:"))]
    assert outside == []
    text = (result.folder / "report.html").read_text(encoding="utf-8")
    assert "default-src 'none'" in text and "form-action 'none'" in text


def test_every_picture_of_the_run_is_shown_with_a_caption(page, result):
    names = sorted(file.name for file in result.folder.glob("*.png"))
    assert len(names) >= 6
    assert all(f"({name})" in page.text["pictures"] for name in names)
    assert page.text["pictures"].index("shear_angle.png") < page.text["pictures"].index("part.png")
    addresses = [s for s in page.sources if s.startswith("data:image/webp;base64,")]
    assert len(addresses) == len(names)
    shown = Image.open(io.BytesIO(base64.b64decode(addresses[0].partition(",")[2])))
    assert shown.size == Image.open(result.folder / "shear_angle.png").size


def test_warnings_effects_settings_and_mapping_are_those_of_the_run(page, result):
    summary = result.summary
    assert summary["warnings"]
    for warning in summary["warnings"]:
        assert warning in page.text["warnings"]
    for effect in summary["effects"]:
        assert effect in page.text["effects"]
    scene = read_scene(result.folder.parent / "scene.toml")
    for key, value in [*scene.source.given, *scene.source.defaulted]:
        assert key in page.text["settings"] and value in page.text["settings"]
    assert f"{summary['mapping']['part']['cell_count']}: " in page.text["mapping"]
    assert "part.json" in page.text["mapping"] and "part.pvd" in page.text["mapping"]
    assert "error added to thickness" in page.text["mapping"]
    assert "distance from the sheet, mean and root mean square" in page.text["mapping"]


def test_equal_warnings_stand_once_with_their_number():
    summary = {"warnings": ["a", "b", "a"], "mapping": {"part": {"warnings": ["c"]}, "x": {}}}
    assert grouped_warnings(summary) == [
        ("Forming", [("a", 2), ("b", 1)]), ("Mapping to part", [("c", 1)])
    ]  # fmt: skip


def test_provenance_names_scene_files_versions_and_machine(page, result):
    origin = result.summary["provenance"]
    assert json.loads((result.folder / "summary.json").read_text())["provenance"] == origin
    for entry, name in zip(origin["files"], ("block.stl", "part.vtu"), strict=True):
        content = (result.folder.parent / name).read_bytes()
        assert entry["file"] == name
        assert entry["sha256"] == hashlib.sha256(content).hexdigest()
        assert entry["sha256"] in page.text["provenance"]
    assert origin["run_fingerprint"] == result.summary["run_fingerprint"]
    assert set(origin["libraries"]) == set(LIBRARIES)
    assert origin["libraries"]["numpy"] == np.__version__
    for name in ("python", "platform", "processor", "date", "scene_sha256", "threads"):
        assert str(origin[name]) in page.text["provenance"], name
    assert 'preset = "MD600"' in page.text["provenance"]


def test_a_file_that_vanished_is_named(folder, tmp_path):
    scene = read_scene(folder / "scene.toml")
    scene._source = scene.source.__class__(**{**vars(scene.source), "directory": tmp_path})
    with pytest.raises(InputError, match="block.stl"):
        provenance(scene, run_fingerprint="", threads=1)


def test_the_switch_leaves_it_out(folder, tmp_path):
    changes = ["output.report=false", "output.pictures=false", "mapping=[]"]
    run(read_scene(folder / "scene.toml", changes), tmp_path)
    assert not (tmp_path / "report.html").exists()


def test_a_run_that_a_guard_stopped_has_its_report(folder, tmp_path, monkeypatch):
    def require_resolved(simulation):
        if simulation.time > 0.003:
            raise SimulationError("the hourglass energy is 90% of the strain energy")

    monkeypatch.setattr(Simulation, "require_resolved", require_resolved)
    with pytest.raises(SimulationError):
        run(read_scene(folder / "scene.toml", ["output.pictures=false"]), tmp_path)
    stopped = Page(tmp_path / "report.html")
    for section in ("", "verdicts"):
        assert "stopped: the hourglass energy is 90%" in stopped.text[section]
    assert len(stopped.data["view"]["frames"]) == 2
    assert "bad" in stopped.text[""] and "mapping" not in stopped.text


def test_a_failed_mapping_leaves_the_report(folder, tmp_path):
    meshio.write(
        folder / "far.vtu",
        meshio.Mesh([[0, 0, 1.0], [1, 0, 1], [1, 1, 1]], [("triangle", [[0, 1, 2]])]),
    )
    changes = ["mapping.part.mesh=far.vtu", "output.pictures=false"]
    with pytest.raises(InputError, match="no sheet within"):
        run(read_scene(folder / "scene.toml", changes), tmp_path)
    failed = Page(tmp_path / "report.html")
    assert "its fields are whole" in failed.text["verdicts"]
    assert "failed: " in failed.text["verdicts"] and "no sheet within" in failed.text["mapping"]


def test_a_full_disk_leaves_no_half_report(result, tmp_path, monkeypatch):
    def write_text(path, *arguments, **options):
        path.touch()
        raise OSError(28, "No space left on device")

    scene = read_scene(result.folder.parent / "scene.toml")
    monkeypatch.setattr(Path, "write_text", write_text)
    with pytest.raises(OutputError, match="no space left"):
        write_report(tmp_path, scene, [], result.datasets, result.summary)
    assert list(tmp_path.iterdir()) == []


def test_pictures_of_others_are_not_shown(folder, tmp_path):
    (tmp_path / "mine.png").write_text("no picture")
    run(read_scene(folder / "scene.toml", ["mapping=[]", "output.pictures=false"]), tmp_path)
    assert "pictures" not in Page(tmp_path / "report.html").text


# --- numbers for curves and 3D view ---------------------------------------------------------------


def unpacked(text, kind="<f4"):
    return np.frombuffer(base64.b64decode(text), kind)


def test_the_view_holds_shape_and_fields_of_the_frames(page, result):
    sheet, view = result.datasets["/"], page.data["view"]
    assert [frame["number"] for frame in view["frames"]] == [0, 1, 2]
    assert view["frames"][2]["time"] == pytest.approx(5.0)
    for frame, entry in enumerate(view["frames"]):
        points = unpacked(entry["positions"]).reshape(-1, 3)
        assert points == pytest.approx(1e3 * sheet_positions(sheet, frame), abs=1e-4)
    assert (unpacked(view["faces"], "<i4") == sheet["sheet_face_nodes"].values.ravel()).all()
    fields = {field["name"]: field for field in view["fields"]}
    assert {"shear_angle", "thickness", "fibre_volume_fraction", "fibre_strain_1", "displacement",
            "compaction_pressure", "tool_pressure_top"} <= set(fields)  # fmt: skip
    for name, factor in (("thickness", 1e3), ("compaction_pressure", 1e-3)):
        values = unpacked(fields[name]["values"][1])
        assert values == pytest.approx(factor * sheet[name].values[1], rel=1e-6, abs=1e-9)
    strain = fields["fibre_strain_1"]
    assert -strain["low"] == strain["high"] < 1.0
    assert strain["colours"][0][0] == 0.0 and strain["colours"][-1][0] == 1.0


def test_the_view_holds_the_tools_where_they_stand(page):
    punch, block = page.data["view"]["tools"]
    assert (punch["name"], block["name"]) == ("punch", "block")
    assert punch["shift"][-1] == pytest.approx([0.0, 0.0, -3.0])
    assert block["shift"] == [[0.0, 0.0, 0.0]] * 3
    assert punch["works"] == block["works"] == [True] * 3
    points = unpacked(block["points"]).reshape(-1, 3)
    assert points.max(axis=0) == pytest.approx([9.0, 9.0, -10.0], abs=1e-4)
    assert unpacked(block["triangles"], "<i4").max() < len(points)


def test_curves_are_the_histories(page, result):
    history, curves = result.datasets["/history"], page.data["curves"]
    assert curves["time"] == pytest.approx(1e3 * history["history_time"].values, rel=1e-5)
    punch = curves["tools"][curves["punch"]]
    assert punch["name"] == "punch"
    assert punch["travel"][-1] == pytest.approx(3.0, rel=1e-3)
    assert max(punch["peak"]) == pytest.approx(result.summary["punch_force_peak_N"], rel=1e-5)
    energies = {entry["name"]: entry["values"] for entry in curves["energies"]}
    assert energies["internal"][-1] == pytest.approx(result.summary["energy"]["internal"], rel=1e-4)
    assert curves["energies"][0]["name"] == "external"


def test_frames_are_few_enough():
    assert chosen_frames(21, 1000) == [0, 2, 4, 5, 7, 9, 11, 13, 15, 16, 18, 20]
    assert len(chosen_frames(21, 1000)) == MOST_FRAMES
    assert chosen_frames(3, 1000) == [0, 1, 2]
    assert chosen_frames(21, BUDGET // 2) == [0, 20]
    assert chosen_frames(21, 2 * BUDGET) == [20]


def test_a_field_that_nobody_knows_is_shown_in_its_own_unit(result):
    sheet = result.datasets["/"].copy()
    sheet["wear"] = sheet["thickness"].assign_attrs(long_name="wear of the yarns", units="1")
    (wear,) = [field for field in view_data(sheet)["fields"] if field["name"] == "wear"]
    assert (wear["title"], wear["unit"], wear["place"]) == ("Wear of the yarns", "", "face")
    assert unpacked(wear["values"][0]) == pytest.approx(sheet["wear"].values[0], rel=1e-6)


def test_no_field_with_a_dimension_is_shown_in_its_si_unit():
    """Nobody reads the thickness of a stack in metres: each has an entry with its own unit."""
    with_unit = [f.name for f in FIELDS.values() if not f.is_vector and f.units != "1"]
    assert {"stack_thickness", "pore_pressure"} <= set(with_unit) <= set(_SHOWN)


def test_a_field_of_zeros_has_colours(result):
    sheet = result.datasets["/"].copy(deep=True)
    names = ("thickness", "fibre_strain_1", "compaction_pressure", "shear_angle")
    for name in names:
        sheet[name][...] = 0.0
    for field in view_data(sheet)["fields"]:
        assert field["low"] < field["high"], field["name"]


# --- in a browser ---------------------------------------------------------------------------------

CHROMIUM, DRIVER = shutil.which("chromium"), shutil.which("chromedriver")
PATIENCE = 120.0  # software rendering on a busy machine [s]
needs_browser = pytest.mark.skipif(
    CHROMIUM is None or DRIVER is None,
    reason="needs a browser: install the Debian packages chromium and chromium-driver",
)


@pytest.fixture(scope="module")
def browser(result):
    """Chromium with the report drawn, opened as a file."""
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service
    from selenium.webdriver.support.ui import WebDriverWait

    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM
    for option in (
        "--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--window-size=1250,1100",
        "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
    ):  # fmt: skip
        options.add_argument(option)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    driver = webdriver.Chrome(options=options, service=Service(DRIVER))
    try:
        driver.get((result.folder / "report.html").as_uri())
        drawn = "return document.documentElement.dataset.drawn"
        WebDriverWait(driver, PATIENCE).until(lambda d: d.execute_script(drawn))
        yield driver
    finally:
        driver.quit()


def picture_of_the_view(driver):
    """Pixels of the 3D view, once two pictures in a row are the same."""
    element = driver.find_element("id", "view")
    before, deadline = None, time.monotonic() + PATIENCE
    while time.monotonic() < deadline:
        now = np.asarray(Image.open(io.BytesIO(element.screenshot_as_png)).convert("RGB"), int)
        if before is not None and np.array_equal(now, before):
            return now
        before = now
        time.sleep(0.5)
    raise AssertionError("the view does not come to rest")


def coloured(pixels) -> float:
    return float((np.ptp(pixels, axis=-1) > 40).mean())


def choose(driver, field):
    select = driver.find_element("id", "field")
    option = next(o for o in select.find_elements("tag name", "option") if o.text == field)
    option.click()


@needs_browser
def test_the_3d_view_is_drawn_and_shows_the_field_that_is_chosen(browser):
    choose(browser, "Thickness")
    thickness = picture_of_the_view(browser)
    assert coloured(thickness) > 0.05
    assert browser.find_element("id", "extent").text.startswith("Thickness: ")
    choose(browser, "Displacement")
    other = picture_of_the_view(browser)
    assert np.mean(np.any(thickness != other, axis=-1)) > 0.05
    assert browser.find_element("id", "extent").text.startswith("Displacement: ")


@needs_browser
def test_frames_tools_and_views_can_be_chosen(browser):
    choose(browser, "Displacement")
    last = picture_of_the_view(browser)
    slider = browser.find_element("id", "frame")
    script = "arguments[0].value = 0; arguments[0].dispatchEvent(new Event('input'))"
    browser.execute_script(script, slider)
    first = picture_of_the_view(browser)
    assert browser.find_element("id", "extent").text.startswith("Displacement: 0.00 mm to 0.00 mm")
    browser.find_element("id", "tools").click()
    with_tools = picture_of_the_view(browser)
    browser.find_element("css selector", "[data-view=side]").click()
    side = picture_of_the_view(browser)
    pictures = [last, first, with_tools, side]
    for one, two in zip(pictures, pictures[1:]):
        assert not np.array_equal(one, two)


@needs_browser
def test_curves_are_drawn_and_titles_are_text(browser):
    for name in ("force-over-travel", "force-over-time", "energy-over-time"):
        lines = browser.find_elements("css selector", f"#{name} .scatterlayer .js-line")
        assert len(lines) >= 2, name
    assert browser.find_element("tag name", "h1").text == TITLE


@needs_browser
def test_the_page_asks_the_network_for_nothing_logs_no_error_and_leads_nowhere(browser, result):
    messages = [json.loads(entry["message"])["message"] for entry in browser.get_log("performance")]
    asked = [
        message["params"]["request"]["url"]
        for message in messages
        if message["method"] == "Network.requestWillBeSent"
    ]
    own = (result.folder / "report.html").as_uri()
    assert own in asked
    assert [url for url in asked if url != own and not url.startswith(("data:", "blob:"))] == []
    assert [e for e in browser.get_log("browser") if e["level"] == "SEVERE"] == []
    buttons = browser.find_elements("css selector", ".modebar-btn")
    titles = {button.get_attribute("data-title") for button in buttons}
    assert len(titles) > 5 and not any("hare" in title for title in titles)
    anchors = browser.find_elements("css selector", "a[href]")
    assert all(anchor.get_attribute("href").startswith(own + "#") for anchor in anchors)


# --- package --------------------------------------------------------------------------------------


def test_template_style_and_script_ship_with_the_package():
    root = Path(__file__).resolve().parents[2]
    if not (root / "pyproject.toml").is_file():
        pytest.skip("needs the checkout, not only the tests")
    settings = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))
    assert "assets/*" in settings["tool"]["setuptools"]["package-data"]["lcmchain.report"]
