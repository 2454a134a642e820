"""The step of a free sheet as C, from the equations of the program.

Two loops make a step. In the first, every element writes the forces on its corners, and every node
of the mid-surface what its fibres send each other in bending. In the second every node sums up what
it is sent, in the order of its slots, and moves. Nothing else is shared, so that each place of a
loop may be one thread.
"""

from __future__ import annotations

from typing import Any

from record import Recorder, Rows, as_python

from lcmchain import packs
from lcmchain.effects.fibre_bending import AREA_ROW, bend
from lcmchain.elements.blocks import LANES
from lcmchain.elements.solid_shell.kernel import SolidShellData, element_in_lane
from lcmchain.materials.features.elementary import exponential, logarithm
from lcmchain.materials.law import Step, history_count

#: Functions that C has itself.
OF_C = {exponential: lambda x: x.of("exp({})"), logarithm: lambda x: x.of("log({})")}


def operation_count(lines: list[str]) -> int:
    """Return how many operations of floating point a list of statements has."""
    signs = (" + ", " - ", " * ", " / ", "sqrt(", "= -")
    return sum(line.count(sign) for line in lines for sign in signs)


def element_lines(law: Any, options: Any) -> list[str]:
    """Return the statements of one element: forces on its corners from their positions.

    ``X(row)`` holds the positions, row 3 corner + direction, and takes the forces; ``data`` and
    ``shared`` begin at the lane of the element.
    """
    if history_count(law):
        raise TypeError("a law with a memory is not written down here")
    recorder = Recorder()
    corner = Rows(recorder, "X({})", LANES)
    data = Rows(recorder, f"data[{{}} * {LANES}]", LANES)
    shared = Rows(recorder, f"shared[{{}} * {LANES}]", LANES)
    as_python(element_in_lane, OF_C)(0, corner, data, law, shared, shared, options, Step(0.0, 0.0))
    return recorder.lines + corner.stores("X({}) = {};")


def bending_lines() -> list[str]:
    """Return the statements of one node of the mid-surface: what it sends along its fibres.

    ``p[5][3]`` holds its position and those of its neighbours, ``constants`` begins at its lane;
    ``sent[12]`` is written.
    """
    recorder = Recorder()

    def load(values: Any, place: int) -> Any:
        return recorder.number(f"constants[{place}]")

    points = [
        tuple(recorder.number(f"p[{k}][{direction}]") for direction in range(3)) for k in range(5)
    ]
    sent = as_python(bend, {packs.load: load})(None, 0, *points)
    numbers = [number for vector in sent for number in vector]
    return recorder.lines + [f"sent[{k}] = {value.name};" for k, value in enumerate(numbers)]


def function(head: str, lines: list[str]) -> str:
    """Return a function of C."""
    return f"{head} {{\n" + "".join(f"    {line}\n" for line in lines) + "}\n"


def equations(body: SolidShellData) -> str:
    """Return the functions of C for the elements of a body, and for its fibres' bending."""
    head = "INLINE void {}(real* x, const real* data, const real* shared)"
    quick = body.options if body.quick_options is None else body.quick_options
    bending = "INLINE void bending(const real (*p)[3], const real* constants, real* sent)"
    return "\n".join(
        [
            function(head.format("quick_element"), element_lines(body.law, quick)),
            function(head.format("general_element"), element_lines(body.law, body.options)),
            function(bending, bending_lines()),
        ]
    )


#: Rows of constants of the fibres' bending that :func:`bending_lines` reads.
assert AREA_ROW == 8
