"""What acts on bodies or between them, as the time loop sees it.

An interaction is a NamedTuple of constant arrays: the tools, the pressures in and on a sheet, the
supports, the grippers that pull. Compiled code takes it by reference, as it takes all arrays
(:mod:`lcmchain.compilation.references`). It registers (:mod:`lcmchain.dispatch`) its work in a
step. The compiled loop leaves out work that is not registered, and interactions that a model does
not have. Registered functions are compiled with the options of an equation. A loop over nodes with
other options, or a parallel loop, is a routine that is called there: best a standalone one
(:mod:`lcmchain.jit`), which is compiled once for all models that have it.

The order of a step is that of :func:`lcmchain.solver.loop.advance`:

1. :func:`before_nodes`: forces that need the positions of all nodes;
2. :func:`add_to_nodes`: forces on the nodes of a chunk, which move at once afterwards;
3. :func:`after_nodes`: tools and held nodes move, with the forces summed up.

In Python it registers with :func:`bound` how it limits the step.
"""

from __future__ import annotations

from functools import singledispatch
from typing import NamedTuple

from lcmchain.dispatch import optional

#: Interactions that the loop has places for: a parallel loop takes each of them by itself.
PLACES = 5


class Nothing(NamedTuple):
    """Stands where a model has no interaction."""

    nothing: int = 0


NOTHING = Nothing()


def in_places(interactions: tuple[object, ...]) -> tuple[object, ...]:
    """Return the interactions of a model for the loop, with ``NOTHING`` in the places left over."""
    left = PLACES - len(interactions)
    if left < 0:
        raise ValueError(f"the loop has places for {PLACES} interactions, not {len(interactions)}")
    return (*interactions, *[NOTHING] * left)


class Bound(NamedTuple):
    """What an interaction adds to the highest frequency.

    omega2 : [1/s²], added to the bound of the elements.
    rate : of a damping that lags half a step behind, c/m [1/s].
    cause : in words, for a step that it limits.
    """

    omega2: float
    rate: float
    cause: str


NO_BOUND = Bound(0.0, 0.0, "")


@singledispatch
def bound(interaction: object, model: object, state: object, ahead: float) -> Bound:
    """Return what an interaction adds to the highest frequency until the next look at it.

    ahead : time until that look [s].
    """
    return NO_BOUND


@optional
def begin_steps(interaction, arrays):
    """Prepare what holds for all steps until the next search."""


@optional
def before_nodes(interaction, arrays, dt_last, dt):
    """Make the forces that need the positions of all nodes; parallel loops may run here."""


@optional
def scratch_size(interaction):
    """Return how many numbers of scratch :func:`add_to_nodes` needs."""
    return 0


@optional
def add_to_nodes(interaction, arrays, environment, chunk, first, last, dt_last, dt, work, sums):
    """Add forces to ``arrays.force`` of the nodes ``first`` to ``last`` of a chunk.

    Energies go to the columns of ``sums``. The forces of those interactions that stand before this
    one are in ``arrays.force`` by then.
    """


@optional
def after_nodes(interaction, arrays, environment, dt_last, dt):
    """Move tools and held nodes: the others have moved, and the sums of the step are complete."""
