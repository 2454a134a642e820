"""Values in parameter sets of SSP 1.0 and 2.0: numbers, texts and arrays, with units and items."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any
from xml.etree.ElementTree import Element

from lcmchain.coupling.cosimulation.physical_units import (
    BASE,
    PhysicalUnit,
    UnitError,
    unit_from_base,
    unit_from_name,
)
from lcmchain.coupling.cosimulation.ssp_names import SSC, SSV
from lcmchain.errors import InputError, shortened

_WHOLE = tuple(f"{sign}Int{bits}" for sign in ("", "U") for bits in (8, 16, 32, 64))
#: What the types of a value or connector are here; those of FMI 3 came with SSP 2.0.
KINDS = {
    **dict.fromkeys(("Real", "Float64", "Float32"), "Real"),
    **dict.fromkeys(("Integer", *_WHOLE), "Integer"),
    **{kind: kind for kind in ("Boolean", "String", "Enumeration", "Binary", "Clock")},
}
#: Types that nothing is exchanged of.
NOT_EXCHANGED = ("Binary", "Clock")

#: Numbers of the items of an enumeration, by its name and theirs.
Items = Mapping[str, Mapping[str, int]]


@dataclass(frozen=True)
class Given:
    """A value of a parameter set: its type, its text and its unit.

    Parameters
    ----------
    kind : ``Real``, ``Integer``, ``Boolean``, ``String``, ``Enumeration`` or ``Binary``.
    texts : one for a single value, one for each entry of an array in row-major order.
    is_array : whether it is one, even of a single entry.
    measure : the unit where the parameter set or the structure defines it.
    items : of the enumeration, as the archive defines them.
    """

    kind: str
    texts: tuple[str, ...]
    is_array: bool = False
    unit: str | None = None
    measure: PhysicalUnit | None = None
    items: Mapping[str, int] | None = None


def given_of(parameter: Element, measures: Mapping[str, PhysicalUnit], items: Items) -> Given:
    """Return the value of a parameter.

    Parameters
    ----------
    measures, items : units and enumerations that the parameter set or the structure defines.

    Raises
    ------
    InputError : a type that is not known, or another number of values than the dimensions say.
    """
    name = shortened(parameter.get("name", ""))
    for value in parameter:
        kind = KINDS.get(value.tag.removeprefix(SSV))
        if kind is None or kind == "Clock":
            continue
        listed = tuple(entry.get("value", "") for entry in value.findall(f"{SSV}Value"))
        single = value.get("value", "")
        if not listed:
            one_text = kind in ("String", "Enumeration", "Binary")
            listed = (single,) if one_text else tuple(single.split()) or ("",)
        size = _size(parameter, name)
        if size is not None and size != len(listed):
            raise InputError(
                f'the parameter "{name}" has {len(listed)} values, its dimensions are for {size}'
            )
        unit = value.get("unit")
        return Given(
            kind, listed, size is not None or len(listed) > 1, unit, measures.get(unit or ""),
            items.get(value.get("name", "")) if kind == "Enumeration" else None,
        )  # fmt: skip
    raise InputError(f'the value of parameter "{name}" is of a type that is not read')


def _size(parameter: Element, name: str) -> int | None:
    """Return the number of entries that the dimensions of a parameter say, None without any."""
    sizes = [dimension.get("size") for dimension in parameter.findall(f"{SSC}Dimension")]
    if not sizes or None in sizes:  # left open
        return None
    try:
        return math.prod(int(size or "") for size in sizes)
    except ValueError:
        raise InputError(f'the dimensions of the parameter "{name}" are no whole numbers') from None


def value_of_text(given: Given, text: str, what: str) -> Any:
    """Return a value that is no real number: a text, a switch or a whole number.

    what : the parameter, for messages.

    Raises
    ------
    InputError : the text is none of its type.
    """
    try:
        if given.kind == "String":
            return text
        if given.kind == "Boolean":
            return {"true": True, "1": True, "false": False, "0": False}[text]
        if given.kind == "Enumeration" and given.items is not None and text in given.items:
            return given.items[text]
        return int(text)
    except (ValueError, KeyError):
        hint = ""
        if given.kind == "Enumeration":
            known = ", ".join(given.items or ())
            hint = f"; the archive defines {known}" if known else "; give the number of the item"
        raise InputError(f'the value of {what}, "{text}", is no {given.kind}{hint}') from None


def items_of(element: Element, space: str) -> dict[str, dict[str, int]]:
    """Return the enumerations that a structure or a parameter set defines.

    Raises
    ------
    InputError : the value of an item is no whole number.
    """
    found: dict[str, dict[str, int]] = {}
    for enumeration in element.findall(f"{space}Enumerations/{SSC}Enumeration"):
        name = enumeration.get("name", "")
        try:
            found[name] = {
                item.get("name", ""): int(item.get("value", ""))
                for item in enumeration.findall(f"{SSC}Item")
            }
        except ValueError:
            raise InputError(
                f'an item of the enumeration "{shortened(name)}" has no whole number'
            ) from None
    return found


def measures_of(element: Element, space: str) -> dict[str, PhysicalUnit]:
    """Return the units that a structure or a parameter set defines.

    Raises
    ------
    InputError : one whose numbers are none, or whose factor is not positive.
    """
    found = {}
    for unit in element.findall(f"{space}Units/{SSC}Unit"):
        name, base = unit.get("name", ""), unit.find(f"{SSC}BaseUnit")
        if base is None:
            continue
        try:
            exponents = tuple(float(base.get(key, "0")) for key in BASE)
            factor, offset = float(base.get("factor", "1")), float(base.get("offset", "0"))
            own = unit_from_base(name, exponents, factor, offset)
        except (UnitError, ValueError) as error:
            raise InputError(
                f'the definition of the unit "{shortened(name)}" is wrong: {error}'
            ) from None
        found[name] = _as_usual(own)
    return found


def _as_usual(own: PhysicalUnit) -> PhysicalUnit:
    """Return a unit as its name is usually understood where the definition means the same."""
    try:
        usual = unit_from_name(own.name)
    except UnitError:
        return own
    same = usual.exponents == own.exponents and all(
        math.isclose(a, b, rel_tol=1e-14, abs_tol=1e-300)
        for a, b in ((usual.factor, own.factor), (usual.offset, own.offset))
    )
    return usual if same else own
