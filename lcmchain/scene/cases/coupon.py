"""Case "coupon": a fabric with all its values spelled out, between two plates, for coupon tests."""

from __future__ import annotations

from typing import Any

from lcmchain.scene.cases.sheet import (
    Process,
    Sheet,
    filled,
    mm,
    round_edge_length,
    sheet_text,
    wrapped_comment,
)
from lcmchain.scene.presets import Basis, PublishedFabric

SPECIMEN = 0.02  # side of the piece between the plates [m]
#: Thickness at the end over that of the unloaded fabric.
COMPACTED = 0.7


def coupon_scene(sheet: Sheet, file: str) -> str:
    """Return the text of the scene."""
    size = sheet.size or (SPECIMEN, SPECIMEN)
    text = sheet_text(
        sheet,
        Process(
            damping="0 1/s",
            damping_reason="None is needed between plates.",
            gravity=False,
            gravity_reason="true adds 9.81 m/s2 along -z.",
        ),
        case="coupon",
        file=file,
        headline=f"Coupons of {sheet.preset}",
        remarks="The fabric under test with all its values, to be replaced by those that "
        "`lcmchain identify` finds. The clamps of coupon tests are no part of a scene: the "
        "command `lcmchain coupon` takes material and element from this file and sets up the "
        f"rest: lcmchain coupon bias-extension --scene {file} (or picture-frame, compaction, "
        f"cantilever). Run as it is, the scene presses a piece of the fabric between two plates.",
        size=size,
        edge_length=sheet.edge_length or round_edge_length(0.25 * min(size)),
        height=0.5 * sheet.thickness,
        height_reason="half the thickness: the lower face lies on the lower plate at z = 0.",
        material=material_text(sheet.fabric),
    )
    values = {
        "top": mm(sheet.thickness),
        "stroke": mm((1.0 - COMPACTED) * sheet.thickness),
        "end": mm(COMPACTED * sheet.thickness),
    }
    return text + filled("plates", values) + filled("more", {})


_TABLES = {
    "": "",
    "membrane": "Stiffness in the plane, and of shear over the thickness. Shear: S12 = C12(|E12|) "
    "2 E12 with C12 = s0 + s1 |E12| + ... + s4 |E12|^4 (lcmchain identify shear).",
    "compaction": "Pressure between plates: S33 = c0 exp(c1 |E33|^c2) E33 (lcmchain identify "
    "compaction).",
    "bending": "Bending, independent of the membrane: stiffness per width is C t^3 / 12 (lcmchain "
    "identify bending). More entries: in_plane.",
}


def material_text(fabric: PublishedFabric) -> str:
    """Return the material table of a fabric with all values, and what each rests on."""
    lines = [
        wrapped_comment(
            f'The values of {fabric.name}, {fabric.description}. Laws: "fabric", '
            '"fabric-with-set" (a set remains of compaction), "isotropic", "orthotropic", '
            '"stiffness".'
        ),
        "[material]",
        'law = "fabric"',
        "# Name in reports.",
        f'name = "{fabric.name}"',
    ]
    table = ""
    for key, (value, basis) in fabric.values.items():
        *path, entry = key.split(".")
        if path and path[0] != table:
            table = path[0]
            lines += ["", wrapped_comment(_TABLES[table]), f"[material.{table}]"]
        lines += [_reason(basis), f"{entry} = {_toml(value)}"]
    return "\n".join(lines) + "\n"


def _reason(basis: Basis) -> str:
    return wrapped_comment(f"{basis.kind.capitalize()}: {basis.note}.")


def _toml(value: Any) -> str:
    return f'"{value}"' if isinstance(value, str) else f"{value:g}"
