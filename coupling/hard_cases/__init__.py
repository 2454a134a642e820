"""Hard cases of the coupling; importing this room puts them on the list of all hard cases.

The core does not import what is built on it, so ``lcmchain verify hard-cases`` imports this room.
"""

from lcmchain.coupling.hard_cases import iteration  # noqa: F401  it puts its cases on the list
