"""The scene reference against the models, walked without the code that writes the page."""

from __future__ import annotations

import math
import re
from collections import defaultdict
from collections.abc import Iterator
from typing import Annotated, Any, Literal, get_args, get_origin

import pytest
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from lcmchain.manual.scene_reference import scene_page
from lcmchain.quantities.entry_types import Number, Quantity
from lcmchain.scene import Scene

ROWS: dict[str, list[list[str]]] = defaultdict(list)
for line in scene_page().splitlines():
    cells = [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
    if len(cells) == 4 and cells[0].startswith("`"):
        ROWS[cells[0].strip("`")].append(cells)


def parts(annotation: Any) -> Iterator[Any]:
    """Yield a type and everything that it is made of and annotated with."""
    yield annotation
    for part in get_args(annotation) if get_origin(annotation) is not Literal else ():
        yield from parts(part)


def walk(model: type[BaseModel], seen: set[type[BaseModel]]) -> Iterator[tuple[str, FieldInfo]]:
    if model in seen:
        return
    seen.add(model)
    for key, field in model.model_fields.items():
        yield f"{model.__name__}.{key}", field
        for part in parts(field.annotation):
            if isinstance(part, type) and issubclass(part, BaseModel):
                yield from walk(part, seen)


ENTRIES = {
    name: field
    for name, field in walk(Scene, set())
    if name.rpartition(".")[2] not in ("law", "type")  # stand in the headings
}


def bounds(field: FieldInfo) -> list[str]:
    """Return what the page must say of the range of an entry or of its single values."""
    told = []
    for extra in [*field.metadata, *parts(Annotated[field.annotation, None])]:
        if not isinstance(extra, Number | Quantity):
            continue
        allowed = extra.allowed
        if allowed.words:  # angles: the page speaks of degrees
            told.append(allowed.words.removeprefix("be "))
        elif math.isinf(allowed.high) and allowed.low == 0.0:
            told.append("positive" if 0.0 in allowed.open_ends else "not negative")
        else:
            told += [f"{end:g}" for end in (allowed.low, allowed.high) if math.isfinite(end)]
    return told


def units(field: FieldInfo) -> list[str]:
    found = [*field.metadata, *parts(Annotated[field.annotation, None])]
    return [f"({extra.dimension.unit})" for extra in found if isinstance(extra, Quantity)]


def choices(field: FieldInfo) -> list[str]:
    """Return the values that may be chosen, those of the form of a table among them."""
    found = []
    for part in parts(field.annotation):
        if get_origin(part) is Literal:
            found += [f'`"{value}"`' for value in get_args(part)]
        chooser = getattr(field, "discriminator", None)
        if chooser and isinstance(part, type) and issubclass(part, BaseModel):
            found += [f'`"{v}"`' for v in get_args(part.model_fields[chooser].annotation)]
    return found


def default(field: FieldInfo) -> str:
    if field.is_required():
        return "required"
    value = field.default
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    if isinstance(value, str):
        return f'`"{value}"`'
    return f"`{value:g}`" if isinstance(value, int | float) else ""


@pytest.mark.parametrize("name", ENTRIES)
def test_every_entry_stands_with_unit_range_choices_default_and_meaning(name):
    field = ENTRIES[name]
    tokens = [*units(field), *bounds(field), *choices(field)]
    matching = [
        row
        for row in ROWS[name.rpartition(".")[2]]
        if all(token in row[1] for token in tokens)
        and default(field) in row[2]
        and (field.description or "") in row[3].replace("\\|", "|")
    ]
    assert matching, (name, tokens, default(field), ROWS[name.rpartition(".")[2]])
    assert all(row[2] and row[3] for row in matching)


def test_the_walk_meets_what_it_tests():
    assert len(ENTRIES) > 110
    ranged = [name for name, field in ENTRIES.items() if bounds(field)]
    assert len(ranged) > 60 and "FabricCompaction.c2" in ranged
    assert bounds(ENTRIES["FabricCompaction.c2"]) == ["1", "10"]
    assert bounds(ENTRIES["Blank.size"]) == ["positive", "positive"]
    assert len([name for name, field in ENTRIES.items() if choices(field)]) > 12
