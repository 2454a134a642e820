"""The step of a sheet as C, free or between tools, from the equations of the program.

Two loops make a step. In the first, every element writes the forces on its corners, and every node
of the mid-surface what its fibres send each other in bending. In the second every node sums up what
it is sent, in the order of its slots, is pressed by the tools that it touches, and moves. Nothing
else is shared, so that each place of a loop may be one thread.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from record import Number, Recorder, Rows, as_python, choose, spelled

from lcmchain import packs
from lcmchain.effects.fibre_bending import bend
from lcmchain.elements.blocks import LANES
from lcmchain.elements.solid_shell.kernel import SolidShellData, element_in_lane
from lcmchain.materials.features.elementary import exponential, logarithm
from lcmchain.materials.law import Step, history_count
from lcmchain.solver.interactions.contact_forces import PackOfNodes, press, rub
from lcmchain.tools.distance import FIELD, PLANE, REVOLVED, local_axis_at, origin_at
from lcmchain.tools.pack_distance import profile_distances
from lcmchain.tools.table import ToolTable

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


def distance_lines(tools: ToolTable, tool: int) -> list[str]:
    """Return the statements of the distance of a node from a tool with a profile.

    ``p[3]`` is the position of the node, ``travel`` that of the tool; ``gap`` and ``n[3]``, the
    normal, are written.
    """
    if tools.turn_axis is not None or tools.kind[tool] == FIELD:
        raise TypeError("tools that turn or come from files are not written down here")
    recorder = Recorder("double")
    position, travel = vector(recorder, "p[{}]"), recorder.number("travel")
    origin = as_python(origin_at)(None, tools, tool, travel)
    local = tuple(x - x0 for x, x0 in zip(position, origin, strict=True))
    axes = [as_python(local_axis_at)(None, tools, tool, travel, k) for k in range(3)]
    local = tuple(sum(c * x for c, x in zip(axis, local, strict=True)) for axis in axes)
    gap: Any = local[2]
    normal: Any = (0.0, 0.0, 1.0)
    if tools.kind[tool] != PLANE:
        revolved = tools.kind[tool] == REVOLVED
        recorded = as_python(profile_distances, {packs.choose: choose})
        gap, normal = recorded(tools, tool, revolved, local)
    turned = [sum(n * axis[k] for n, axis in zip(normal, axes, strict=True)) for k in range(3)]
    written = [f"n[{k}] = {spelled(value, 'double')};" for k, value in enumerate(turned)]
    return [*recorder.lines, f"*gap = {spelled(gap, 'double')};", *written]


def nodes_of(recorder: Recorder) -> PackOfNodes:
    """Return what contact asks of a node, which C has in ``node[5]``."""
    inverse_mass, weight, stiffness, tangential, damping = (
        recorder.number(f"node[{k}]") for k in range(5)
    )
    return PackOfNodes(None, inverse_mass, weight, stiffness, tangential, damping)


def vector(recorder: Recorder, form: str) -> tuple[Number, Number, Number]:
    """Return three numbers that C has in an array."""
    return tuple(recorder.number(form.format(k)) for k in range(3))  # type: ignore[return-value]


def press_lines() -> list[str]:
    """Return the statements of the pressure on a node.

    From ``node``, ``gap``, ``n``, ``v``, the velocity against the tool, and ``others``, all other
    forces.
    """
    recorder = Recorder("double")
    nodes, gap, dt = nodes_of(recorder), recorder.number("gap"), recorder.number("dt")
    normal, velocity = vector(recorder, "n[{}]"), vector(recorder, "v[{}]")
    others = vector(recorder, "others[{}]")
    recorded = as_python(press, {packs.choose: choose})
    pressure = recorded(nodes, normal, gap, normal, velocity, others, dt, dt)[0]
    return [*recorder.lines, f"return {pressure.name};"]


def rub_lines() -> list[str]:
    """Return the statements of the friction of a node: ``stick`` goes on, ``drag`` is written."""
    recorder = Recorder("double")
    nodes, gap, dt = nodes_of(recorder), recorder.number("gap"), recorder.number("dt")
    normal, velocity = vector(recorder, "n[{}]"), vector(recorder, "v[{}]")
    before, limit = vector(recorder, "stick[{}]"), recorder.number("limit")
    recorded = as_python(rub, {packs.choose: choose})
    drag, stick, _, _ = recorded(nodes, limit, before, gap, normal, velocity, dt)
    written = [f"drag[{k}] = {value.name};" for k, value in enumerate(drag)]
    return recorder.lines + written + [f"stick[{k}] = {v.name};" for k, v in enumerate(stick)]


def contact(tools: ToolTable) -> str:
    """Return the functions of C for the contact with tools, and their constants."""
    count = tools.kind.size
    distance = "INLINE void distance_{}(const double* p, double travel, double* gap, double* n)"
    chosen = [f"if (tool == {k}) distance_{k}(p, travel, gap, n);" for k in range(count)]
    state = "const double* node, double gap, const double* n, const double* v"
    return "\n".join(
        [
            f"#define TOOLS {count}",
            table_of("FRICTION", tools.friction),
            table_of("OVERLAP", tools.initial_overlap),
            table_of("DIRECTION", tools.direction.ravel()),
            *(function(distance.format(k), distance_lines(tools, k)) for k in range(count)),
            function(distance.format("of_tool").replace("(", "(int tool, ", 1), chosen),
            function(
                f"INLINE double press({state}, const double* others, double dt)", press_lines()
            ),
            function(
                f"INLINE void rub({state}, double limit, double dt, double* stick, double* drag)",
                rub_lines(),
            ),
        ]
    )


def table_of(name: str, values: np.ndarray) -> str:
    """Return a table of numbers of C."""
    return f"TABLE double {name}[] = {{{', '.join(repr(float(value)) for value in values)}}};"


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
