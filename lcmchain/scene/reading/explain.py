"""Wrong entries of a scene: which table, entry and choice are meant, and the sentence that says so.

A location is the path of an entry in the parsed document. From it follow the model of the table,
its entries and its choices, and from these the sentence that names the key and says what to do.
"""

from __future__ import annotations

import difflib
import re
import types
import typing
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Annotated, Any, Literal, Union

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from lcmchain.errors import shortened
from lcmchain.quantities.entry_types import FileName, toml_like
from lcmchain.scene.reading.overrides import TomlTable
from lcmchain.scene.scene import Scene

# --- models at a location of a document -----------------------------------------------------------


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


def model_at(location: Sequence[str | int], data: object) -> type[BaseModel] | None:
    """Model of the table at a location; None where there is none or its form is not chosen."""
    models = models_of(annotation_at(location, data))
    return _chosen(models, value_at(location, data))


def field_at(location: Sequence[str | int], data: object) -> FieldInfo | None:
    """Entry of a model at a location; None for an entry of a list, or where there is none."""
    if not location or isinstance(location[-1], int):
        return None
    model = model_at(location[:-1], data)
    return model.model_fields.get(location[-1]) if model else None


def annotation_at(location: Sequence[str | int], data: object) -> object:
    """Type of what stands at a location."""
    annotation: object = _document.get()
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


def value_at(location: Sequence[str | int], data: object, absent: object = None) -> object:
    """Return what stands at a location of a document, or ``absent``."""
    node: Any = data
    for step in location:
        try:
            node = node[step]
        except (KeyError, IndexError, TypeError):
            return absent
    return node


def _chosen(models: list[type[BaseModel]], value: object) -> type[BaseModel] | None:
    if len(models) == 1:
        return models[0]
    if not isinstance(value, dict):
        return None
    default = "fabric" if value.get("preset") else value.get("type", DEFAULT_FORM)
    tag = value.get("law", default)
    return next((model for model in models if tag in tags_of(model)), None)


def inner_models(
    location: Sequence[str | int], data: object
) -> Iterator[tuple[str, type[BaseModel]]]:
    """Tables inside the table at a location, each with its name."""
    model = model_at(location, data)
    for name, model_field in model.model_fields.items() if model else ():
        inner = _chosen(models_of(model_field.annotation), value_at((*location, name), data))
        if inner is not None:
            yield name, inner


