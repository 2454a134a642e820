"""Fields of FMI 2.0: scalars ``name[1]``, ``name[2]``... that are the values of one variable."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from lcmchain.coupling.cosimulation.variable import Variable

_INDEXED = re.compile(r"(.+)\[(\d+(?:,\s*\d+)*)\]")


def with_fields(
    scalars: Sequence[Variable],
) -> tuple[dict[str, Variable], dict[str, Variable], dict[str, str]]:
    """Put the scalars ``name[1]``, ``name[2]``... together; they keep the order of their indices.

    Returns the variables, the scalars that are values of a field, and the fields of these.
    """
    groups: dict[str, list[tuple[tuple[int, ...], Variable]]] = {}
    for scalar in scalars:
        match = _INDEXED.fullmatch(scalar.name)
        if match is not None:
            index = tuple(int(number) for number in match[2].split(","))
            groups.setdefault(match[1], []).append((index, scalar))
    taken = {scalar.name for scalar in scalars}
    fields: dict[str, Variable] = {}
    for name, members in groups.items():
        if name not in taken and _is_field(members):
            fields[name] = _joined(name, [scalar for _, scalar in sorted(members, key=_index)])
    variables: dict[str, Variable] = {}
    elements: dict[str, Variable] = {}
    owner: dict[str, str] = {}
    for scalar in scalars:
        match = _INDEXED.fullmatch(scalar.name)
        if match is not None and match[1] in fields:
            variables.setdefault(match[1], fields[match[1]])
            elements[scalar.name] = scalar
            owner[scalar.name] = match[1]
        else:
            variables[scalar.name] = scalar
    return variables, elements, owner


def _index(member: tuple[tuple[int, ...], Variable]) -> tuple[int, ...]:
    return member[0]


def _is_field(members: Sequence[tuple[tuple[int, ...], Variable]]) -> bool:
    """Whether the indices fill an array that begins at 0 or 1, and all values are of one kind."""
    indices = [index for index, _ in members]
    ranks = {len(index) for index in indices}
    alike = {(v.kind, v.causality, v.variability, v.unit) for _, v in members}
    if len(ranks) != 1 or len(alike) != 1 or len(set(indices)) != len(indices):
        return False
    least, most = np.min(indices, axis=0), np.max(indices, axis=0)
    return bool(np.all(least <= 1) and np.prod(most - least + 1) == len(indices))


def _joined(name: str, members: Sequence[Variable]) -> Variable:
    first = members[0]
    starts = [scalar.start for scalar in members]
    text = re.sub(r",? (element|cell|node|value|nr\.?|no\.?|index)? ?\d+$", "", first.description)
    return Variable(
        name,
        first.kind,
        first.causality,
        first.variability,
        first.initial,
        np.concatenate([scalar.references for scalar in members]),
        len(members),
        True,
        tuple(text for start in starts for text in start) if all(starts) else (),
        first.unit,
        first.relative,
        text,
    )
