"""The page of the published fabrics, from their data."""

from __future__ import annotations

from lcmchain.manual.tables import code, markdown_table
from lcmchain.scene.presets import PUBLISHED, PublishedFabric

HEAD = """# Published fabrics

The fabrics that `material.preset` knows, with every value and what it rests on: *measured* by a
test that the source describes, *stated* by a paper or a data sheet, or *assumed*. `check --full`
prints the same for the values that a scene takes from its preset; keys given beside `preset`
replace its values. The law is that of [Materials](materials.md#fabric).

Only MD600 is published completely. Of the woven fabrics no source at hand gives shear, compaction
and bending together: those values are **carried over** from MD600. `check`, runs, reports and
coupons name the laws that a fabric does not have of its own, and what of the result is no
prediction for it, until tests of your own replace them
([Identification](identification.md); `lcmchain new coupon` writes a scene with all values spelled
out). They differ from MD600 in mass, fibre density and thickness, and serve to try a scene with a
sheet of about that weight.

`glass-plain-600` has **no shear law of its own**. The measured curves of a plain weave that are at
hand ([two sizes](identification.md#one-fabric-two-sizes)) are of another fabric, 743 g/m² and
1.2 mm of commingled glass and polypropylene: they are not passed off as its law.
`python examples/identification/two_sizes.py` identifies that one.
"""


def preset_page() -> str:
    """Return the page as Markdown."""
    return "\n".join([HEAD, *(_section(fabric) for fabric in PUBLISHED.values())])


def _section(fabric: PublishedFabric) -> str:
    rows = [
        (
            code(key),
            code(value if isinstance(value, str) else f"{value:g}"),
            f"**carried over**: {basis.note}" if basis.carried_over else str(basis),
        )
        for key, (value, basis) in fabric.values.items()
    ]
    table = markdown_table(("key", "value", "rests on"), rows)
    return (
        f"## {fabric.name}\n\n{fabric.description[0].upper()}{fabric.description[1:]}.\n\n{table}"
    )
