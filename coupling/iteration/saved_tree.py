"""A saved state as arrays and JSON, for a file: nested dicts, lists, tuples, records, arrays."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

#: What a word of the tree stands for, in the first place of a list.
_ARRAY, _LIST, _TUPLE, _DICT, _RECORD, _NUMBER = "array", "list", "tuple", "dict", "record", "float"


def flattened(saved: Any) -> tuple[Any, list[np.ndarray]]:
    """Return a saved state as a tree for JSON and the arrays that it refers to.

    Raises
    ------
    TypeError : something in it is none of the kinds above.
    """
    arrays: list[np.ndarray] = []
    return _flat(saved, arrays), arrays


def restored(tree: Any, arrays: list[np.ndarray], records: Mapping[str, Callable]) -> Any:
    """Return what was flattened.

    records : classes of the records in it, by their names; no other class is ever made.
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


def _flat(saved: Any, arrays: list[np.ndarray]) -> Any:
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
