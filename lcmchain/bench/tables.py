"""The tables of ``lcmchain bench``, and the same figures as JSON."""

from __future__ import annotations

import json
import platform
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rich.table import Table

from lcmchain.atomic import replacing
from lcmchain.bench import hemisphere, laws, sizes, stacks
from lcmchain.bench.laws import LawSpeed, measure_laws
from lcmchain.bench.measure import REPETITIONS, Machine, Measurement, measure_machine
from lcmchain.bench.operations import count_operations
from lcmchain.bench.parts import Parts, measure_parts
from lcmchain.bench.sizes import Plate
from lcmchain.bench.stacks import StackSpeed, measure_stacks
from lcmchain.check.effect_cost import cost_table, measure_effects, record_effect_parts
from lcmchain.model import build_model
from lcmchain.scene import scene_from_text


def run_bench(json_file: Path | None = None) -> Table:
    """Measure the hemisphere and return the table that ``lcmchain bench`` prints.

    Parameters
    ----------
    json_file : gets the same figures.
    """
    found = hemisphere.measurements()
    if json_file is not None:
        write_figures(json_file, {"hemisphere_holder": [asdict(m) for m in found]})
    return hemisphere_table(found)


def run_size_bench(json_file: Path | None = None) -> Table:
    """Measure free plates and the machine; return the table of ``lcmchain bench --sizes``."""
    machine, plates = measure_machine(), sizes.measure_plates()
    operations = count_operations().kernel
    if json_file is not None:
        figures = {
            "machine": asdict(machine),
            "kernel_operations": operations,
            "plates": [
                asdict(plate) | {"ratio": plate.ratio, "bandwidth": plate.bandwidth}
                for plate in plates
            ],
        }
        write_figures(json_file, figures)
    return size_table(machine, operations, plates)


def run_part_bench(json_file: Path | None = None) -> Table:
    """Measure the parts of a step; return the table of ``lcmchain bench --parts``."""
    found, machine = measure_parts(), measure_machine()
    if json_file is not None:
        figures = {
            "machine": asdict(machine),
            "parts": [asdict(m) for m in (*found.parts, found.whole)],
            "operations": found.operations,
            "between": found.between,
        }
        write_figures(json_file, figures)
    return part_table(machine, found)


def run_stack_bench(json_file: Path | None = None) -> Table:
    """Measure stacks of plies; return the table of ``lcmchain bench --stacks``."""
    kernel, found = measure_stacks()
    if json_file is not None:
        figures = {"kernel": kernel, "stacks": [asdict(speed) for speed in found]}
        write_figures(json_file, figures)
    return stack_table(kernel, found)


def run_law_bench(json_file: Path | None = None) -> Table:
    """Measure kernels of what a fabric may know; return the table of ``lcmchain bench --laws``."""
    found = measure_laws()
    if json_file is not None:
        write_figures(json_file, {"laws": [speed._asdict() for speed in found]})
    return law_table(found)


def run_effect_bench(json_file: Path | None = None) -> Table:
    """Measure what each effect of the hemisphere costs; return what ``bench --effects`` prints.

    The parts are kept for later checks of such scenes.
    """
    scene = scene_from_text(hemisphere.SCENE)
    costs = measure_effects(scene, at=hemisphere.MID_STROKE / scene.process.time)
    record_effect_parts(build_model(scene), {cost.effect.name: cost.part for cost in costs})
    if json_file is not None:
        figures = {
            cost.effect.name: {"with": 1e6 * cost.with_it, "without": 1e6 * cost.without_it}
            for cost in costs
        }
        write_figures(json_file, {"effects": figures})
    return cost_table(costs)


def write_figures(file: Path, figures: dict[str, Any]) -> None:
    """Write figures [µs per element and step] with what they were measured on."""
    text = json.dumps({"unit": "us", "processor": platform.machine(), **figures}, indent=2)
    with replacing(file) as new:
        new.write_text(text + "\n", encoding="utf-8")


