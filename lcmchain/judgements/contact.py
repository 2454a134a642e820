"""How far nodes reach into tools and other plies, and what of the compaction that hides."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from lcmchain.fields.limits import hidden_text
from lcmchain.judgements.grades import GOOD, GRADES, Verdict, grade_of, share
from lcmchain.quantities.readable import milliseconds_text, percent
from lcmchain.scene import Scene
from lcmchain.solver import guards
from lcmchain.thresholds import (
    BAD,
    LARGEST_HIDDEN_FORCE,
    LARGEST_HIDDEN_THICKNESS,
    LARGEST_PENETRATION,
    LARGEST_PLY_DEPTH,
)


def penetration_warnings(summary: Mapping[str, Any], thickness: float) -> list[str]:
    """Say which tools nodes reached too far into.

    thickness : of the fabric [m].
    """
    return [
        f"nodes reached {1e3 * depth:.2f} mm into {tool}; set "
        f"{summary.get('contact_penalty_needed', 'a larger contact.penalty')}"
        for tool, depth in summary["penetration_max_m"].items()
        if depth > LARGEST_PENETRATION * thickness
    ]


def penetration_verdict(summary: Mapping[str, Any], scene: Scene) -> Iterator[Verdict]:
    """Judge the deepest node in a tool."""
    depths = summary.get("penetration_max_m")
    if not depths:
        return
    tool, depth = max(depths.items(), key=lambda item: item[1])
    thickness = scene.stack.least_thickness
    limit = LARGEST_PENETRATION * thickness
    grade = grade_of(depth, limit, guards.DEEPEST_PENETRATION * thickness)
    text = f"nodes reach up to {1e3 * depth:.3f} mm into {tool} (good up to {1e3 * limit:.2g} mm)"
    yield Verdict("Penetration", grade, text, "contact.penalty" if grade != GOOD else "")


def ply_depth_verdict(summary: Mapping[str, Any]) -> Iterator[Verdict]:
    """Judge the deepest node of a ply in another one."""
    deepest = summary.get("stack", {}).get("ply_depth")
    if deepest is None:
        return
    part = deepest["part"]
    yield share(
        "Depth between plies",
        part,
        LARGEST_PLY_DEPTH,
        f"nodes of {deepest['ply']} reach up to {1e3 * deepest['depth_m']:.3f} mm into "
        f"{deepest['into']}, at {milliseconds_text(deepest['time_s'])}: {{}} of the thinner one",
        "thickness and pressure are not known there; a ply whose rim dents another one does so at "
        "single nodes",
        "interfaces.penalty, edge_length",
    )


def hidden_compaction_verdict(summary: Mapping[str, Any]) -> Iterator[Verdict]:
    """Judge how far the pressure between tools is off the law at their gap."""
    if "hidden_force_part" not in summary:
        return
    thickness, force = summary["hidden_thickness_part"], summary["hidden_force_part"]
    grades = (
        grade_of(thickness, LARGEST_HIDDEN_THICKNESS, BAD * LARGEST_HIDDEN_THICKNESS),
        grade_of(force, LARGEST_HIDDEN_FORCE, BAD * LARGEST_HIDDEN_FORCE),
    )
    grade = max(grades, key=GRADES.index)
    text = (
        f"{hidden_text(thickness, force)} (good up to {percent(LARGEST_HIDDEN_THICKNESS)} and "
        f"{percent(LARGEST_HIDDEN_FORCE)})"
    )
    remedy = "contact.depth, contact.penalty" if grade != GOOD else ""
    yield Verdict("Pressure between tools", grade, text, remedy)
