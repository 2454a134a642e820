"""Published resins: values of viscosity and cure, and what they rest on.

No resin was found whose viscosity, cure and gel point are all published in numbers that could be
traced. What is here is one complete viscosity law and three fits of one resin's cure; each was
taken from a public transcription and has been compared with others as its note says.
"""

from __future__ import annotations

from typing import Any

from lcmchain.scene.fabrics import Basis

_CHEN = Basis(
    "stated",
    "Chen, Macosko, Journal of Applied Polymer Science 62 (1996) 567; two public transcriptions "
    "agree",
)

#: Viscosity laws after Castro and Macosko by name.
VISCOSITIES: dict[str, dict[str, tuple[Any, Basis]]] = {
    # Cyanate ester AroCy L-10, a thin resin for transfer moulding.
    "AroCy-L10": {
        "reference_viscosity": ("3.32e-8 Pa*s", _CHEN),
        "activation_energy": ("42.9 kJ/mol", _CHEN),
        "gel_cure": (0.64, Basis("stated", f"{_CHEN.note.partition(';')[0]}; one transcription")),
        "exponent": (2.32, _CHEN),
        "exponent_slope": (1.4, _CHEN),
    },
}


def _epoxy(source: str, values: tuple[Any, ...]) -> dict[str, tuple[Any, Basis]]:
    keys = (
        "rate_1", "energy_1", "rate_2", "energy_2", "order_1", "autocatalytic_order", "order",
    )  # fmt: skip
    note = f"{source}; one public transcription, like the two other fits of this resin"
    return {key: (value, Basis("stated", note)) for key, value in zip(keys, values, strict=True)}


#: Rates of cure by name. All three describe the epoxy RTM6: what separates them is what a fit to
#: calorimetry is worth.
CURES: dict[str, dict[str, tuple[Any, Basis]]] = {
    "RTM6-Karkanas": _epoxy(
        "P. I. Karkanas, PhD thesis, Cranfield University, 1998",
        ("2.6e4 1/s", "74.69 kJ/mol", "5.78e4 1/s", "57.88 kJ/mol", 0.449, 1.217, 1.786),
    ),
    "RTM6-Pantelelis": _epoxy(
        "N. G. Pantelelis, 2005",
        ("2.54e4 1/s", "71.46 kJ/mol", "6.05e4 1/s", "61.25 kJ/mol", 0.492, 1.252, 1.75),
    ),
    "RTM6-Hein": _epoxy(
        "R. Hein, 2018; there as ln(rate) = 11.149 and 8.762",
        ("69494 1/s", "75.549 kJ/mol", "6387 1/s", "50.911 kJ/mol", 0.489, 1.549, 2.179),
    ),
}
