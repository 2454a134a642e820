"""The page of all scene entries, from the scene tables themselves.

It walks the fields of the models below :class:`lcmchain.scene.Scene` and asks their types for unit,
range and example, wherever these types stand.
"""

from __future__ import annotations

import re
import types
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from lcmchain.manual.tables import code, markdown_table
from lcmchain.quantities.entry_types import Number, Quantity, Row
from lcmchain.scene import Scene

HEAD = """# Scene reference

Every entry of a scene file: what may be written, what it is when left out, and what it means. How
scene files are written stands in [Scene files](scene.md). A quantity may be given in any unit of
its kind; the example shows one, and the SI unit in brackets is that of Python and of results. Where
a key chooses between several forms of a table, each form has its own heading; a table that several
forms share stands under the first. A preset of a material fills all entries that are not given.
"""

COLUMNS = ("key", "value", "default", "meaning")


def scene_page() -> str:
    """Return the page as Markdown."""
    parts = [HEAD, "## Top level\n", _table(Scene)]
    places: dict[type[BaseModel], str] = {}
    printed: dict[type[BaseModel], str] = {}
    for key, model_field in Scene.model_fields.items():
        forms = _models_of(model_field.annotation)
        if not forms:
            continue
        is_list = _is_list(model_field.annotation)
        is_named = get_origin(_bare(model_field.annotation)) is dict
        path = f"[[{key}]]" if is_list else f"[{key}.NAME]" if is_named else f"[{key}]"
        parts.append(f"## {path}\n")
        if forms[0] in places and places[forms[0]] != path:
            parts.append(f"The same entries as in {places[forms[0]]}.\n")
            continue
        places.setdefault(forms[0], path)
        for inner_key, inner in (e for form in forms for e in form.model_fields.items()):
            for model in _models_of(inner.annotation):
                places.setdefault(model, f"[{key}.{inner_key}]")
        parts += _forms(path, forms, model_field, 3, set(), printed)
        printed |= dict.fromkeys(forms, f"[{key}]")
    return "\n".join(parts)


def _forms(
    path: str,
    forms: list[type[BaseModel]],
    owner: FieldInfo,
    level: int,
    shown: set[type[BaseModel]],
    printed: Mapping[type[BaseModel], str],
) -> Iterator[str]:
    """Yield the tables of a key: one, or one per form that another key chooses.

    A table below that is ``shown`` already, because forms share it, is not repeated, nor is one
    that was ``printed`` as a table of the scene.
    """
    chooser = _chooser(owner)
    for form in forms:
        if chooser:
            (value,) = get_args(form.model_fields[chooser].annotation)
            yield f'{"#" * level} {path} {chooser} = "{value}"\n'
        yield f"{_sentence(form)}\n"
        if set(form.model_fields) - {chooser}:
            yield _table(form, chooser)
        for inner_key, inner in form.model_fields.items():
            models = [model for model in _models_of(inner.annotation) if model not in shown]
            if models and models[0] in printed:
                yield f"`{inner_key}` has the same entries as {printed[models[0]]}.\n"
            elif models:
                shown.update(models)
                dotted = f"[{path.strip('[]')}.{inner_key}]"
                if _is_list(inner.annotation):
                    dotted = f"[{dotted}]"
                inner_level = level + 1 if chooser else level
                if not _chooser(inner):
                    of_form = f' of {chooser} = "{value}"' if chooser else ""
                    yield f"{'#' * inner_level} {dotted}{of_form}\n"
                yield from _forms(dotted, models, inner, inner_level, shown, printed)


def _table(model: type[BaseModel], chooser: str = "") -> str:
    """Return the entries of a table; the key that chooses its form stands in the heading."""
    rows = [
        (code(key), _value(field.annotation, field), _default(field), meaning_of(field))
        for key, field in model.model_fields.items()
        if key != chooser
    ]
    return markdown_table(COLUMNS, rows)


def _chooser(field: FieldInfo) -> str:
    """Return the key that chooses between the forms of a table; empty where there is one form."""
    extras = [field, *_extras(field.annotation)]
    if _is_list(field.annotation):
        extras += _extras(get_args(_bare(field.annotation))[0])
    return next((str(extra.discriminator) for extra in extras if _chooses(extra)), "")


def _chooses(extra: object) -> bool:
    return getattr(extra, "discriminator", None) is not None


# --- one entry ------------------------------------------------------------------------------------


