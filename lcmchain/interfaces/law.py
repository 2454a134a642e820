"""What an interface law gives to the contact between plies, and how kernels find it.

What two plies do to each other is a sum of laws, beside the springs that keep them apart. A law is
a flat NamedTuple: parameters of every interface, arrays (interface_count, ...) [SI] that are zero
where an interface does without it. Its file says with the decorator ``implements`` how each
function of the protocol below is computed; a kernel calls the functions of the laws that a model
has, which are inlined, and nothing else in the program needs to know them. Its scene table, an
:class:`InterfaceLawTable`, makes the NamedTuple.

A law says with ``remembers()`` how many numbers every point of contact keeps for it, at most
:data:`MOST_MEMORY`, zero at first. Kernels hand them over as a tuple. It has a ``title()``, and its
``reason()`` says in a few words how strong it is, for the list of effects.

A span of points none of which is pressed or within the reach of its laws rests: nobody asks them
until one comes near. They are then asked once at the touch of the step before.

A point stands for half the area around its node: the points of both faces that meet carry half of
what acts each. Forces are those on the point; what it stands on takes the opposite.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numba.extending import overload

from lcmchain.dispatch import implements, optional, required
from lcmchain.elements.blocks import SPAN
from lcmchain.jit import INLINED, equation
from lcmchain.quantities.entry_types import SceneModel

__all__ = [
    "MOST_LAWS",
    "MOST_MEMORY",
    "NO_LAW",
    "InterfaceLawTable",
    "NoLaw",
    "Touch",
    "carried",
    "implements",
    "load_memory",
    "memory_size",
    "parameters",
    "respond",
    "store_memory",
    "uses_sliding",
]

#: Kinds of laws that all interfaces of a model may have together.
MOST_LAWS = 6


class Touch(NamedTuple):
    """A point that faces another ply, as a law sees it; vectors are tuples of three.

    gap, last_gap : between the faces now and one step before [m], negative for a depth.
    pressure : force of the spring that keeps the plies apart [N], not negative.
    stiffness : of that spring [N/m]. area : that the point stands for and that lies over the other
    ply [m²]. normal : outwards from the other ply. way : from the place on the facet to the point,
    along the facet [m]. moved : how far the point has slid in the last step [m], 0 unless a law
    uses it. time : the last step [s], 0 before the first one.
    """

    gap: float
    last_gap: float
    pressure: float
    stiffness: float
    area: float
    normal: tuple
    way: tuple
    moved: tuple
    time: float


class NoLaw(NamedTuple):
    """Stands in the places for laws that a model does not use."""

    nothing: int = 0


NO_LAW = NoLaw()


# --- compiled -------------------------------------------------------------------------------------


@optional
def parameters(law, interface):
    """Return the parameters of an interface as a tuple of numbers, taken out of lane loops."""
    return (0.0,)


@required
def respond(law, values, memory, touch):
    """Return force, tension, stored, lost, and the memory after the step.

    Parameters
    ----------
    values : what :func:`parameters` returns. memory : as after the last step.

    Returns
    -------
    force : along the facet, on the point [N].
    tension : force that draws the point to the facet [N].
    stored : energy that the law holds [J]. What it does to the point is the slope of it, but for
        what is lost.
    lost : energy that went in this step [J].
    memory : a tuple as long as the one that came.
    """


@optional
def carried(law, values, memory, before, after, kept):
    """Return the memory of a point whose facet and spring are made anew.

    Parameters
    ----------
    before, after : :class:`Touch` on the old and on the new facet, both now.
    kept : 1.0 for a point that has pressed on the same ply before, 0.0 for one that begins there
        (``before`` is then ``after``).
    """
    return memory


@optional
def uses_sliding(law):
    """Tell whether the law asks for ``Touch.moved``, which costs a further look at velocities."""
    return False


@implements(respond, NoLaw)
@equation
def _nothing(law, values, memory, touch):
    return (0.0, 0.0, 0.0), 0.0, 0.0, 0.0, memory


def memory_size(law: Any) -> int:
    """Return how many numbers per point the law remembers."""
    kind = law if isinstance(law, type) else type(law)
    return kind.remembers() if hasattr(kind, "remembers") else 0


@overload(memory_size, jit_options=INLINED)
def _choose_size(law):
    count = memory_size(law.instance_class)
    return lambda law: count


# The compiler must know the length of a tuple: one function for each count.
_LOADERS = (
    lambda law, rows, i: (),
    lambda law, rows, i: (rows[i],),
    lambda law, rows, i: (rows[i], rows[i + SPAN]),
    lambda law, rows, i: (rows[i], rows[i + SPAN], rows[i + 2 * SPAN]),
    lambda law, rows, i: (rows[i], rows[i + SPAN], rows[i + 2 * SPAN], rows[i + 3 * SPAN]),
    lambda law, rows, i: (
        rows[i], rows[i + SPAN], rows[i + 2 * SPAN], rows[i + 3 * SPAN], rows[i + 4 * SPAN],
    ),
    lambda law, rows, i: (
        rows[i], rows[i + SPAN], rows[i + 2 * SPAN], rows[i + 3 * SPAN], rows[i + 4 * SPAN],
        rows[i + 5 * SPAN],
    ),
    lambda law, rows, i: (
        rows[i], rows[i + SPAN], rows[i + 2 * SPAN], rows[i + 3 * SPAN], rows[i + 4 * SPAN],
        rows[i + 5 * SPAN], rows[i + 6 * SPAN],
    ),
)  # fmt: skip
MOST_MEMORY = len(_LOADERS) - 1


def load_memory(law: Any, rows: np.ndarray, i: int) -> tuple:
    """Return the memory at ``rows[i + k * SPAN]`` as a tuple."""
    return _LOADERS[memory_size(law)](law, rows, i)


@overload(load_memory, jit_options=INLINED)
def _choose_loader(law, rows, i):
    return _LOADERS[memory_size(law.instance_class)]


def store_memory(law: Any, memory: tuple, rows: np.ndarray, i: int) -> None:
    """Write what :func:`load_memory` reads."""
    for k, number in enumerate(memory):
        rows[i + k * SPAN] = number


def _store_nothing(law, memory, rows, i):
    pass


def _store_numbers(law, memory, rows, i):
    for k in range(len(memory)):
        rows[i + k * SPAN] = memory[k]


@overload(store_memory, jit_options=INLINED)
def _choose_storer(law, memory, rows, i):
    return _store_numbers if memory_size(law.instance_class) else _store_nothing


# --- plain Python ---------------------------------------------------------------------------------


class InterfaceLawTable(SceneModel):
    """Base of the tables that ``interfaces.laws`` holds; each has its ``type``."""

    #: Class of the law's NamedTuple.
    law: ClassVar[type]

    @classmethod
    def gathered(cls, tables: Sequence[Any]) -> Any:
        """Return the law of all interfaces from the table of each, None for one without it."""
        raise NotImplementedError

    def reach(self) -> float:
        """Return the gap up to which the law acts [m]; 0 for one that acts under pressure alone.

        Beyond it, without pressure, a law has no force and stores nothing, and what it keeps goes
        with its last touch alone: it is not asked at every step there.
        """
        return 0.0

    def stiffness(self) -> float:
        """Return the stiffness per area of springs that the law adds [Pa/m]."""
        return 0.0

    def slip_viscosity(self) -> float:
        """Return the stress by speed of what resists sliding [Pa s/m]."""
        return 0.0

    def in_words(self) -> str:
        """Say in a few words what the law does, for tables and reports."""
        raise NotImplementedError

    def conflicts(self) -> str | None:
        """Say what is wrong with the entries taken together, or None."""
        return None


# --- curves by points, of all interfaces one behind the other in one array ------------------------


@equation
def place_between(points, first, last, value):
    """Return the interval of ``points[first:last]`` that a value lies in, and how far in it."""
    k = first
    while k < last - 2 and points[k + 1] <= value:
        k += 1
    if last - first < 2:
        return first, 0.0
    part = (value - points[k]) / (points[k + 1] - points[k])
    return k, min(max(part, 0.0), 1.0)


def starts(rows: Sequence[np.ndarray]) -> np.ndarray:
    """Return where each of some arrays begins in all of them, one behind the other."""
    return np.concatenate([[0], np.cumsum([row.size for row in rows])]).astype(np.int64)


def rows_of(tables: Sequence[Any], entry: str) -> list[np.ndarray]:
    """Return an entry of each table as a flat array, empty where there is no table."""
    return [
        np.zeros(0) if table is None else np.ravel(np.asarray(getattr(table, entry), dtype=float))
        for table in tables
    ]


def increasing(values: Sequence[float]) -> bool:
    return all(b > a for a, b in zip(values, values[1:], strict=False))
