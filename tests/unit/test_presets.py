"""Published fabrics: complete, with a basis for every value, and told to the user."""

from __future__ import annotations

import io
from collections.abc import Iterator
from typing import get_args

import numpy as np
import pytest
from pydantic import BaseModel
from rich.console import Console

from lcmchain.check import check_scene, scene_warnings
from lcmchain.coupons.bias_extension import bias_extension
from lcmchain.manual.generated import preset_page
from lcmchain.materials.fabric import FabricMaterial, PresetName
from lcmchain.scene import scene_from_text
from lcmchain.scene.presets import PRESETS, PUBLISHED

SCENE = """
process = { time = "1 s", gravity = true }
blank = { size = ["20 mm", "20 mm"], edge_length = "5 mm" }
"""
WOVEN = [name for name in PUBLISHED if name != "MD600"]


def required_keys(model: type[BaseModel], path: str = "") -> Iterator[str]:
    for key, field in model.model_fields.items():
        inner = field.annotation
        if isinstance(inner, type) and issubclass(inner, BaseModel):
            yield from required_keys(inner, f"{path}{key}.")
        elif field.is_required():
            yield path + key


def scene_of(preset: str, more: str = ""):
    return scene_from_text(f'{SCENE}[material]\npreset = "{preset}"\n{more}')


def test_a_scene_can_name_exactly_the_published_fabrics() -> None:
    assert get_args(PresetName) == tuple(PUBLISHED) == tuple(PRESETS)


@pytest.mark.parametrize("name", PUBLISHED)
def test_every_value_has_a_basis_with_a_reason(name) -> None:
    values = PUBLISHED[name].values
    assert set(required_keys(FabricMaterial)) <= set(values)
    for key, (_, basis) in values.items():
        assert basis.kind in ("measured", "stated", "assumed") and basis.note, key
        assert not basis.carried_over or basis.kind == "assumed", key


@pytest.mark.parametrize("name", WOVEN)
def test_what_a_woven_fabric_lacks_is_that_of_md600_and_nothing_of_it_counts_as_measured(name):
    fabric, md600 = PUBLISHED[name], PUBLISHED["MD600"]
    for key, (value, basis) in fabric.values.items():
        assert basis.kind != "measured", key
        if basis.carried_over:
            assert value == md600.values[key][0], key
    assert {key for key, (_, basis) in fabric.values.items() if basis.carried_over} == {
        "membrane.shear_polynomial", "membrane.shear_range",
        "compaction.c0", "compaction.c1", "compaction.c2",
        *(f"bending.C{index}" for index in (11, 22, 12)),
    }  # fmt: skip
    # the compaction law is carried over at the same fibre volume fraction
    packing = fabric.material.fibre_volume_fraction
    assert packing == pytest.approx(md600.material.fibre_volume_fraction, rel=1e-3)


@pytest.mark.parametrize("name", PUBLISHED)
def test_check_shows_what_each_value_of_the_preset_rests_on(name, tmp_path) -> None:
    terminal = Console(width=250, file=io.StringIO())
    for table in check_scene(scene_of(name)).tables():
        terminal.print(table)
    shown = terminal.file.getvalue()
    for key, (_, basis) in PUBLISHED[name].values.items():
        line = next(row for row in shown.splitlines() if str(basis) in row and f".{key}" in row)
        assert line.strip().startswith(f"material.{key}")


def test_a_value_of_the_scene_is_no_longer_the_presets() -> None:
    fabric = PUBLISHED["MD600"]
    material = scene_of("MD600", 'thickness = "0.9 mm"\ncompaction = { c1 = 50.0 }').material
    kept = {key for key, _, _ in fabric.kept(material)}
    assert {f"material.{key}" for key in fabric.values} - kept == {
        "material.thickness",
        "material.compaction.c1",
    }


@pytest.mark.parametrize("name", WOVEN)
def test_a_warning_says_what_is_carried_over_until_all_of_it_is_replaced(name) -> None:
    (warning,) = [text for text in scene_warnings(scene_of(name)) if "preset" in text]
    assert "bending, compaction, membrane" in warning and "identify" in warning
    assert "has no shear law, compaction law or bending stiffness of its own" in warning
    assert "outline, forces, thickness, pressures and wrinkles are no prediction" in warning
    bent = 'bending = { C11 = "30 MPa", C22 = "30 MPa", C12 = "3 MPa" }'
    (warning,) = [text for text in scene_warnings(scene_of(name, bent)) if "preset" in text]
    assert "bending" not in warning and "wrinkles" not in warning
    own = """
compaction = { c0 = "0.1 MPa", c1 = 50.0, c2 = 2.0 }
bending = { C11 = "30 MPa", C22 = "30 MPa", C12 = "3 MPa" }
[material.membrane]
shear_polynomial = "0.2 0 0 0 0 MPa"
shear_range = "45 deg"
"""
    assert not [text for text in scene_warnings(scene_of(name, own)) if "preset" in text]
    assert not [text for text in scene_warnings(scene_of("MD600")) if "preset" in text]


def test_the_manual_lists_every_value_of_every_preset() -> None:
    page = preset_page()
    for name, fabric in PUBLISHED.items():
        section = page.partition(f"## {name}\n")[2].partition("\n## ")[0]
        for key, (value, basis) in fabric.values.items():
            (row,) = [line for line in section.splitlines() if line.startswith(f"| `{key}` |")]
            assert str(value) in row and basis.note in row


@pytest.mark.parametrize("name", WOVEN)
def test_a_small_strip_of_every_woven_fabric_follows_the_pin_jointed_net(name) -> None:
    result = bias_extension(
        PUBLISHED[name].material, length=0.16, width=0.08, displacement=0.012, edge_length=1e-2
    )
    angle, net = (result.curves[f"{kind}shear angle [deg]"][-1] for kind in ("", "pin-joint "))
    assert net > 15.0
    assert angle == pytest.approx(net, rel=0.1)
    assert np.isfinite(result.curves["force [N]"]).all()
