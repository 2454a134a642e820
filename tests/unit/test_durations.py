"""Times as people read them."""

from __future__ import annotations

import io
import math

import pytest
from rich.console import Console

from lcmchain.check.expected_cost import Estimate, Speed
from lcmchain.check.tables import cost_table
from lcmchain.quantities.readable import duration_text, memory_text, millimetres
from lcmchain.scene import Process


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0.0, "0 s"),
        (0.0124, "0.012 s"),
        (0.0002, "0 s"),
        (0.5, "0.5 s"),
        (0.96, "1.0 s"),
        (12.34, "12.3 s"),
        (59.94, "59.9 s"),
        (59.97, "1 min 00 s"),
        (65.0, "1 min 05 s"),
        (200.4, "3 min 20 s"),
        (3599.4, "59 min 59 s"),
        (3599.6, "1 h 00 min"),
        (7500.0, "2 h 05 min"),
        (7170.0, "2 h 00 min"),
        (1e6, "277 h 47 min"),
    ],
)
def test_two_largest_units(seconds: float, text: str) -> None:
    assert duration_text(seconds) == text


def test_a_clock_set_back_and_an_unknown_time_are_told_without_failing() -> None:
    assert duration_text(-3.0) == "0 s"
    assert duration_text(math.inf) == "unknown"
    assert duration_text(math.nan) == "unknown"


def test_check_tells_hours_as_hours() -> None:
    estimate = Estimate(
        critical_step=1e-6,
        step_count=100_000,
        range=(90_000, 110_000),
        speed=Speed(1e-7, "assumed"),
        seconds=7500.0,
        controlled_by="in-plane waves",
    )
    table = cost_table(estimate, Process(time=0.1), element_count=9, node_count=32)
    terminal = Console(width=100, file=io.StringIO())
    terminal.print(table)
    assert "about 2 h 05 min once compiled" in terminal.file.getvalue()
    assert "about 0.5 GB: 0.5 GB for the program, 0.027 MB" in terminal.file.getvalue()


def test_memory_is_told_in_the_unit_that_fits() -> None:
    assert [memory_text(size) for size in (2.7e4, 1.23e7, 9.94e7, 9.96e7, 3.2e10)] == [
        "0.027 MB", "12 MB", "99 MB", "0.1 GB", "32 GB",
    ]  # fmt: skip


def test_places_have_no_minus_before_zero():
    assert millimetres((-1e-6, 0.0123456, -0.5)) == "(0.00, 12.35, -500.00) mm"
    assert millimetres((-4e-5, 4e-5, -6e-5), 1) == "(0.0, 0.0, -0.1) mm"
