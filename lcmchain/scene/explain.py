"""From pydantic's errors to sentences that name the scene key and say what to do."""

from __future__ import annotations

import difflib
import re
import types
import typing
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal, Union

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from lcmchain.scene.scene import Scene

#: The entry that chooses between the forms of a table.
DISCRIMINATORS = {
    "material": "law",
    "permeability": "law",
    "element": "type",
    "shape": "type",
    "motion": "type",
}

#: What a table is without that entry; no other table has a form of this name.
DEFAULT_FORM = "solid-shell"

#: Examples of tables, for messages about a missing one.
_TABLE_EXAMPLES = {
    "process": '[process] with time = "100 ms"',
    "element": 'element = "solid-shell"',
    "blank": '[blank] with size = ["300 mm", "300 mm"] and edge_length = "5 mm"',
    "material": '[material] with preset = "MD600"',
    "shape": 'shape = { type = "plate", side = "below" }',
    "motion": 'motion = { type = "fixed" }',
    "membrane": "[material.membrane]",
    "compaction": "[material.compaction]",
    "bending": "[material.bending]",
}


@dataclass(frozen=True)
class Problem:
    """One thing that is wrong in a scene: the key, and what to do about it."""

    key: str
    message: str

    def __str__(self) -> str:
        return f"{self.key}: {self.message}" if self.key else self.message


def problems_of(error: ValidationError, data: dict[str, Any]) -> list[Problem]:
    """Explain a validation error of a scene, one problem per wrong entry, in file order.

    Parameters
    ----------
    error : raised when `data` was validated as a Scene.
    data : the parsed TOML document, overrides included.
    """
    problems = []
    for details in error.errors(include_url=False):
        location = _without_tags(details["loc"], data)
        field = details.get("ctx", {}).get("field", "")
        key = key_text(location, data)
        if field:
            separator = "" if not key or field.startswith("[") else "."
            key = f"{key}{separator}{field}"
        message = _message(details, location, data)
        if details["type"] in ("union_tag_invalid", "union_tag_not_found"):
            key = f"{key}.{DISCRIMINATORS[str(location[-1])]}"
        problems.append(Problem(key, message))
    return _without_echoes(problems)


def _without_echoes(problems: list[Problem]) -> list[Problem]:
    """Drop the missing key where the same key is there, misspelt or in the wrong table."""
    answered = {
        f"{problem.key.rpartition('.')[0]}.{match[1]}".lstrip(".")
        for problem in problems
        if (match := re.match(r'unknown key; did you mean "(\w+)"', problem.message))
    }
    kept = []
    for problem in problems:
        echo = problem.key in answered and problem.message.startswith("is missing")
        if not echo and problem not in kept:
            kept.append(problem)
    return kept


def key_text(location: Sequence[str | int], data: Any) -> str:
    """Write a location as a dotted key with names of list entries: ``tools[2] "holder".axis``."""
    text = ""
    node = data
    for step in location:
        if isinstance(step, int):
            text += f"[{step}]"
            node = node[step] if isinstance(node, (list, tuple)) and step < len(node) else None
            if isinstance(node, dict) and isinstance(node.get("name"), str):
                text += f' "{node["name"]}"'
        else:
            text += f".{step}" if text else step
            node = node.get(step) if isinstance(node, dict) else None
    return text


def _without_tags(location: Sequence[str | int], data: Any) -> tuple[str | int, ...]:
    """Drop the names of chosen forms that pydantic puts between a table and its keys."""
    result: list[str | int] = []
    choosing = False
    for step in location:
        if not choosing:
            result.append(step)
        choosing = not choosing and step in DISCRIMINATORS
    return tuple(result)


def _message(details: Any, location: tuple[str | int, ...], data: Any) -> str:
    kind, context = details["type"], details.get("ctx", {})
    name = str(location[-1]) if location else ""
    if kind == "scene":
        return context["message"]
    if kind == "missing":
        return f"is missing; {_wanted(location, data)}"
    if kind == "extra_forbidden":
        return _unknown_key(name, location, data)
    if kind == "literal_error":
        model_field = _field_at(location, data)
        choices = _choices(model_field.annotation) if model_field else ()
        return _choice_message(details["input"], choices)
    if kind in ("union_tag_invalid", "union_tag_not_found"):
        choices = _tags(location, data)
        if kind == "union_tag_invalid":
            return _choice_message(details["input"].get(DISCRIMINATORS[name]), choices)
        preset = ' (or preset = "MD600")' if name == "material" else ""
        return f"is missing; write one of {_listed(choices)}{preset}"
    if kind in ("bool_type", "bool_parsing"):
        return f"must be true or false without quotes, but is {_toml_like(details['input'])}"
    if kind in ("model_type", "model_attributes_type", "dict_type", "dict_attributes_type"):
        return f"must be a table, but is {_toml_like(details['input'])}; {_wanted(location, data)}"
    return f"{details['msg'][0].lower()}{details['msg'][1:]}"


def _wanted(location: tuple[str | int, ...], data: Any) -> str:
    name = str(location[-1])
    if name in _TABLE_EXAMPLES:
        return f"for example {_TABLE_EXAMPLES[name]}"
    model_field = _field_at(location, data)
    if model_field is not None:
        for extra in model_field.metadata:
            if hasattr(extra, "example_text"):
                return f"for example {name} = {extra.example_text}"
        choices = _choices(model_field.annotation)
        if choices:
            return f"write {name} = one of {_listed(choices)}"
    return f"give {name}"


