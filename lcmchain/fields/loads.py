"""Forces of tools and grippers, the parts of a tool's force, and what stopped a tool.

The force of a tool along its direction, averaged over a length of its travel, is its work over that
length. The energy balance splits the work exactly, into the parts of the sheet, friction, contact,
damping, motion (inertia), the other tools, weight and supports, and the error of the balance. A
quasi-static process has no damping and no inertia. The force is too high by their parts, as long as
they do not change the shape.

Elements that are drawn over a radius pass it unevenly, and the force goes up and down with them
(:func:`lcmchain.mesh.hexahedron.largest_ripple`). The histories show by how much around its
maximum.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from lcmchain.fields.saved import SAMPLE
from lcmchain.fields.sheet import edge_length, largest_turn, vector
from lcmchain.mesh.hexahedron import largest_ripple
from lcmchain.state import STOPPED_TIME, STOPPED_TRAVEL
from lcmchain.thresholds import LARGEST_RIPPLE

if TYPE_CHECKING:
    import xarray as xr

    from lcmchain.model import Model
    from lcmchain.state import State


# Interval over which forces are averaged to be quoted, relative to the time of the process, and
# travel over which their parts are, relative to the stroke: long enough for a single snap or wave
# to average out, whatever the interval of the histories.
WINDOW = 0.05
# Travel below which the work of a tool says nothing about its force, relative to the largest one.
LEAST_TRAVEL = 1e-3
# A mean over the travel around the maximum says something of it from this part of it on.
LEAST_OF_MAXIMUM = 0.5

#: Elements that pass a radius while the smooth course of a force is found, and places at which it
#: is compared with the force.
PASSING, PLACES = 4.0, 201
#: Lobes that a force without a ripple has beside its best parabola at most: where its third
#: derivative keeps its sign, as where a textile is compacted, both cross three times. Lobes below a
#: part of the highest one are noise.
LOBES_WITHOUT_RIPPLE, LEAST_LOBE = 4, 0.1
#: A parabola takes up to this part of a ripple with two to four periods over its reach, relative to
#: the largest distance between both, at its end.
TAKEN_UP = 0.7

#: A snap: within this part of the process the force of a tool falls by this part of its largest
#: value, and the sheet gains this part of its kinetic energy, though the tool does not speed up.
SNAP_WINDOW, SNAP_FALL, SNAP_GAIN = 0.02, 0.03, 0.05
# Part of its largest speed below which a tool comes to rest, and the sheet with it.
AT_REST = 0.01

#: Parts of the force of a tool, and the energies that they follow from, with their signs.
PARTS = {
    "sheet_N": ("internal", "hourglass", "inelastic", "viscous"),
    "friction_N": ("friction",),
    "contact_N": ("contact", "contact_damping"),
    "damping_N": ("mass_damping",),
    "inertia_N": ("kinetic",),
}


def has_histories(history: xr.Dataset) -> bool:
    """Tell whether a result has histories; one of frames alone has none."""
    return SAMPLE in history.dims


def mean_force(history: xr.Dataset) -> np.ndarray:
    """Return the magnitude of the mean force on each tool over each interval [N], (H, T)."""
    return np.linalg.norm(vector(history, "history_tool_force"), axis=-1)


def quoted_force(history: xr.Dataset) -> tuple[np.ndarray, np.ndarray]:
    """Return the mean force on each tool over ``WINDOW`` of the process before each sample [N].

    Returns
    -------
    Times of the middle of each interval (N,) [s], and magnitudes (N, T) [N]. An interval is made of
    whole samples; one that the process has not reached yet is left out.
    """
    time = np.append(0.0, history[SAMPLE].values)
    weighted = vector(history, "history_tool_force") * np.diff(time)[:, None, None]
    impulse = np.concatenate([np.zeros((1, *weighted.shape[1:])), np.cumsum(weighted, axis=0)])
    # samples lie up to half a step beside the multiples of their interval
    slack = 0.1 * float(np.diff(time).min())
    first = np.searchsorted(time, time - WINDOW * time[-1] + slack, side="right") - 1
    last = np.flatnonzero(first >= 0)
    first = first[last]
    length = time[last] - time[first]
    mean = (impulse[last] - impulse[first]) / length[:, None, None]
    return 0.5 * (time[first] + time[last]), np.linalg.norm(mean, axis=-1)


def tool_loads(history: xr.Dataset, sheet: xr.Dataset) -> dict[str, dict]:
    """Return the forces of every tool under the names of ``summary.json``.

    Parameters
    ----------
    history, sheet : groups of a result.

    Returns
    -------
    For each tool ``force_max_N``, the largest mean over an interval of ``WINDOW`` of the process,
    with ``force_max_time_s``, its middle; ``force_end_N``, the mean over the last such interval;
    ``force_peak_N`` of a single step with ``force_peak_time_s``; ``work_J`` on the sheets. For a
    tool that moves the sheets,
    ``parts_at_maximum`` and ``parts_over_stroke``: the force along its direction, averaged over the
    travel around its maximum and over all of it (up to the farthest point of a tool that comes
    back), and the parts that make it up [N]. A tool that
    bears its maximum standing, such as one that force presses against a stop, does no work there
    and has no ``parts_at_maximum``; else ``force_ripple_N`` says by how much the force goes up and
    down there while an element passes a radius, and ``force_uncertainty_N`` how well it is known.
    A tool that turns has ``angle_end_rad``, ``moment_max_Nm``, the largest mean moment of a
    sample, and ``moment_end_Nm``.
    ``force_quoted_N`` is the figure to quote, ``force_quoted_uncertainty_N`` how well that is known
    (:func:`figure_to_quote`). ``snaps`` (:func:`snaps`) are there where there are any.
    """
    time = history[SAMPLE].values
    middle, force = quoted_force(history)
    peak, peak_time = (history[f"history_tool_peak_{name}"].values for name in ("force", "time"))
    work = history["history_tool_work"].values
    travel = history["history_tool_travel"].values
    reach = np.abs(travel).max(initial=0.0)
    edge = edge_length(sheet)
    loads: dict[str, dict] = {}
    for tool, name in enumerate(str(name) for name in history["tool"].values):
        top, highest = int(np.argmax(force[:, tool])), int(np.argmax(peak[:, tool]))
        loads[name] = {
            "force_max_N": float(force[top, tool]),
            "force_max_time_s": float(middle[top]),
            "force_quoted_N": float(force[top, tool]),
            "force_end_N": float(force[-1, tool]),
            "force_peak_N": float(peak[highest, tool]),
            "force_peak_time_s": float(peak_time[highest, tool]),
            "work_J": float(work[-1, tool]),
        }
        loads[name] |= _turn_loads(history, tool)
        if np.ptp(travel[:, tool], axis=0) > LEAST_TRAVEL * reach and work[-1, tool] > 0.0:
            first, last = _around(travel[:, tool], int(np.searchsorted(time, middle[top])))
            parts = force_parts(history, tool, first, last)
            if abs(parts["force_N"]) >= LEAST_OF_MAXIMUM * force[top, tool]:
                loads[name]["parts_at_maximum"] = parts
                way = np.interp(middle, time, travel[:, tool])
                smooth = smooth_force(way, force[:, tool], top, edge)
                ripple, largest = 0.0, float(force[top, tool])
                quoted, left = largest, 0.0
                if smooth is not None:
                    frame = int(np.abs(sheet["time"].values - middle[top]).argmin())
                    bound = largest_ripple(largest_turn(sheet, frame)) * largest
                    ripple = min(smooth.distance, bound)
                    loads[name] |= {"force_smooth_N": smooth.force, "force_ripple_N": ripple}
                    quoted, left = figure_to_quote(largest, smooth, ripple)
                loads[name] |= {
                    "force_uncertainty_N": force_uncertainty(parts, ripple),
                    "force_quoted_N": quoted,
                    "force_quoted_uncertainty_N": force_uncertainty(parts, left),
                }
            last = _end_of_stroke(travel[:, tool], work[:, tool])
            loads[name]["parts_over_stroke"] = force_parts(history, tool, -1, last)
            if of_tool := snaps(history, tool):
                loads[name]["snaps"] = of_tool
    return loads


def _turn_loads(history: xr.Dataset, tool: int) -> dict[str, float]:
    """Return angle [rad] and moments [N m] of a tool that turns; nothing of any other one."""
    if "history_tool_angle" not in history:
        return {}
    angle = history["history_tool_angle"].values[:, tool]
    if not angle.any():
        return {}
    moment = history["history_tool_moment"].values[:, tool]
    return {
        "angle_end_rad": float(angle[-1]),
        "moment_max_Nm": float(moment[np.argmax(np.abs(moment))]),
        "moment_end_Nm": float(moment[-1]),
    }


def force_parts(history: xr.Dataset, tool: int, first: int, last: int) -> dict[str, float]:
    """Return the force of a tool along its direction and its parts [N], between two samples.

    ``hourglass_N`` is a part of ``sheet_N``; the others make up the force.

    Parameters
    ----------
    first, last : samples at the ends of the piece of the stroke; ``first`` = -1 is the start.
    """

    def gain(values: np.ndarray) -> float:
        return float(values[last] - (values[first] if first >= 0 else 0.0))

    energy = {
        str(name).removeprefix("history_energy_"): gain(values.values)
        for name, values in history.data_vars.items()
        if str(name).startswith("history_energy_")
    }
    energy["contact_damping"] = energy["damping"] - energy["mass_damping"]
    work = gain(history["history_tool_work"].values[:, tool])
    travel = gain(history["history_tool_travel"].values[:, tool])
    parts = {
        part: sum(energy.get(name, 0.0) for name in names) / travel for part, names in PARTS.items()
    }
    return {
        "force_N": work / travel,
        **parts,
        "hourglass_N": energy.get("hourglass", 0.0) / travel,
        "others_N": (work - energy["external"]) / travel,
        "balance_error_N": -energy["balance_error"] / travel,
    }


def force_uncertainty(parts: Mapping[str, float], ripple: float) -> float:
    """Return by how much a force may be off [N], by what the run itself knows.

    A slower process has neither inertia nor damping: what they take of the force is the error of
    its pace. Signs are left out, since each of them changes the shape as well. Finer elements need
    no hourglass terms and pass without a ripple: both tell of the same mesh, and the larger one
    counts. What one run cannot know, such as how the fabric folds on another mesh, is not in it.

    Parameters
    ----------
    parts : of the force around its maximum, see :func:`force_parts`.
    ripple : of the force there, see :func:`force_ripple` [N].
    """
    pace = abs(parts["inertia_N"]) + abs(parts["damping_N"])
    return pace + max(abs(parts["hourglass_N"]), ripple)


class SmoothCourse(NamedTuple):
    """The course of a force without what elements that pass a radius make of it.

    Parameters
    ----------
    force : of the course at the maximum of the force [N].
    distance : the largest one between force and course [N].
    lobes : stretches of the travel on which the force lies above or below the course in turn.
    """

    force: float
    distance: float
    lobes: int


def figure_to_quote(largest: float, course: SmoothCourse, ripple: float) -> tuple[float, float]:
    """Return the force to quote and what the ripple of the mesh leaves of doubt about it [N].

    The figure is the largest mean as long as the ripple is small. Beyond half of ``LARGEST_RIPPLE``
    the largest mean is that of a crest, whose place and height depend on the mesh. Then the figure
    is the smooth course there, on which meshes agree (``lcmchain docs time-integration``). No more
    than the ripple is taken off, and nothing where the force does not go to and fro: a force that
    only rises ever faster, or snaps once, has no ripple.

    Parameters
    ----------
    largest : mean force [N]. course : around it. ripple : in it, by its bound [N].

    Examples
    --------
    The hemisphere of half size on elements as long as its fillet; 2.5 mm ones lead to 13.8 N:

    >>> force, left = figure_to_quote(14.65, SmoothCourse(13.46, 1.64, 5), 1.64)
    >>> f"{force:.2f} +- {left:.2f} N"
    '13.46 +- 1.15 N'
    """
    if course.lobes <= LOBES_WITHOUT_RIPPLE or ripple <= 0.5 * LARGEST_RIPPLE * largest:
        return largest, ripple
    return largest - float(np.clip(largest - course.force, -ripple, ripple)), TAKEN_UP * ripple


def smooth_force(way: np.ndarray, force: np.ndarray, top: int, edge: float) -> SmoothCourse | None:
    """Return the smooth course of a force around its maximum.

    The course is a parabola over the travel, fitted where ``PASSING`` elements pass: a ripple of
    one element is hardly a part of it. The ripple is the largest distance from it. Where the sheet
    is held back it passes more slowly than the tool moves, and the ripple is longer. None of a tool
    that goes less far, or turns.

    Parameters
    ----------
    way : travel of the tool (N,) [m], at the times of its ``force`` (N,) [N].
    top : sample of the maximum. edge : length of the elements [m].
    """
    way = np.abs(way - way[top])
    before, after = way[: top + 1][::-1], way[top:]
    behind, ahead = (part[: _one_way(part)] for part in (before, after))
    reach = PASSING * edge
    # half of the reach on either side, more of it behind where the stroke ends
    last = min(ahead[-1], 0.5 * reach)
    first = last - reach
    if behind[-1] < -first:
        return None
    places = np.append(-behind[:0:-1], ahead)
    forces = force[top - len(behind) + 1 : top + len(ahead)]
    x = np.linspace(first, last, PLACES)
    sampled = np.interp(x, places, forces)
    course = np.polynomial.Polynomial.fit(x, sampled, 2)
    beside = sampled - course(x)
    distance = float(np.abs(beside).max())
    sides = np.sign(beside)[np.abs(beside) > LEAST_LOBE * distance]
    lobes = 1 + int(np.count_nonzero(np.diff(sides))) if sides.size else 0
    return SmoothCourse(float(course(0.0)), distance, lobes)


def snaps(history: xr.Dataset, tool: int) -> list[dict[str, float]]:
    """Return where the sheet snaps under a tool: it gives off what it had stored.

    Vibrations and elements that pass a radius move a force to and fro as well. A snap is told from
    them by the motion: the force falls while the sheet becomes faster and its tool does not. In a
    process that goes on evenly kinetic energy follows the speed of the tool.

    Returns
    -------
    For each snap ``time_s`` and ``travel_m`` at which the force begins to fall, and by how much it
    does, ``force_drop_N``; none where samples are farther apart than ``SNAP_WINDOW`` of the
    process.
    """
    time = np.append(0.0, history[SAMPLE].values)
    window = SNAP_WINDOW * time[-1] * (1.0 + 1e-3)
    if np.diff(time).max() > window:
        return []
    force = np.append(0.0, mean_force(history)[:, tool])
    travel = np.append(0.0, np.abs(history["history_tool_travel"].values[:, tool]))
    kinetic = np.append(0.0, history["history_energy_kinetic"].values)
    speed = np.append(0.0, np.diff(travel) / np.diff(time))
    first = np.searchsorted(time, time - window)  # the sample at the start of the window
    events: list[dict[str, float]] = []
    last_seen = -np.inf
    for sample in range(1, len(time)):
        before = slice(int(first[sample]), sample)
        start, slowest = (
            before.start + int(place)
            for place in (np.argmax(force[before]), np.argmin(kinetic[before]))
        )
        drop = float(force[start] - force[sample])
        if drop < SNAP_FALL * force.max() or speed[sample] < AT_REST * speed.max():
            continue
        if speed[slowest] == 0.0:
            continue  # a tool that sets out makes the sheet as much faster as it likes
        faster = max(speed[sample] / speed[slowest], 1.0) ** 2
        if kinetic[sample] < (1.0 + SNAP_GAIN) * faster * kinetic[slowest]:
            continue
        if time[start] > last_seen:  # else the same one goes on
            events.append(
                {
                    "time_s": float(time[start]),
                    "travel_m": float(travel[start]),
                    "force_drop_N": drop,
                }
            )
        events[-1]["force_drop_N"] = max(events[-1]["force_drop_N"], drop)
        last_seen = time[sample]
    return events


def snaps_text(snaps: Sequence[Mapping[str, float]]) -> str:
    """Say where a force falls, and by how much; of many snaps the first three."""
    places = [f"{1e3 * s['travel_m']:.3g} mm by {s['force_drop_N']:.2g} N" for s in snaps[:3]]
    more = f" and {len(snaps) - 3} more" if len(snaps) > 3 else ""
    return f"its force falls at a travel of {', '.join(places)}{more}"


def _one_way(distance: np.ndarray) -> int:
    """Return how many samples a tool takes to go one way, from the first on."""
    return int(np.argmin(np.append(np.diff(distance) >= 0.0, False))) + 1


def _around(travel: np.ndarray, sample: int) -> tuple[int, int]:
    """Return the samples at the ends of the travel of ``WINDOW`` of the stroke around a sample.

    It ends where the tool has come to rest for good: what other tools do then is not its work.
    """
    reach = 0.5 * WINDOW * float(np.ptp(np.append(travel, 0.0)))
    far = np.abs(travel - travel[sample]) >= reach
    before, after = np.flatnonzero(far[:sample]), np.flatnonzero(far[sample:])
    first = int(before[-1]) if before.size else -1
    moving = np.flatnonzero(travel != travel[-1])
    rest = max(int(moving[-1]) + 1 if moving.size else 0, sample)
    last = sample + int(after[0]) if after.size else rest
    start = float(travel[first]) if first >= 0 else 0.0
    ends = np.array([start, travel[last]]) - travel[sample]
    if ends[0] * ends[1] > 0.0 and np.abs(ends).min() >= reach:
        # The tool turns on this piece, and nothing is left of its travel: one of the ways counts.
        turn = first + 1 + int(np.argmax(np.abs(travel[first + 1 : last + 1] - start)))
        return (first, turn) if sample <= turn else (turn, last)
    return first, last


def _end_of_stroke(travel: np.ndarray, work: np.ndarray) -> int:
    """Return the sample at which the stroke of a tool ends: the farthest one where it comes back.

    What the way back gives off is not the force of the stroke, and the travel between the ends of
    both would tend to zero. A tool may open farther than it has closed: of the farthest places on
    either side of its start the stroke ends at that to which it has done more work.
    """
    far = travel * np.sign(travel[np.argmax(np.abs(travel))])
    opened = far.min() < -LEAST_TRAVEL * far.max()
    if opened and work[np.argmin(far)] > work[np.argmax(far)]:
        far = -far
    back = far[-1] < (1.0 - WINDOW) * far.max()
    return int(np.argmax(far)) if back else len(travel) - 1


def kinetic_to_internal(
    history: xr.Dataset, idle: float = 0.0, touched_part: float = 0.0
) -> np.ndarray:
    """Return the kinetic over the internal energy, hourglass included, of every sample, (H,).

    It is 0 where the sheet is not strained: its internal energy is at most ``idle`` [J]. Below
    ``touched_part`` of the largest internal energy it is relative to that part.
    """
    internal = (
        history["history_energy_internal"].values + history["history_energy_hourglass"].values
    )
    kinetic = history["history_energy_kinetic"].values
    strained = internal > idle
    internal = np.maximum(internal, touched_part * internal.max(initial=0.0))
    return np.divide(kinetic, internal, out=np.zeros_like(kinetic), where=strained)


def exceeded_over(
    history: xr.Dataset,
    tool: int | None,
    part: float,
    idle: float = 0.0,
    touched_part: float = 0.0,
) -> float:
    """Return the ratio of kinetic to internal energy that a part of the stroke exceeds.

    Parameters
    ----------
    tool : whose travel is the stroke; None, or one that does not move, takes the time.
    part : of the stroke, 0 to 1.
    idle, touched_part : as for :func:`kinetic_to_internal`.
    """
    progress = np.abs(np.diff(history["history_tool_travel"].values, axis=0, prepend=0.0))
    steps = progress[:, tool] if tool is not None else np.zeros(0)
    if not steps.any():
        steps = np.diff(history[SAMPLE].values, prepend=0.0)
    ratio = kinetic_to_internal(history, idle, touched_part)
    order = np.argsort(-ratio, kind="stable")
    gone = np.cumsum(steps[order])
    return float(ratio[order][np.searchsorted(gone, part * gone[-1], side="right")])


# --- grippers -------------------------------------------------------------------------------------


def gripper_loads(history: xr.Dataset) -> dict[str, dict[str, float]]:
    """Return the forces of every gripper under the names of ``summary.json``.

    Returns
    -------
    For each gripper ``force_max_N``, the largest mean over an interval of the histories, with
    ``force_max_time_s``, its end; ``force_end_N``, that of the last interval; ``travel_end_m``, how
    far its place has moved; and ``let_go_s``, when it let go, where it did.
    """
    if "gripper" not in history:
        return {}
    time = history[SAMPLE].values
    force = np.linalg.norm(vector(history, "history_gripper_force"), axis=-1)
    travel = np.linalg.norm(vector(history, "history_gripper_travel"), axis=-1)
    let_go = history["gripper_let_go"].values
    loads: dict[str, dict[str, float]] = {}
    for number, name in enumerate(str(name) for name in history["gripper"].values):
        top = int(np.argmax(force[:, number]))
        loads[name] = {
            "force_max_N": float(force[top, number]),
            "force_max_time_s": float(time[top]),
            "force_end_N": float(force[-1, number]),
            "travel_end_m": float(travel[-1, number]),
        }
        if np.isfinite(let_go[number]):
            loads[name]["let_go_s"] = float(let_go[number])
    return loads


# --- stops and forces that end a stroke -----------------------------------------------------------


def tool_stops(model: Model, state: State) -> dict[str, Any]:
    """Return what ``summary.json`` says of tools that were stopped; nothing where none was.

    Returns
    -------
    ``tool_stops``: by the name of the tool a list, in which each entry has ``time_s`` and
    ``travel_m``, when and where it was stopped first, and in a process with stages the ``stage``.
    """
    stops: dict[str, list[dict[str, Any]]] = {}
    for tool, name in enumerate(model.tool_names):
        for number, stopped in enumerate(state.tool_stopped[tool]):
            if np.isfinite(stopped[STOPPED_TIME]):
                entry: dict[str, Any] = {"stage": model.stages[number].name} if model.stages else {}
                entry["time_s"] = float(stopped[STOPPED_TIME])
                entry["travel_m"] = float(stopped[STOPPED_TRAVEL])
                stops.setdefault(name, []).append(entry)
    return {"tool_stops": stops} if stops else {}
