"""Which value reference means which value of a unit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lcmchain.fmu.variables import Kind, Variable


class Layout:
    """Where the values of variables lie in one flat array, and which reference means which.

    With ``arrays`` (FMI 3) a variable has one value reference, its place in the definition; without
    (FMI 2) every scalar has one, which is its slot.

    Parameters
    ----------
    variables : the definition. arrays : whether fields have one reference.
    """

    def __init__(self, variables: Sequence[Variable], *, arrays: bool) -> None:
        self.variables, self.arrays = tuple(variables), arrays
        counts = np.array([variable.count for variable in self.variables], dtype=np.int64)
        self.first = np.concatenate([[0], np.cumsum(counts)])
        self.slot_count = int(self.first[-1])
        self.slots = {
            variable.name: slice(int(self.first[i]), int(self.first[i + 1]))
            for i, variable in enumerate(self.variables)
        }
        self.of_slot = np.repeat(np.arange(len(self.variables)), counts)
        kinds = [list(Kind).index(variable.kind) for variable in self.variables]
        self._kind_of_variable = np.array(kinds, dtype=np.int8)
        if arrays:
            self._kind = self._kind_of_variable
        else:
            self._kind = self._kind_of_variable[self.of_slot]
        self._all = list(range(self._kind.size))

    def locate(self, references: Sequence[int], kind: Kind) -> slice | np.ndarray:
        """Return the slots of references, a slice where they follow each other.

        Raises
        ------
        KeyError : a reference that no variable of this kind has; its argument is the reference.
        """
        references = list(references)
        if not references:
            return slice(0, 0)
        first, last = references[0], references[-1]
        if 0 <= first <= last < self._kind.size and references == self._all[first : last + 1]:
            fits = self._kind[first : last + 1] == list(Kind).index(kind)
            if not fits.all():
                raise KeyError(references[int(np.flatnonzero(~fits)[0])])
            if self.arrays:
                return slice(int(self.first[first]), int(self.first[last + 1]))
            return slice(first, last + 1)
        code = list(Kind).index(kind)
        for reference in references:
            if not 0 <= reference < self._kind.size or self._kind[reference] != code:
                raise KeyError(reference)
        if not self.arrays:
            return np.array(references)
        ranges = [np.arange(self.first[one], self.first[one + 1]) for one in references]
        return np.concatenate(ranges)

    def touched(self, slots: slice | np.ndarray) -> list[Variable]:
        """Return the variables that slots belong to."""
        of_slot = self.of_slot[slots]
        if of_slot.size == 0:
            return []
        if isinstance(slots, slice):
            return list(self.variables[of_slot[0] : of_slot[-1] + 1])
        return [self.variables[index] for index in np.unique(of_slot)]