def _choice_message(value: Any, choices: Sequence[str]) -> str:
    close = difflib.get_close_matches(str(value), choices, n=1, cutoff=0.5)
    hint = f'; did you mean "{close[0]}"?' if close else ""
    return f"is {_toml_like(value)}, but must be one of {_listed(choices)}{hint}"


def _unknown_key(name: str, location: tuple[str | int, ...], data: Any) -> str:
    model = _model_at(location[:-1], data)
    keys = sorted(model.model_fields) if model else []
    for other in _models_of(_annotation_at(location[:-1], data)):
        if model is not None and name in other.model_fields:
            own, tag = _tags_of(model)[0], _tags_of(other)[0]
            return f'unknown key here; it belongs to "{tag}", but this is "{own}"'
    # A key that is right one table further in or out is the commonest slip after spelling.
    for table, inner in _inner_models(location[:-1], data):
        if name in inner.model_fields:
            return f'unknown key here; it belongs into "{table}" ({table}.{name})'
    for depth in range(len(location) - 2, -1, -1):
        outer = _model_at(location[:depth], data)
        if outer is not None and name in outer.model_fields:
            place = key_text(location[:depth], data)
            return f"unknown key here; it belongs into {f'[{place}]' if place else 'the top level'}"
    close = difflib.get_close_matches(name, keys, n=1, cutoff=0.6)
    if not close:
        close = [key for key in keys if key.lower() == name.lower()]
    if close:
        return f'unknown key; did you mean "{close[0]}"?'
    return f"unknown key; possible here: {', '.join(keys)}"


# --- walking the schema along a location ----------------------------------------------------------


def _model_at(location: Sequence[str | int], data: Any) -> type[BaseModel] | None:
    models = _models_of(_annotation_at(location, data))
    return _chosen(models, _value_at(location, data))


def _field_at(location: Sequence[str | int], data: Any) -> FieldInfo | None:
    if not location or isinstance(location[-1], int):
        return None
    model = _model_at(location[:-1], data)
    return model.model_fields.get(location[-1]) if model else None


def _annotation_at(location: Sequence[str | int], data: Any) -> Any:
    annotation: Any = Scene
    node = data
    for step in location:
        if isinstance(step, int):
            annotation = next(_entries_of(annotation), None)
            node = node[step] if isinstance(node, (list, tuple)) and step < len(node) else None
        else:
            model = _chosen(_models_of(annotation), node)
            model_field = model.model_fields.get(step) if model else None
            annotation = model_field.annotation if model_field else None
            node = node.get(step) if isinstance(node, dict) else None
    return annotation


def _value_at(location: Sequence[str | int], data: Any) -> Any:
    for step in location:
        try:
            data = data[step]
        except (KeyError, IndexError, TypeError):
            return None
    return data


def _chosen(models: list[type[BaseModel]], value: Any) -> type[BaseModel] | None:
    if len(models) == 1:
        return models[0]
    if not isinstance(value, dict):
        return None
    tag = "fabric" if value.get("preset") else value.get("law", value.get("type", DEFAULT_FORM))
    return next((model for model in models if tag in _tags_of(model)), None)


def _inner_models(
    location: Sequence[str | int], data: Any
) -> Iterator[tuple[str, type[BaseModel]]]:
    model = _model_at(location, data)
    for name, model_field in model.model_fields.items() if model else ():
        inner = _chosen(_models_of(model_field.annotation), _value_at((*location, name), data))
        if inner is not None:
            yield name, inner


def _models_of(annotation: Any) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    origin = typing.get_origin(annotation)
    if origin is Annotated:
        return _models_of(typing.get_args(annotation)[0])
    if origin in (Union, types.UnionType):
        return [model for part in typing.get_args(annotation) for model in _models_of(part)]
    return []


def _entries_of(annotation: Any) -> Iterator[Any]:
    origin = typing.get_origin(annotation)
    if origin is Annotated:
        yield from _entries_of(typing.get_args(annotation)[0])
    elif origin is tuple:
        yield typing.get_args(annotation)[0]
    elif origin in (Union, types.UnionType):
        for part in typing.get_args(annotation):
            yield from _entries_of(part)


def _choices(annotation: Any) -> tuple[str, ...]:
    if typing.get_origin(annotation) is Literal:
        return typing.get_args(annotation)
    return tuple(choice for part in typing.get_args(annotation) for choice in _choices(part))


def _tags(location: Sequence[str | int], data: Any) -> list[str]:
    models = _models_of(_annotation_at(location, data))
    return [tag for model in models for tag in _tags_of(model)]


def _tags_of(model: type[BaseModel]) -> tuple[str, ...]:
    for discriminator in ("law", "type"):
        if discriminator in model.model_fields:
            return _choices(model.model_fields[discriminator].annotation)
    return ()


def _listed(choices: Sequence[str]) -> str:
    return ", ".join(f'"{choice}"' for choice in choices)


def _toml_like(value: Any) -> str:
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict):
        return "a table"
    if isinstance(value, (list, tuple)):
        return "a list"
    return repr(value)
