"""The manual builds; every link, anchor, picture and formula in it resolves; nothing is stale."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from pathlib import Path

import pytest
import typer

import lcmchain.coupling.iteration.hard_cases  # noqa: F401  puts its cases on the list
from lcmchain.cli import app
from lcmchain.manual.contents import FOLDER, TOPICS, read_pages
from lcmchain.manual.generated import generated_pages
from lcmchain.manual.markdown import mathml, plain_text, render
from lcmchain.manual.scene_reference import _models_of, meaning_of
from lcmchain.manual.site import build_site
from lcmchain.quantities.fields import FIELDS
from lcmchain.scene import Scene
from lcmchain.verification.hard_cases import CASES
from lcmchain.verification.hard_cases.report import COLUMNS

PAGES = {page.topic: page for page in read_pages()}
LARGEST_PICTURE = 300_000


class Targets(HTMLParser):
    """Anchors, links and sources of a page."""

    def __init__(self, text: str):
        super().__init__()
        self.anchors: list[str] = []
        self.targets: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        values = dict(attrs)
        if "id" in values:
            self.anchors.append(values["id"])
        self.targets += [values[key] for key in ("href", "src") if key in values]


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    folder = tmp_path_factory.mktemp("manual") / "site"
    build_site(folder)
    return {file.name: Targets(file.read_text("utf-8")) for file in folder.glob("*.html")}, folder


# --- pages and links ------------------------------------------------------------------------------


def test_every_page_has_its_place_in_the_contents():
    assert sorted(file.stem for file in FOLDER.glob("*.md")) == sorted(TOPICS)


def test_every_link_picture_and_anchor_resolves_without_network(site):
    pages, folder = site
    assert sorted(pages) == sorted(f"{topic}.html" for topic in TOPICS)
    broken = []
    for name, page in pages.items():
        for target in page.targets:
            file, _, anchor = target.partition("#")
            exists = (folder / (file or name)).is_file()
            if not exists or (anchor and anchor not in pages[file or name].anchors):
                broken.append(f"{name}: {target}")
    assert broken == []


def test_anchors_of_a_page_are_unique(site):
    for name, page in site[0].items():
        assert len(set(page.anchors)) == len(page.anchors), name


def test_pictures_are_small_and_all_shown():
    shown = {picture for page in PAGES.values() for picture in render(page.text).pictures}
    kept = sorted(FOLDER.glob("pictures/*"))
    assert {f"pictures/{file.name}" for file in kept} == shown
    assert [file.name for file in kept if file.stat().st_size > LARGEST_PICTURE] == []


def test_the_search_knows_every_page(site):
    script = (site[1] / "search.js").read_text("utf-8")
    assert all(f'["{topic}", ' in script for topic in TOPICS)
    assert plain_text("# A *b*\n\nc `d` [e](f.md)") == "A b c d e"


# --- formulas -------------------------------------------------------------------------------------


def formulas():
    for topic, page in PAGES.items():
        text = re.sub(r"```.*?```|`[^`\n]*`", "", page.text, flags=re.DOTALL)
        for formula in re.findall(r"\$\$(.+?)\$\$|\$(.+?)\$", text, flags=re.DOTALL):
            yield topic, "".join(formula)


def test_formulas_become_mathml_without_an_unknown_command():
    found = list(formulas())
    assert len(found) > 60
    unknown = [(topic, f) for topic, f in found if "\\" in mathml(f, display=True)]
    assert unknown == []


def test_no_formula_is_left_as_text():
    for topic, page in PAGES.items():
        html = re.sub(r"<code[^>]*>.*?</code>", "", render(page.text).html, flags=re.DOTALL)
        assert "$" not in html, topic


def test_an_unknown_command_in_a_formula_shows():
    assert "\\" in mathml(r"\nonsense{x}", display=False)


# --- generated pages ------------------------------------------------------------------------------


@pytest.mark.parametrize("topic", ["scene-reference", "fields", "commands"])
def test_generated_pages_are_up_to_date(topic):
    fresh = generated_pages(typer.main.get_command(app))[topic]
    assert PAGES[topic].text == fresh, "run `lcmchain docs --regenerate`"


def scene_keys():
    """Yield every table of a scene and each of its entries once."""
    seen, waiting = set(), [Scene]
    while waiting:
        model = waiting.pop(0)
        if model in seen:
            continue
        seen.add(model)
        for key, field in model.model_fields.items():
            yield model, key, field
            waiting += _models_of(field.annotation)


def test_the_scene_reference_holds_every_key():
    text = PAGES["scene-reference"].text
    keys = list(scene_keys())
    assert len(keys) > 90 and {model for model, *_ in keys} > {Scene}
    forms = {"law", "type"}  # stand in the headings
    missing = [
        f"{model.__name__}.{key}"
        for model, key, _ in keys
        if key not in forms and not re.search(rf"^\| `{key}` \|", text, flags=re.MULTILINE)
    ]
    assert missing == []


def test_the_scene_reference_says_unit_range_default_and_meaning():
    text = PAGES["scene-reference"].text
    assert '| `edge_length` | length (m), as `"5 mm"`, positive | required | Edge length' in text
    assert "| `step_safety` | number, as `0.9`, above 0 and at most 1 | `0.9` |" in text
    assert '`"normal"` or `"director"` | `"normal"` |' in text
    assert '### [tools.shape] type = "plate_with_hole"' in text
    assert '### [permeability] law = "kozeny_carman"' in text


def test_a_table_that_forms_share_stands_once():
    headings = [line for line in PAGES["scene-reference"].text.splitlines() if line[0:1] == "#"]
    assert len(set(headings)) == len(headings)
    assert '#### [material.membrane] of law = "fabric"' in headings


def test_every_entry_says_what_it_means():
    silent = [
        f"{model.__name__}.{key}"
        for model, key, field in scene_keys()
        if key not in ("law", "type") and not meaning_of(field)
    ]
    assert silent == []


def test_the_field_page_holds_every_field():
    text = PAGES["fields"].text
    assert all(f"| `{name}`" in text for name in FIELDS)


def test_the_kept_table_of_hard_cases_is_of_these_cases(manual_table):
    """Criteria and limits are compared where the cases run, in tests/stability."""
    heading, *rows = manual_table("hard-case-table")
    assert tuple(heading) == COLUMNS
    names = {row[0].replace(" ", "_") for row in rows if row[0]}
    assert names == set(CASES), "run `lcmchain verify hard-cases --full --out FILE.md`"
    assert all(row[3].endswith("x") or row[3] == "holds" for row in rows), "a criterion failed"
    assert f"{len(rows)} of {len(rows)} criteria hold" in PAGES["hard-case-table"].text


def test_hard_cases_named_in_the_text_exist():
    named = {
        name
        for page in PAGES.values()
        for name in re.findall(r"hard case\s+`(\w+)`", page.text, flags=re.DOTALL)
    }
    assert len(named) > 5
    assert named - set(CASES) == set()


# --- paths ----------------------------------------------------------------------------------------

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.skipif(not (ROOT / "pyproject.toml").is_file(), reason="needs the checkout")
def test_files_named_in_the_text_exist():
    missing = []
    for topic, page in PAGES.items():
        for path in re.findall(r"\b(?:lcmchain|tests|examples)/[\w./-]*\w", page.text):
            if not (ROOT / path).exists():
                missing.append(f"{topic}: {path}")
    assert missing == []


def test_the_layout_names_every_room():
    rooms = {file.parent.name for file in FOLDER.parent.glob("*/__init__.py")}
    outer = {"mapping", "coupling", "fmu"}  # beside lcmchain in a checkout, inside an installed one
    text = PAGES["extending"].text
    assert [room for room in rooms - outer if f"`lcmchain/{room}`" not in text] == []
    assert [room for room in outer if f"`{room}`" not in text] == []
