"""The models of a scene at a location of a document: table, entry, choices, and files it names."""

from __future__ import annotations

import types
import typing
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Annotated, Any, Literal, Union

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from lcmchain.quantities.entry_types import FileName
from lcmchain.scene.scene import Scene

#: What a table is without that entry; no other table has a form of this name.
DEFAULT_FORM = "solid-shell"

#: Model of the documents that are walked; other files of the same form name theirs.
_document: ContextVar[type[BaseModel]] = ContextVar("_document", default=Scene)


@contextmanager
def documents_of(model: type[BaseModel]) -> Iterator[None]:
    """Walk documents of another model than a scene within the block."""
    token = _document.set(model)
    try:
        yield
    finally:
        _document.reset(token)


def model_at(location: Sequence[str | int], data: Any) -> type[BaseModel] | None:
    """Model of the table at a location; None where there is none or its form is not chosen."""
    models = models_of(annotation_at(location, data))
    return _chosen(models, _value_at(location, data))


def field_at(location: Sequence[str | int], data: Any) -> FieldInfo | None:
    """Entry of a model at a location; None for an entry of a list, or where there is none."""
    if not location or isinstance(location[-1], int):
        return None
    model = model_at(location[:-1], data)
    return model.model_fields.get(location[-1]) if model else None


def annotation_at(location: Sequence[str | int], data: Any) -> Any:
    """Type of what stands at a location."""
    annotation: Any = _document.get()
    node = data
    for step in location:
        if isinstance(step, int):
            annotation = next(_entries_of(annotation), None)
            node = node[step] if isinstance(node, (list, tuple)) and step < len(node) else None
        else:
            named = _named_tables(annotation)
            if named is not None:
                annotation = named
            else:
                model = _chosen(models_of(annotation), node)
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
    default = "fabric" if value.get("preset") else value.get("type", DEFAULT_FORM)
    tag = value.get("law", default)
    return next((model for model in models if tag in tags_of(model)), None)


def inner_models(location: Sequence[str | int], data: Any) -> Iterator[tuple[str, type[BaseModel]]]:
    """Tables inside the table at a location, each with its name."""
    model = model_at(location, data)
    for name, model_field in model.model_fields.items() if model else ():
        inner = _chosen(models_of(model_field.annotation), _value_at((*location, name), data))
        if inner is not None:
            yield name, inner


def models_of(annotation: Any) -> list[type[BaseModel]]:
    """Models that a type allows."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    origin = typing.get_origin(annotation)
    if origin is Annotated:
        return models_of(typing.get_args(annotation)[0])
    if origin in (Union, types.UnionType):
        return [model for part in typing.get_args(annotation) for model in models_of(part)]
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


def _named_tables(annotation: Any) -> Any:
    """Type of the tables that are entries of a table by names of their own; None for others."""
    origin = typing.get_origin(annotation)
    if origin is Annotated:
        return _named_tables(typing.get_args(annotation)[0])
    return typing.get_args(annotation)[1] if origin is dict else None


def choices_of(annotation: Any) -> tuple[str, ...]:
    """Texts that a type allows."""
    if typing.get_origin(annotation) is Literal:
        return typing.get_args(annotation)
    return tuple(choice for part in typing.get_args(annotation) for choice in choices_of(part))


def tags_at(location: Sequence[str | int], data: Any) -> list[str]:
    """Names of the forms that the table at a location may take."""
    models = models_of(annotation_at(location, data))
    return [tag for model in models for tag in tags_of(model)]


def tags_of(model: type[BaseModel]) -> tuple[str, ...]:
    """Names that choose a model among the forms of its table."""
    for discriminator in ("law", "type"):
        if discriminator in model.model_fields:
            return choices_of(model.model_fields[discriminator].annotation)
    return ()


# --- files that a scene names ---------------------------------------------------------------------


Location = tuple[str | int, ...]


def named_files(data: dict[str, Any]) -> Iterator[tuple[Location, str]]:
    """Yield location and value of every entry of a document that names a file.

    Works on documents with errors too; values that are no names are left out.
    """
    for location, value in _texts(data, ()):
        entry = field_at(location, data)
        if entry is not None and any(isinstance(own, FileName) for own in entry.metadata):
            yield location, value


def dotted(location: Location) -> str:
    """Write a location as the key of an override: ``tools[2].shape.file``."""
    text = "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in location)
    return text.removeprefix(".")


def _texts(node: Any, location: Location) -> Iterator[tuple[Location, str]]:
    entries: list[tuple[str | int, Any]] = []
    if isinstance(node, dict):
        entries = list(node.items())
    elif isinstance(node, list):
        entries = list(enumerate(node))
    for step, value in entries:
        here = (*location, step)
        if isinstance(value, str) and isinstance(step, str) and value.strip():
            yield here, value
        else:
            yield from _texts(value, here)
