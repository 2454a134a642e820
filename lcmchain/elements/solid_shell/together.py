"""Bodies of one kind of solid-shells as one body for the time loop.

Plies of one fabric and mesh size have the same law and the same choices, and blocks of elements
know their nodes by the numbers of the model. The loop then takes the blocks of all of them as those
of one: it is compiled once for any number of plies, and threads meet once for all of them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lcmchain.compilation.processor import aligned
from lcmchain.elements.blocks import SharedBlocks
from lcmchain.elements.solid_shell.kernel import SolidShellData


def kinds_of(data: Sequence[object]) -> list[list[int]]:
    """Return the numbers of the constants of bodies that can be put together, kind by kind."""
    kinds: list[list[int]] = []
    for number, own in enumerate(data):
        for kind in kinds:
            if _same_kernel(data[kind[0]], own):
                kind.append(number)
                break
        else:
            kinds.append([number])
    return kinds


def _same_kernel(first: object, second: object) -> bool:
    if not (isinstance(first, SolidShellData) and isinstance(second, SolidShellData)):
        return False
    return all(
        _same(getattr(first, name), getattr(second, name))
        for name in ("law", "options", "quick_options")
    )


def put_together(data: Sequence[SolidShellData]) -> SolidShellData:
    """Return the constants of bodies of one kind, block after block, as the time loop reads them.

    What other kernels read of a body alone is that of the first one.
    """
    first = data[0]
    if len(data) == 1:
        return first
    quick = None
    if first.quick_data is not None:
        quick = _one_after_the_other([own.quick_data for own in data])
    return first._replace(
        corner_node=np.concatenate([own.corner_node for own in data]),
        corner_run=np.concatenate([own.corner_run for own in data]),
        element_data=_one_after_the_other([own.element_data for own in data]),
        quick_data=quick,
        general=True if any(own.general for own in data) else None,
    )


def _one_after_the_other(blocks: Sequence[SharedBlocks]) -> SharedBlocks:
    """Return blocks with the constants of all; a start below 0 is a mark and stays."""
    sizes = np.cumsum([0, *[own.values.size for own in blocks]])
    starts = [
        np.where(own.start < 0, own.start, own.start + size)
        for own, size in zip(blocks, sizes[:-1].tolist(), strict=True)
    ]
    return SharedBlocks(
        aligned(np.concatenate([own.values for own in blocks])),
        np.concatenate(starts).astype(np.int32),
    )


def _same(first: object, second: object) -> bool:
    """Compare numbers, arrays and NamedTuples of them."""
    if type(first) is not type(second):
        return False
    if isinstance(first, tuple) and isinstance(second, tuple):
        return len(first) == len(second) and all(map(_same, first, second))
    if isinstance(first, np.ndarray) and isinstance(second, np.ndarray):
        return np.array_equal(first, second)
    return bool(first == second)
