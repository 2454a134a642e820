"""The most important numbers of a result, in words, and the loads of its tools as a table.

The terminal and the report say them alike.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from lcmchain.judgements.quasi_static import motion_in_force
from lcmchain.quantities.readable import duration_text, milliseconds_text, percent
from lcmchain.report.chapters import rest_in_words
from lcmchain.thresholds import LARGEST_RIPPLE, balance_scale


class Number(NamedTuple):
    """A quantity of a result: its name, its value in words, and what it is."""

    name: str
    value: str
    meaning: str = ""

    @property
    def in_words(self) -> str:
        """Value and meaning in one line."""
        joint = " " if self.meaning.startswith(("of ", "on ")) else "; "
        return f"{self.value}{joint}{self.meaning}" if self.meaning else self.value


def key_numbers(summary: Mapping[str, Any]) -> list[Number]:
    """Return the most important numbers of a ``summary.json``, as far as it has them."""
    return [
        *_stack(summary),
        *_shape(summary),
        *_grippers(summary),
        *_springback(summary),
        *_time(summary),
        *_energies(summary),
        *_cost(summary),
    ]


def ply_numbers(summary: Mapping[str, Any]) -> list[Number]:
    """Return one row for every ply of a stack, the lowest first; none for one sheet."""
    rows, films = [], summary.get("stack", {}).get("films", ())
    for name, ply in summary.get("plies", {}).items():
        parts = []
        if "thickness_min_m" in ply:
            low, high = 1e3 * ply["thickness_min_m"], 1e3 * ply["thickness_max_m"]
            parts.append(f"{low:.3f} to {high:.3f} mm thick")
        if "fibre_volume_fraction_max" in ply:
            fraction = ply["fibre_volume_fraction_max"]
            parts.append(f"fibre volume fraction up to {fraction:.3f}")
        if "fibre_strain_max" in ply:
            parts.append(f"fibres strained by up to {percent(ply['fibre_strain_max'])}")
        if "wrinkle_height_max_m" in ply:
            parts.append(f"wrinkles up to {1e3 * ply['wrinkle_height_max_m']:.2f} mm")
        if "wrinkle_risk_max" in ply:
            risk = _risky_part(ply["wrinkle_risk_part"])
            parts.append(f"wrinkle risk up to {ply['wrinkle_risk_max']:.2f}, {risk}")
        if "slip_path_max_m" in ply:
            parts.append(f"slid on others by {_slip(ply)}")
        value = "film" if name in films else "without fibres"
        if "shear_angle_max_rad" in ply:
            angle = math.degrees(ply["shear_angle_max_rad"])
            value = f"sheared by up to {angle:.1f} deg"
        rows.append(Number(f"Ply {name}", value, ", ".join(parts)))
    return rows


def _stack(summary: Mapping[str, Any]) -> Iterator[Number]:
    stack = summary.get("stack", {})
    if "thickness_min_m" in stack:
        low, high = 1e3 * stack["thickness_min_m"], 1e3 * stack["thickness_max_m"]
        meaning = f"of up to {stack['ply_count']} plies that lie over each other"
        if stack.get("films"):
            meaning += f", without the films {' and '.join(stack['films'])}"
        yield Number("Thickness of the stack", f"{low:.3f} to {high:.3f} mm", meaning)
    if "fibre_volume_fraction_max" in stack:
        fraction = stack["fibre_volume_fraction_max"]
        yield Number("Fibre volume fraction of the stack", f"up to {fraction:.3f}", "of all fibres")
    if "slip_path_max_m" in stack:
        meaning = (
            f"pressure up to {1e-3 * stack['ply_pressure_max_Pa']:.3g} kPa, "
            f"{percent(stack['sliding_part'])} of what touches slides in the last step"
        )
        yield Number("Slip between plies", _slip(stack), meaning)


def _slip(measures: Mapping[str, Any]) -> str:
    slip, path = 1e3 * measures["slip_max_m"], 1e3 * measures["slip_path_max_m"]
    return f"up to {slip:.2f} mm (to and fro {path:.2f} mm)"


def _shape(summary: Mapping[str, Any]) -> Iterator[Number]:
    if "shear_angle_max_rad" in summary:
        angle = math.degrees(summary["shear_angle_max_rad"])
        yield Number("Shear angle", f"up to {angle:.1f} deg", "magnitude, in the last frame")
    if "thickness_min_m" in summary:
        low, high = 1e3 * summary["thickness_min_m"], 1e3 * summary["thickness_max_m"]
        name = "Thickness of a ply" if "plies" in summary else "Thickness"
        yield Number(name, f"{low:.3f} to {high:.3f} mm", "in the last frame")
    if "fibre_volume_fraction_max" in summary:
        fraction = summary["fibre_volume_fraction_max"]
        yield Number("Fibre volume fraction", f"up to {fraction:.3f}", "in the last frame")
    if "fibre_strain_max" in summary:
        strain = summary["fibre_strain_max"]
        yield Number("Fibre strain", f"up to {percent(strain)}", "magnitude, of all families")
    if "wrinkle_risk_max" in summary:
        value = f"up to {summary['wrinkle_risk_max']:.2f}"
        part = _risky_part(summary["wrinkle_risk_part"])
        yield Number("Wrinkle risk", value, f"in the last frame, {part}")
    if "punch_force_max_N" in summary:
        value = f"{_quoted_force(summary):.4g} N{_uncertainty(summary)}"
        yield Number("Force of the punch", value, "".join(_punch_force(summary)))


def _risky_part(part: float) -> str:
    """Say in how much of the area wrinkles are to be expected."""
    if part == 0.0:
        return "nowhere 1, from which on wrinkles are to be expected"
    return f"1 or more in {percent(part)} of the area, where wrinkles are to be expected"


def _grippers(summary: Mapping[str, Any]) -> Iterator[Number]:
    loads = summary.get("gripper_loads", {})
    if loads:
        name, load = max(loads.items(), key=lambda item: item[1]["force_max_N"])
        told = f"{name}, at {1e3 * load['force_max_time_s']:.3g} ms"
        gone = [other for other, of_it in loads.items() if "let_go_s" in of_it]
        if gone:
            told += f"; let go: {', '.join(gone)}"
        yield Number("Largest force of a gripper", f"{load['force_max_N']:.4g} N", told)


def _springback(summary: Mapping[str, Any]) -> Iterator[Number]:
    """Yield the springback, and whether the sheet has come to rest."""
    resting = [stage for stage in summary.get("stages", ()) if "rest" in stage]
    if "springback_max_m" in summary and resting:
        largest, mean = (1e3 * summary[f"springback_{what}_m"] for what in ("max", "mean"))
        told = f"{mean:.3g} mm in the mean; rest {rest_in_words(resting[-1])}"
        yield Number("Springback", f"up to {largest:.3g} mm", told)


def _quoted_force(summary: Mapping[str, Any]) -> float:
    """Return the force of the punch to quote [N]: its largest mean, or its smooth course there."""
    return summary.get("punch_force_quoted_N", summary["punch_force_max_N"])


def _uncertainty(summary: Mapping[str, Any]) -> str:
    """Return the uncertainty of the quoted force of the punch, where the run knows it."""
    loads = summary.get("tool_loads", {}).get(summary.get("punch", ""), {})
    of_largest = loads.get("force_uncertainty_N")  # older summaries have no other
    uncertainty = loads.get("force_quoted_uncertainty_N", of_largest)
    if uncertainty is None or motion_in_force(loads["parts_at_maximum"]):
        return ""
    return f" ± {uncertainty:.1g} N"


def _punch_force(summary: Mapping[str, Any]) -> Iterator[str]:
    """Yield what the quoted force is, its peak, and its parts of inertia and damping."""
    largest = summary["punch_force_max_N"]
    is_course = _quoted_force(summary) != largest
    if is_course:
        yield "smooth course where it is largest"
    else:
        yield "largest mean over a twentieth of the process"
    if "punch" in summary:
        yield f", tool {summary['punch']}"
    yield ": the figure to quote"
    if "tool_loads" not in summary:
        return
    if is_course:
        ripple = summary["tool_loads"][summary["punch"]]["force_ripple_N"]
        yield f"; elements that pass a radius move it by {ripple:.2g} N, so that its largest mean"
        yield f" over a twentieth of the process, {largest:.4g} N, is that of the mesh"
    yield f"; {summary['punch_force_peak_N']:.4g} N in a single step"
    loads = summary["tool_loads"][summary["punch"]]
    parts = loads.get("parts_at_maximum")
    if parts is not None:
        if swings := motion_in_force(parts):
            yield f"; {swings}"
            return
        yield f"; around it damping takes {parts['damping_N'] + 0.0:.3g} N"
        yield f" and inertia {parts['inertia_N'] + 0.0:.3g} N of {parts['force_N']:.4g} N"
        if "hourglass_N" in parts:
            yield f", hourglass terms {parts['hourglass_N'] + 0.0:.2g} N"
        ripple = loads.get("force_ripple_N", 0.0)
        if not is_course and ripple > 0.5 * LARGEST_RIPPLE * largest:
            # such a force only rises ever faster or snaps once: its distance from a smooth course
            # bounds the ripple, and is none
            yield f"; elements that pass a radius move it by at most {ripple:.2g} N, which its"
            yield " course is too steep there to show"


def _time(summary: Mapping[str, Any]) -> Iterator[Number]:
    if "process_time_needed_s" in summary:
        needed = summary["process_time_needed_s"]
        if pace := summary.get("pace"):
            yield Number(
                "Process time",
                f"{1e3 * summary['process_time_s']:.3g} ms",
                f"found, at the fastest; it took {milliseconds_text(pace['sheet_time_s'])}",
            )
            return
        yield Number(
            "Process time",
            f"{1e3 * summary['process_time_s']:g} ms",
            f"the sheet needs at least {milliseconds_text(needed['least_s'])}, and "
            f"{milliseconds_text(needed['sufficient_s'])} to be safe{_early_rest(summary)}",
        )


def _early_rest(summary: Mapping[str, Any]) -> str:
    """Say in which stages the sheet was at rest before their time, which then passed by itself."""
    texts = []
    for stage in summary.get("stages", ()):
        reached = stage.get("rest", {}).get("reached_s")
        if reached is not None and reached < stage["end_s"]:
            after, whole = (1e3 * (time - stage["start_s"]) for time in (reached, stage["end_s"]))
            texts.append(f"{stage['name']} after {after:.3g} of {whole:.4g} ms")
    return f"; at rest, and without steps from there on: {', '.join(texts)}" if texts else ""


def _energies(summary: Mapping[str, Any]) -> Iterator[Number]:
    for entry, name, meaning in (
        ("balance_error_max", "Error of the energy balance", balance_scale(summary)),
        ("kinetic_to_internal_end", "Kinetic energy at the end", "of the internal energy"),
        ("damping_to_external", "Damping", "of the external work"),
        ("hourglass_to_internal", "Hourglass energy", "of the internal energy"),
    ):
        if entry in summary:
            yield Number(name, percent(summary[entry]), meaning)


def _cost(summary: Mapping[str, Any]) -> Iterator[Number]:
    if "element_count" in summary:
        value = f"{summary['element_count']:,} elements, {summary['node_count']:,} nodes"
        yield Number("Mesh", value)
    if "step_control" in summary:
        causes = sorted(summary["step_control"].items(), key=lambda item: -item[1])
        total = max(sum(summary["step_control"].values()), 1)
        limited = ", ".join(f"{cause} ({count / total:.0%})" for cause, count in causes)
        yield Number("Steps", f"{summary['step_count']:,}", f"limited by {limited}")
    if summary.get("fibre_modulus_factor", 1.0) != 1.0:
        yield Number(
            "Fibre modulus",
            f"{summary['fibre_modulus_factor']:g} of the fabric's",
            f"fibres strain by up to {100 * summary['fibre_strain_largest']:.2g} %, allowed are "
            f"{100 * summary['fibre_strain_allowed']:.2g} %",
        )
    if summary.get("mass_added_largest", 0.0) > 0.0:
        yield Number(
            "Added mass",
            f"{1e3 * summary['mass_added_kg']:.4g} g",
            f"{percent(summary['mass_added_total'])} of the sheet's, at most "
            f"{percent(summary['mass_added_largest'])} of a node's; its weight is not added",
        )
    if "us_per_element_step" in summary:
        threads = f"{summary['threads']} thread{'s' if summary['threads'] != 1 else ''}"
        yield Number(
            "Computing time",
            duration_text(summary["wall_s"]),
            f"on {threads}, {summary['us_per_element_step']:.3g} microseconds "
            f"per element and step; {duration_text(summary['compile_s'])} of compiling before",
        )
    elif "wall_s" in summary:
        yield Number("Computing time", f"{1e3 * summary['wall_s']:.3g} ms", "of laying the net")


#: Columns of the table of loads: heading, and the entry of ``tool_loads`` with its factor.
_LOADS = (
    ("largest mean force [N]", "force_max_N", 1.0),
    ("at [ms]", "force_max_time_s", 1e3),
    ("mean force at the end [N]", "force_end_N", 1.0),
    ("largest force of a step [N]", "force_peak_N", 1.0),
    ("work on the sheet [J]", "work_J", 1.0),
)
#: Parts of the mean force over the stroke that are no property of the process.
_PARTS = (("of it damping [N]", "damping_N"), ("of it inertia [N]", "inertia_N"))


def load_table(summary: Mapping[str, Any]) -> tuple[list[str], list[list[str]]]:
    """Return headings and rows of the loads of all tools, both empty without histories."""
    loads = summary.get("tool_loads", {})
    if not loads:
        return [], []
    headings = [
        "tool", *(heading for heading, *_ in _LOADS), "mean force over the stroke [N]",
        *(heading for heading, _ in _PARTS),
    ]  # fmt: skip
    rows = []
    for name, load in loads.items():
        parts = load.get("parts_over_stroke", {})
        row = [f"{factor * load[entry] + 0.0:.4g}" for _, entry, factor in _LOADS]  # no minus zero
        row += [
            f"{parts[entry] + 0.0:.3g}" if parts else ""
            for entry in ("force_N", *(p for _, p in _PARTS))
        ]
        rows.append([name, *row])
    return headings, rows


def gripper_table(summary: Mapping[str, Any]) -> tuple[list[str], list[list[str]]]:
    """Return headings and rows of the loads of all grippers, both empty without any."""
    loads = summary.get("gripper_loads", {})
    if not loads:
        return [], []
    headings = [
        "gripper", "largest force [N]", "at [ms]", "force at the end [N]", "travel [mm]",
        "let go at [ms]",
    ]  # fmt: skip
    rows = [
        [
            name,
            f"{load['force_max_N']:.4g}",
            f"{1e3 * load['force_max_time_s']:.4g}",
            f"{load['force_end_N']:.4g}",
            f"{1e3 * load['travel_end_m']:.4g}",
            f"{1e3 * load['let_go_s']:.4g}" if "let_go_s" in load else "",
        ]
        for name, load in loads.items()
    ]
    return headings, rows


def grouped_warnings(summary: Mapping[str, Any]) -> list[tuple[str, list[tuple[str, int]]]]:
    """Return the warnings by stage, each text once with how often it was given."""
    stages = [("Forming", summary.get("warnings", []))]
    for name, report in summary.get("mapping", {}).items():
        stages.append((f"Mapping to {name}", report.get("warnings", [])))
    for name, report in summary.get("structure", {}).items():
        stages.append((f"Structural analysis of {name}", report.get("warnings", [])))
    for name, report in summary.get("infiltration", {}).items():
        stages.append((f"Infiltration of {name}", report.get("warnings", [])))
    return [
        (stage, [(text, texts.count(text)) for text in dict.fromkeys(texts)])
        for stage, texts in stages
        if texts
    ]