def _value(annotation: object, field: FieldInfo | None = None) -> str:
    """Say what may be written: kind of quantity, example, range, choices."""
    extras = [*_extras(annotation), *(field.metadata if field is not None else [])]
    bare = _bare(annotation)
    models = _models_of(bare)
    for extra in extras:
        if hasattr(extra, "entries"):  # a row of values
            if models:
                return "tables"
            single = [choice for part in get_args(bare) for choice in _choices(part)]
            each = ", each " + " or ".join(code(f'"{choice}"') for choice in single)
            inner = each if single else _inner_range(bare)
            return f"{_count(extra)}{_inner_unit(bare)}, as {code(extra.example_text)}{inner}"
    if get_origin(bare) is dict:
        return "tables by their names"
    if models:
        return "table" if len(models) == 1 else _forms_text(models, field)
    for extra in extras:
        if hasattr(extra, "dimension"):
            name = f"{extra.dimension.name} ({extra.dimension.unit})"
            return f"{name}, as {code(extra.example_text)}{_range(extra)}"
        if hasattr(extra, "whole"):
            kind = "whole number" if extra.whole else "number"
            return f"{kind}, as {code(extra.example_text)}{_range(extra)}"
        if hasattr(extra, "example_text"):
            kind = re.sub("(?<=[a-z])(?=[A-Z])", " ", type(extra).__name__).lower()
            return f"{kind}, as {code(extra.example_text)}"
    choices = _choices(bare)
    if choices:
        return " or ".join(code(f'"{choice}"') for choice in choices)
    if bare is bool:
        return "`true` or `false`"
    raise TypeError(f"the manual cannot describe a scene entry of type {annotation!r}")


def _default(field: FieldInfo) -> str:
    if field.is_required():
        return "required"
    absent = next((extra.text for extra in field.metadata if _is_absent(extra)), None)
    if absent is not None and (absent or field.default is None):
        return absent or "see the other entries"
    default = field.default
    if default is PydanticUndefined:  # a table whose own entries have defaults
        chooser, table = _chooser(field), field.get_default(call_default_factory=True)
        return code(f'{chooser} = "{getattr(table, chooser)}"') if chooser else "its own defaults"
    if default == ():
        return "none"
    return code(_toml(default))


def meaning_of(field: FieldInfo) -> str:
    """Return what an entry means; that of a table with one form is the table's own."""
    if field.description:
        return field.description
    models = _models_of(field.annotation)
    return _sentence(models[0]) if len(models) == 1 else ""


def _is_absent(extra: object) -> bool:
    return type(extra).__name__ == "AbsentMeans"


def _count(row: Row) -> str:
    if row.count is not None:
        return f"{row.count} {row.entries}"
    return f"{row.minimum_count} or more {row.entries}" if row.minimum_count else row.entries


def _range(extra: Quantity | Number) -> str:
    words = "" if extra.allowed == type(extra.allowed)() else str(extra.allowed)
    words = words.replace("not be ", "not ").removeprefix("be ")
    return f", {words}" if words else ""


def _forms_text(models: list[type[BaseModel]], field: FieldInfo | None) -> str:
    """Name the forms of a table by the key that chooses between them."""
    chooser = _chooser(field) if field is not None else ""
    values = [get_args(model.model_fields[chooser].annotation)[0] for model in models]
    is_list = field is not None and _is_list(field.annotation)
    table = "tables, of each" if is_list else "table,"
    return f"{table} {code(chooser)} is " + " or ".join(code(f'"{value}"') for value in values)


def _inner_unit(annotation: object) -> str:
    """Return the SI unit of the single values of a row, where they are quantities."""
    for part in get_args(annotation):
        for extra in _extras(part):
            if hasattr(extra, "dimension"):
                return f" ({extra.dimension.unit})"
        inner = _inner_unit(_bare(part))
        if inner:
            return inner
    return ""


def _inner_range(annotation: object) -> str:
    """Return the range of the single values of a row, where they have one."""
    for part in get_args(annotation):
        for extra in _extras(part):
            if hasattr(extra, "allowed"):
                return _range(extra).replace(", ", ", each ", 1)
    return ""


def _sentence(model: type[BaseModel]) -> str:
    return " ".join((model.__doc__ or "").split("\n\n")[0].split())


def _toml(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, tuple):
        return f"[{', '.join(_toml(part) for part in value)}]"
    return f"{value:g}"


# --- types ----------------------------------------------------------------------------------------


def _bare(annotation: object) -> object:
    """Return a type without annotations, and without None."""
    if get_origin(annotation) is Annotated:
        return _bare(get_args(annotation)[0])
    if get_origin(annotation) in (Union, types.UnionType):
        parts = [part for part in get_args(annotation) if part is not type(None)]
        return _bare(parts[0]) if len(parts) == 1 else annotation
    return annotation


def _is_list(annotation: object) -> bool:
    return get_origin(_bare(annotation)) is tuple


def _extras(annotation: object) -> list[Any]:
    """Return what a type is annotated with, the innermost first."""
    if get_origin(annotation) is Annotated:
        inner, *extras = get_args(annotation)
        return [*_extras(inner), *extras]
    if get_origin(annotation) in (Union, types.UnionType):
        return [extra for part in get_args(annotation) for extra in _extras(part)]
    return []


def _models_of(annotation: object) -> list[type[BaseModel]]:
    """Return the tables that a type consists of."""
    bare = _bare(annotation)
    if isinstance(bare, type) and issubclass(bare, BaseModel):
        return [bare]
    if get_origin(bare) is dict:
        return _models_of(get_args(bare)[1])
    if get_origin(bare) in (tuple, Union, types.UnionType):
        return [model for part in get_args(bare) for model in _models_of(part)]
    return []


def _choices(annotation: object) -> tuple[str, ...]:
    return get_args(annotation) if get_origin(annotation) is Literal else ()