def hemisphere_table(measurements: list[Measurement]) -> Table:
    """Return the table of the element kernels and the whole steps of the hemisphere."""
    table = Table(
        title=f"µs per element and step, median of {REPETITIONS} ({platform.machine()})",
        title_justify="left",
    )
    table.add_column("what")
    for column in ("threads", "median", "least", "most"):
        table.add_column(column, justify="right")
    for m in measurements:
        row = (f"{value:.4f}" for value in (m.median, m.least, m.most))
        table.add_row(m.name, str(m.threads), *row)
    return table


def part_table(machine: Machine, found: Parts) -> Table:
    """Return the table of the parts of a step, with operations per element where counted."""
    table = Table(
        title=(
            f"Parts of a step, µs per element, one core, median of {REPETITIONS} (one core: "
            f"{machine.arithmetic:.0f} GFLOP/s of fused multiply-adds)"
        ),
        title_justify="left",
    )
    table.add_column("part")
    for column in ("alone", "kernels", "operations", "GFLOP/s", "of peak"):
        table.add_column(column, justify="right")
    rows = [(part.name, part.median) for part in found.parts]
    rows += [("more than its parts alone", found.between)]
    rows += [(found.whole.name, found.whole.median)]
    for name, time in rows:
        rates = ["", "", ""]
        if name in found.operations:
            rate = 1e-3 * found.operations[name] / time
            rates = [f"{found.operations[name]:.0f}", f"{rate:.1f}"]
            rates += [f"{rate / machine.arithmetic:.0%}"]
        table.add_row(name, f"{time:.4f}", f"{time / found.kernel.median:.2f}", *rates)
    return table


def stack_table(kernel: float, found: list[StackSpeed]) -> Table:
    """Return the table of stacks beside one ply.

    kernel : time of the element kernel [µs].
    """
    table = Table(
        title=(
            f"Stacks at mid-stroke, µs per element and step, median of {stacks.REPETITIONS} "
            f"({platform.machine()}; element kernel {kernel:.4f})"
        ),
        title_justify="left",
    )
    table.add_column("plies")
    for column in (
        "one core", "over one ply", "all cores", "over one ply", "gain", "interface", "kernels",
    ):  # fmt: skip
        table.add_column(column, justify="right")
    first = found[0]
    for speed in found:
        contact = ["", ""]
        if speed.interface:
            contact = [f"{speed.interface:.4f}", f"{speed.interface / kernel:.2f}"]
        table.add_row(
            str(speed.ply_count),
            f"{speed.one.median:.4f}", f"{speed.one.median / first.one.median:.2f}",
            f"{speed.all.median:.4f}", f"{speed.all.median / first.all.median:.2f}",
            f"{speed.one.median / speed.all.median:.2f}", *contact,
        )  # fmt: skip
    return table


def law_table(found: list[LawSpeed]) -> Table:
    """Return the table of the element kernels of laws."""
    table = Table(
        title=(
            f"Element kernel of a fabric, µs per element, one core, median of {laws.ROUNDS} "
            f"({platform.machine()})"
        ),
        title_justify="left",
    )
    table.add_column("law")
    for column in ("kernel", "over the published law"):
        table.add_column(column, justify="right")
    for speed in found:
        table.add_row(speed.name, f"{speed.time:.4f}", f"{speed.ratio:.2f}")
    return table


def size_table(machine: Machine, operations: int, plates: list[Plate]) -> Table:
    """Return the table of plates over their size.

    Parameters
    ----------
    operations : of the kernel per element.
    """
    table = Table(
        title=(
            f"Free plates, µs per element and step, median of {sizes.REPETITIONS} "
            f"({platform.machine()}; one core: {machine.arithmetic:.0f} GFLOP/s of fused "
            f"multiply-adds, {machine.bandwidth:.0f} GB/s; the kernel makes {operations} "
            "operations per element)"
        ),
        title_justify="left",
    )
    for column in ("elements", "threads", "kernel", "of peak", "whole step", "GB/s", "ratio"):
        table.add_column(column, justify="right")
    for plate in plates:
        of_peak = 1e-3 * operations / (plate.kernel.median * plate.kernel.threads)
        table.add_row(
            str(plate.element_count), str(plate.kernel.threads), f"{plate.kernel.median:.4f}",
            f"{of_peak / machine.arithmetic:.0%}", f"{plate.step.median:.4f}",
            f"{plate.bandwidth:.1f}", f"{plate.ratio:.2f}",
        )  # fmt: skip
    return table
