"""What a user wishes of a run: errors that it may have, and time that it may take."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field

from lcmchain.errors import InputError
from lcmchain.quantities.units import ANGLE, LENGTH, TIME, QuantityError, parse_quantity
from lcmchain.study.comparison import QUANTITIES, Quantity

_NUMBER = r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_WISH = re.compile(rf"\s*({_NUMBER})\s*(%|°|[A-Za-z]+)\s+(?:of\s+|in\s+)?(.+?)\s*", re.ASCII)
_DIMENSIONS = {"°": ANGLE, "mm": LENGTH}
#: What a forming run has: no clamps.
WISHED = tuple(quantity for quantity in QUANTITIES if quantity.name != "clamp_force")


@dataclass(frozen=True)
class Wish:
    """Errors allowed, by the names of ``QUANTITIES`` in SI or as parts, and solver time [s]."""

    errors: Mapping[str, float] = field(default_factory=dict)
    budget: float | None = None

    def in_words(self) -> str:
        """Return the wish as a text."""
        told = [
            f"{q.text(self.errors[q.name])} {q.title}" for q in QUANTITIES if q.name in self.errors
        ]
        if self.budget is not None:
            told.append(f"{self.budget:.3g} s")
        return ", ".join(told)


def read_wish(within: str | None, budget: str | None) -> Wish:
    """Read the options ``--within`` and ``--budget``.

    Raises
    ------
    InputError : a text that is no list of errors, such as ``1 deg shear, 1 % thickness``, an
        unknown quantity, a unit that does not fit it, or a time that is not positive.
    """
    seconds = None
    if budget is not None:
        try:
            seconds = parse_quantity(budget, TIME)
        except QuantityError as error:
            raise InputError(str(error), key="--budget") from None
        if not seconds > 0.0:
            raise InputError(f"must be positive, is {budget}", key="--budget")
    return Wish({} if within is None else _errors(within), seconds)


def _errors(text: str) -> dict[str, float]:
    errors: dict[str, float] = {}
    for part in text.split(","):
        match = _WISH.fullmatch(part)
        if match is None:
            raise InputError(
                f'"{part.strip()}" is not an error and what it is of; for example '
                '--within "1 deg shear, 1 % thickness, 3 % force, 0.5 mm contour"',
                key="--within",
            )
        number, unit, words = match.groups()
        quantity = _quantity(words)
        if quantity.name in errors:
            raise InputError(f'"{quantity.title}" is given twice', key="--within")
        value = _value(number, unit, quantity)
        if not value > 0.0:
            raise InputError(f'"{part.strip()}" allows no error at all', key="--within")
        if not math.isfinite(value):
            raise InputError(f'"{part.strip()}" allows any error; leave it out', key="--within")
        errors[quantity.name] = value
    return errors


def _quantity(words: str) -> Quantity:
    wanted = " ".join(words.lower().replace("_", " ").split())
    for quantity in WISHED:
        names = (quantity.title, quantity.name.replace("_", " "), quantity.short, *quantity.aliases)
        if wanted in (name.lower().replace("_", " ") for name in names):
            return quantity
    known = ", ".join(quantity.title for quantity in WISHED)
    raise InputError(f'"{words}" is no quantity that runs are compared by; there is {known}',
                     key="--within")  # fmt: skip


def _value(number: str, unit: str, quantity: Quantity) -> float:
    if quantity.relative:
        if unit != "%":
            raise InputError(
                f"the error of the {quantity.title} is a part of it: give it in %, such as "
                f'"1 % {quantity.title}"',
                key="--within",
            )
        return 0.01 * float(number)
    if unit == "%":
        raise InputError(
            f"the error of the {quantity.title} is no part of it: give it in {quantity.unit}",
            key="--within",
        )
    try:
        return parse_quantity(f"{number} {'deg' if unit == '°' else unit}",
                              _DIMENSIONS[quantity.unit])  # fmt: skip
    except QuantityError as error:
        raise InputError(str(error), key="--within") from None