def models_of(annotation: object) -> list[type[BaseModel]]:
    """Models that a type allows."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    origin = typing.get_origin(annotation)
    if origin is Annotated:
        return models_of(typing.get_args(annotation)[0])
    if origin in (Union, types.UnionType):
        return [model for part in typing.get_args(annotation) for model in models_of(part)]
    return []


def _entries_of(annotation: object) -> Iterator[object]:
    origin = typing.get_origin(annotation)
    if origin is Annotated:
        yield from _entries_of(typing.get_args(annotation)[0])
    elif origin is tuple:
        yield typing.get_args(annotation)[0]
    elif origin in (Union, types.UnionType):
        for part in typing.get_args(annotation):
            yield from _entries_of(part)


def _named_tables(annotation: object) -> object:
    """Type of the tables that are entries of a table by names of their own; None for others."""
    origin = typing.get_origin(annotation)
    if origin is Annotated:
        return _named_tables(typing.get_args(annotation)[0])
    return typing.get_args(annotation)[1] if origin is dict else None


def choices_of(annotation: object) -> tuple[str, ...]:
    """Texts that a type allows."""
    if typing.get_origin(annotation) is Literal:
        return typing.get_args(annotation)
    return tuple(choice for part in typing.get_args(annotation) for choice in choices_of(part))


def tags_at(location: Sequence[str | int], data: object) -> list[str]:
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


def named_files(data: TomlTable) -> Iterator[tuple[Location, str]]:
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


def _texts(node: object, location: Location) -> Iterator[tuple[Location, str]]:
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


# --- from pydantic's errors to sentences ----------------------------------------------------------


#: The entry that chooses between the forms of a table.
DISCRIMINATORS = {
    "material": "law",
    "permeability": "law",
    "element": "type",
    "shape": "type",
    "motion": "type",
    "resin": "law",
    "cure": "law",
    "temperature": "law",
    "closure": "type",
}
#: The same for lists of tables with forms.
LIST_DISCRIMINATORS = {"laws": "type"}

#: Table of materials that have names of their own.
NAMED_MATERIALS = "materials"

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
    "fibre": 'fibre = { preset = "T300" }',
    "resin": 'resin = { preset = "MY750" }',
    "temperature": 'temperature = { law = "constant", value = "60 degC" }',
}

#: That of a resin that flows; the resin of a laminate bears the same name.
_FLOWING_RESIN = 'resin = { law = "constant", viscosity = "0.1 Pa*s" }'

_PLIES = (
    "plies that lie on each other stand in [[plies]], bottom first, or in the short form "
    'layup = "[0/90, 45/-45]s" beside [blank] and [material]'
)
_OUTLINE = (
    "[blank] and [[plies]] have holes, darts and slits, each a list of points, and drawing for a "
    "DXF file (lcmchain docs outlines); notches are corners of outline"
)
_HELD_BY_TOOLS = (
    "[[grippers]] hold, lead or pull a place of the sheet (lcmchain docs grippers); a plate with "
    'motion = { type = "guided", ... } presses with its mass and force as a blank holder does'
)
_LOADS = (
    "what loads the sheet is a tool with a stroke or a force (motion = "
    '{ type = "guided", ... }), [[pressure]] on a face, and process.gravity'
)
_FILMS = (
    "a diaphragm or film is one of [[plies]], with film = true; [[pressure]] on one of its faces "
    "presses it (lcmchain docs diaphragms)"
)
#: What a scene has for a concept that other programs have a key for; keys in the singular.
_CONCEPTS = {
    **dict.fromkeys(
        ("layer", "ply", "stack", "layup", "lay_up", "laminate", "body", "bodie", "sheet"),
        _PLIES,
    ),
    **dict.fromkeys(("hole", "cutout", "opening", "notch", "notche", "slit", "cut"), _OUTLINE),
    **dict.fromkeys(
        (
            "clamp", "gripper", "grip", "spring", "holder", "blank_holder", "blankholder",
            "support", "constraint", "boundary", "boundary_condition", "fixed", "fixture",
            "tension",
        ),
        _HELD_BY_TOOLS,
    ),
    **dict.fromkeys(("load", "force", "bag", "vacuum"), _LOADS),
    **dict.fromkeys(("diaphragm", "film", "membrane_bag"), _FILMS),
    **dict.fromkeys(
        ("symmetry", "symmetrie", "symmetry_plane"),
        "there are no planes of symmetry; give the whole blank and whole tools",
    ),
    **dict.fromkeys(
        ("temperature", "heating", "viscosity", "rate"),
        "what of a fabric's shear depends on rate and temperature stands in [material.viscous]; "
        "viscosity and temperature of the resin stand in [infiltration]",
    ),
    **dict.fromkeys(
        ("step", "stage", "phase"),
        "the steps of a process stand in [[stages]], in their order, each with its motions "
        "(lcmchain docs stages)",
    ),
    **dict.fromkeys(
        ("time_step", "timestep", "dt"),
        "the time step follows from the stability limit, of which process.step_safety is a part",
    ),
}  # fmt: skip

#: Wrong entries that are explained; a file with more of them has one cause.
MOST_PROBLEMS = 200


@dataclass(frozen=True)
class Problem:
    """One thing that is wrong in a scene: the key, and what to do about it."""

    key: str
    message: str

    def __str__(self) -> str:
        return f"{self.key}: {self.message}" if self.key else self.message


def problems_of(
    error: ValidationError, data: TomlTable, at: tuple[str | int, ...] = ()
) -> list[Problem]:
    """Explain a validation error of a scene, one problem per wrong entry, in file order.

    Only the first ``MOST_PROBLEMS`` are explained.

    Parameters
    ----------
    error : raised when `data`, or the table in it, was validated.
    data : the parsed TOML document, overrides included.
    at : where in a scene the table stands that was validated; keys are told from there.
    """
    problems = []
    for details in error.errors(include_url=False)[:MOST_PROBLEMS]:
        location = _without_tags((*at, *details["loc"]), data)
        field = details.get("ctx", {}).get("field", "")
        key = key_text(location, data).removeprefix(key_text(at, data)).lstrip(".")
        if field:
            separator = "" if not key or field.startswith("[") else "."
            key = f"{key}{separator}{field}"
        message = _message(details, location, data, at)
        if details["type"] in ("union_tag_invalid", "union_tag_not_found"):
            key = f"{key}.{_discriminator(location)}"
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


def key_text(location: Sequence[str | int], data: object) -> str:
    """Write a location as a dotted key with names of list entries: ``tools[2] "holder".axis``."""
    text = ""
    node = data
    for step in location:
        if isinstance(step, int):
            text += f"[{step}]"
            node = node[step] if isinstance(node, (list, tuple)) and step < len(node) else None
            if isinstance(node, dict) and isinstance(node.get("name"), str):
                text += f' "{shortened(node["name"])}"'
        else:
            text += f".{step}" if text else step
            node = node.get(step) if isinstance(node, dict) else None
    return text


def _without_tags(location: Sequence[str | int], data: object) -> tuple[str | int, ...]:
    """Drop the names of chosen forms that pydantic puts between a table and its keys."""
    result: list[str | int] = []
    choosing = False
    for step in location:
        if not choosing:
            result.append(step)
        # "resin" names a table with forms here and one without there
        is_named_material = result[:-1] == [NAMED_MATERIALS]
        is_of_list = isinstance(step, int) and len(result) > 1 and result[-2] in LIST_DISCRIMINATORS
        may_choose = not choosing and (step in DISCRIMINATORS or is_named_material or is_of_list)
        choosing = may_choose and len(models_of(annotation_at(result, data))) > 1
    return tuple(result)


def _discriminator(location: Sequence[str | int]) -> str:
    """Return the entry that chooses between the forms of the table at a location."""
    if isinstance(location[-1], int):
        return LIST_DISCRIMINATORS[str(location[-2])]
    is_named_material = tuple(location[:-1]) == (NAMED_MATERIALS,)
    return DISCRIMINATORS["material" if is_named_material else str(location[-1])]


def _message(
    details: Mapping[str, Any],
    location: tuple[str | int, ...],
    data: object,
    at: tuple[str | int, ...],
) -> str:
    kind, context = details["type"], details.get("ctx", {})
    name = str(location[-1]) if location else ""
    if kind == "scene":
        return context["message"]
    if kind == "missing":
        return f"is missing; {_wanted(location, data)}"
    if kind == "extra_forbidden":
        return _unknown_key(name, location, data, at)
    if kind == "literal_error":
        model_field = field_at(location, data)
        choices = choices_of(model_field.annotation) if model_field else ()
        return _choice_message(details["input"], choices)
    if kind in ("union_tag_invalid", "union_tag_not_found"):
        choices = tuple(tags_at(location, data))
        if kind == "union_tag_invalid":
            return _choice_message(details["input"].get(_discriminator(location)), choices)
        preset = ' (or preset = "MD600")' if name == "material" else ""
        return f"is missing; write one of {_listed(choices)}{preset}"
    if kind in ("bool_type", "bool_parsing"):
        return f"must be true or false without quotes, but is {_toml_like(details['input'])}"
    if kind in ("model_type", "model_attributes_type", "dict_type", "dict_attributes_type"):
        return f"must be a table, but is {_toml_like(details['input'])}; {_wanted(location, data)}"
    return f"{details['msg'][0].lower()}{details['msg'][1:]}"


def _wanted(location: tuple[str | int, ...], data: object) -> str:
    if isinstance(location[-1], int) and len(location) > 1:
        return f"write it as [[{location[-2]}]], or between braces"
    name = str(location[-1])
    if name == "resin" and len(models_of(annotation_at(location, data))) > 1:
        return f"for example {_FLOWING_RESIN}"  # it flows by one of several laws
    if name in _TABLE_EXAMPLES:
        return f"for example {_TABLE_EXAMPLES[name]}"
    model_field = field_at(location, data)
    if model_field is not None:
        for extra in model_field.metadata:
            if hasattr(extra, "example_text"):
                return f"for example {name} = {extra.example_text}"
        choices = choices_of(model_field.annotation)
        if choices:
            return f"write {name} = one of {_listed(choices)}"
    return f"give {name}"


def _choice_message(value: object, choices: Sequence[str]) -> str:
    close = difflib.get_close_matches(str(value), choices, n=1, cutoff=0.5)
    hint = f'; did you mean "{close[0]}"?' if close else ""
    return f"is {_toml_like(value)}, but must be one of {_listed(choices)}{hint}"


def _unknown_key(
    name: str, location: tuple[str | int, ...], data: object, at: tuple[str | int, ...]
) -> str:
    """Say where a key belongs, in a file that holds the table ``at`` of a scene."""
    model = model_at(location[:-1], data)
    keys = sorted(model.model_fields) if model else []
    # Tables of other stages have loads, layers and temperatures of their own.
    of_forming = location[0] not in ("mapping", "infiltration")
    for other in models_of(annotation_at(location[:-1], data)):
        if model is not None and name in other.model_fields:
            own, tag = tags_of(model)[0], tags_of(other)[0]
            return f'unknown key here; it belongs to "{tag}", but this is "{own}"'
    # A key that is right one table further in or out is the commonest slip after spelling.
    for table, inner in inner_models(location[:-1], data):
        if name in inner.model_fields:
            return f'unknown key here; it belongs into "{table}" ({table}.{name})'
    for depth in range(len(location) - 2, -1, -1):
        outer = model_at(location[:depth], data)
        # the table that the key already stands in is no place to send it to
        if outer is None or name not in outer.model_fields or location[depth] == name:
            continue
        if depth < len(at):
            return f"unknown key; it belongs into a scene, and this file holds its {at[-1]} alone"
        place = key_text(location[:depth], data)
        place = f"[{place}]" if place else "the top level"
        # One word may mean two things: what is possible here is the other way out.
        return f"unknown key here; it belongs into {place}; possible here: {', '.join(keys)}"
    concept = _CONCEPTS.get(name.lower().removesuffix("s"))
    if concept is not None and of_forming:
        return f"unknown key; {concept}"
    close = difflib.get_close_matches(name, keys, n=1, cutoff=0.6)
    if not close:
        close = [key for key in keys if key.lower() == name.lower()]
    if close:
        return f'unknown key; did you mean "{close[0]}"?'
    return f"unknown key; possible here: {', '.join(keys)}"


def _listed(choices: Sequence[str]) -> str:
    return ", ".join(f'"{choice}"' for choice in choices)


def _toml_like(value: object) -> str:
    return "a list" if isinstance(value, (list, tuple)) else toml_like(value)
