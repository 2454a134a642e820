"""Saved states in a file: arrays and JSON, in an archive that is complete or refused.

A saved state is made of nested dicts, lists, tuples, records and arrays. The first line of the
archive names the format and the SHA-256 of the rest: a file in which one bit has changed is refused
before anything of it is read.
"""

from __future__ import annotations

import hashlib
import io
import json
import math
import os
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lcmchain.atomic import replacing
from lcmchain.errors import InputError

#: Types of the entries of a tree: the first word of a list.
_ARRAY, _LIST, _TUPLE, _DICT, _RECORD, _NUMBER = "array", "list", "tuple", "dict", "record", "float"


def flattened(saved: object) -> tuple[Any, list[np.ndarray]]:
    """Return a saved state as a tree for JSON and the arrays that it refers to.

    Raises
    ------
    TypeError : something in it is of another type.
    """
    arrays: list[np.ndarray] = []
    return _flat(saved, arrays), arrays


def restored(tree: object, arrays: list[np.ndarray], records: Mapping[str, Callable]) -> Any:
    """Return the saved state of a tree and its arrays.

    records : classes of the records in it, by name; no other class is ever made.
    """
    if not isinstance(tree, list):
        return tree
    kind, *rest = tree
    if kind == _ARRAY:
        return arrays[rest[0]]
    if kind == _NUMBER:
        return float(rest[0])
    if kind == _DICT:
        return {key: restored(value, arrays, records) for key, value in rest[0].items()}
    if kind == _RECORD:
        values = {key: restored(value, arrays, records) for key, value in rest[1].items()}
        return records[rest[0]](**values)
    entries = [restored(value, arrays, records) for value in rest[0]]
    return entries if kind == _LIST else tuple(entries)


def _flat(saved: object, arrays: list[np.ndarray]) -> Any:
    if saved is None or isinstance(saved, (bool, str)) or type(saved) is int:
        return saved
    if isinstance(saved, np.ndarray):
        arrays.append(saved)
        return [_ARRAY, len(arrays) - 1]
    if isinstance(saved, (float, np.floating)):
        number = float(saved)
        return [_NUMBER, number if math.isfinite(number) else str(number)]
    if isinstance(saved, np.integer):
        return int(saved)
    if isinstance(saved, dict):
        return [_DICT, {str(key): _flat(value, arrays) for key, value in saved.items()}]
    if is_dataclass(saved):
        named = {f.name: getattr(saved, f.name) for f in fields(saved) if f.init}
    elif hasattr(saved, "_asdict"):
        named = saved._asdict()
    elif isinstance(saved, (list, tuple)):
        kind = _LIST if isinstance(saved, list) else _TUPLE
        return [kind, [_flat(value, arrays) for value in saved]]
    else:
        raise TypeError(f"a {type(saved).__name__} cannot be written to a checkpoint")
    kept = {key: _flat(value, arrays) for key, value in named.items()}
    return [_RECORD, type(saved).__name__, kept]


# --- the archive ----------------------------------------------------------------------------------


def write_archive(
    path: Path, form: str, header: dict[str, Any], arrays: Mapping[str, np.ndarray]
) -> None:
    """Write a header, as JSON, and arrays, whole or not at all.

    form : first words of the file: its kind, and the number of its format.
    """
    content = io.BytesIO()
    np.savez(content, header=np.array(json.dumps(header)), **arrays)  # type: ignore[arg-type]
    body = content.getbuffer()
    with replacing(path) as temporary, open(temporary, "wb") as file:
        digest = hashlib.sha256(body).hexdigest()
        file.write(f"{form} {digest}\n".encode())
        file.write(body)
        file.flush()
        os.fsync(file.fileno())


def read_archive(path: Path, form: str, anew: str) -> tuple[Any, dict[str, np.ndarray]]:
    """Return header and arrays of a file of this form.

    anew : how to start without it, for messages.

    Raises
    ------
    InputError : there is none, it is damaged, or it has another form.
    """
    try:
        with open(path, "rb") as file:
            first = file.readline(200)
            body = file.read()
    except FileNotFoundError:
        raise InputError(f"there is no checkpoint to go on from; {anew}", file=path) from None
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", file=path) from None
    if first.split() != [*form.encode().split(), hashlib.sha256(body).hexdigest().encode()]:
        raise InputError(
            f"this is no checkpoint of this version, or it is damaged; {anew}", file=path
        )
    with np.load(io.BytesIO(body), allow_pickle=False) as data:
        arrays = {name: data[name] for name in data.files}
    return json.loads(str(arrays.pop("header"))), arrays
