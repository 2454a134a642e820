"""What ``lcmchain run`` says at its end."""

from pathlib import Path

import pytest

from lcmchain.commands.run import all_warnings, print_result, summary_rows
from lcmchain.report.numbers import Number, ply_numbers

SUMMARY = {
    "title": "dome [1]",
    "shear_angle_max_rad": 0.5,
    "thickness_min_m": 0.8123e-3,
    "thickness_max_m": 1.0561e-3,
    "fibre_volume_fraction_max": 0.4567,
    "fibre_strain_max": 0.00123,
    "punch_force_max_N": 123.456,
    "process_time_s": 0.05,
    "process_time_needed_s": {"least_s": 0.0536, "sufficient_s": 0.277},
    "balance_error_max": 0.00345,
    "kinetic_to_internal_end": 0.0123,
    "step_count": 12345,
    "step_control": {"in-plane waves": 2345, "contact stiffness": 10000},
    "wall_s": 12.34,
    "compile_s": 5.67,
    "threads": 2,
    "us_per_element_step": 0.25,
    "warnings": ["the sheet [still] moves"],
    "mapping": {
        "part": {
            "cell_count": 1200,
            "target_coverage": 0.995,
            "source_coverage": 0.64,
            "warnings": ["3 cells reach beyond the edge"],
        },
        "other": {"error": "no sheet"},
    },
}


def rows(summary):
    return {number.name: number[1:] for number in summary_rows(summary)}


@pytest.mark.parametrize(
    ("name", "value", "meaning"),
    [
        ("Shear angle", "up to 28.6 deg", "magnitude, in the last frame"),
        ("Thickness", "0.812 to 1.056 mm", "in the last frame"),
        ("Fibre volume fraction", "up to 0.457", "in the last frame"),
        ("Fibre strain", "up to 0.123 %", "magnitude, of all families"),
        (
            "Force of the punch",
            "123.5 N",
            "largest mean over a twentieth of the process: the figure to quote",
        ),
        ("Process time", "50 ms", "the sheet needs at least 53.6 ms, and 277 ms to be safe"),
        ("Error of the energy balance", "0.345 %", "of the largest internal energy"),
        ("Kinetic energy at the end", "1.23 %", "of the internal energy"),
        ("Steps", "12,345", "limited by contact stiffness (81%), in-plane waves (19%)"),
        (
            "Computing time",
            "12.3 s",
            "on 2 threads, 0.25 microseconds per element and step; 5.7 s of compiling before",
        ),
        ("Mapping part", "1,200 cells", "99.5% of the target and 64.0% of the sheet covered"),
        ("Mapping other", "failed", ""),
    ],
)
def test_rows_are_the_numbers_of_the_summary(name, value, meaning):
    assert rows(SUMMARY)[name] == (value, meaning)


@pytest.mark.parametrize(("ripple", "said"), [(7.0, True), (5.0, False)])
def test_a_force_that_is_too_steep_for_a_ripple_names_its_bound_alone(ripple, said):
    parts = {"force_N": 120.0, "damping_N": 0.0, "inertia_N": 0.0}
    loads = {"parts_at_maximum": parts, "force_max_N": 123.0}
    loads |= {"force_ripple_N": ripple, "force_smooth_N": 118.76}
    more = {"punch": "press", "punch_force_peak_N": 150.0, "tool_loads": {"press": loads}}
    meaning = rows(SUMMARY | more)["Force of the punch"][1]
    words = "elements that pass a radius move it by at most 7 N, which its course is too steep"
    assert (words in meaning) == said
    assert "118.8 N" not in meaning  # of a steep rise the parabola is no course to compare with


def test_a_force_with_a_ripple_is_quoted_by_its_smooth_course():
    parts = {"force_N": 120.0, "damping_N": 0.0, "inertia_N": 0.0}
    loads = {"parts_at_maximum": parts, "force_ripple_N": 7.0, "force_smooth_N": 118.76}
    loads |= {"force_uncertainty_N": 7.0, "force_quoted_uncertainty_N": 4.9}
    more = {"punch": "press", "punch_force_peak_N": 150.0, "tool_loads": {"press": loads}}
    value, meaning = rows(SUMMARY | more | {"punch_force_quoted_N": 118.76})["Force of the punch"]
    assert value == "118.8 N ± 5 N"
    assert meaning.startswith("smooth course where it is largest, tool press: the figure to quote")
    assert meaning.count("elements that pass a radius move it by 7 N") == 1
    assert (
        "its largest mean over a twentieth of the process, 123.5 N, is that of the mesh" in meaning
    )
    del loads["force_quoted_uncertainty_N"]  # an older summary
    assert rows(SUMMARY | more)["Force of the punch"][0] == "123.5 N ± 7 N"


def test_the_punch_force_says_what_damping_and_inertia_take_of_it():
    parts = {"force_N": 120.0, "damping_N": 6.543, "inertia_N": -1.2345}
    more = {
        "punch": "press",
        "punch_force_peak_N": 150.04,
        "tool_loads": {"die": {}, "press": {"parts_at_maximum": parts}},
    }
    still = SUMMARY | more | {"tool_loads": {"press": {}}}
    of_step = "tool press: the figure to quote; 150 N in a single step"
    assert rows(still)["Force of the punch"][1].endswith(of_step)
    assert rows(SUMMARY | more)["Force of the punch"][1].endswith(
        f"{of_step}; around it damping takes 6.54 N and inertia -1.23 N of 120 N"
    )


def test_nothing_is_taken_of_a_force_that_is_smaller_than_its_parts():
    parts = {"force_N": 2.706, "damping_N": 5.99, "inertia_N": -4.1}
    more = {
        "punch": "press",
        "punch_force_peak_N": 150.04,
        "tool_loads": {"press": {"parts_at_maximum": parts}},
    }
    told = rows(SUMMARY | more)["Force of the punch"][1]
    assert "takes" not in told
    assert "the mean of 2.706 N is the sum of damping 5.99 N, inertia -4.1 N and all else" in told
    assert "all else 0.816 N" in told


def test_a_run_that_did_not_end_says_how_far_it_came():
    stopped = SUMMARY | {"state": "interrupted", "time_reached_s": 0.02}
    assert rows(stopped)["Reached"][0] == "20 of 50 ms"


def test_a_number_in_one_line():
    assert Number("Damping", "13.8 %", "of the work").in_words == "13.8 % of the work"
    assert Number("Steps", "60", "limited by waves").in_words == "60; limited by waves"
    assert Number("Mapping", "failed").in_words == "failed"


def test_every_warning_is_said():
    assert all_warnings(SUMMARY) == [
        "the sheet [still] moves", "part: 3 cells reach beyond the edge"
    ]  # fmt: skip


def test_rows_of_what_a_result_does_not_have_are_left_out():
    without = ("thickness_min_m", "fibre_volume_fraction_max", "punch_force_max_N")
    names = rows({k: v for k, v in SUMMARY.items() if k not in without})
    assert not {"Thickness", "Fibre volume fraction", "Force of the punch"} & set(names)
    assert len(names) == len(rows(SUMMARY)) - 3


def test_the_terminal_shows_rows_warnings_and_folder(capsys):
    print_result(SUMMARY, Path("results/dome"))
    printed = capsys.readouterr().out
    assert printed.index("dome [1]") < printed.index("28.6 deg") < printed.index("Warning: ")
    for warning in all_warnings(SUMMARY):
        assert f"Warning: {warning}" in printed
    assert printed.rstrip().endswith("Results in results/dome")


def test_stages_that_are_at_rest_before_their_time_are_told_with_the_process_time():
    stages = [
        {"name": "draw", "start_s": 0.0, "end_s": 0.05},
        {"name": "let_go", "start_s": 0.05, "end_s": 0.45, "rest": {"reached_s": 0.323}},
        {"name": "wait", "start_s": 0.45, "end_s": 0.5, "rest": {"reached_s": None}},
    ]
    value, meaning = rows(SUMMARY | {"stages": stages, "process_time_s": 0.5})["Process time"]
    assert value == "500 ms"
    assert meaning.endswith(
        "; at rest, and without steps from there on: let_go after 273 of 400 ms"
    )
    assert "at rest" not in rows(SUMMARY)["Process time"][1]


@pytest.mark.parametrize(
    ("part", "told"), [(0.0, "nowhere 1"), (0.25, "1 or more in 25 % of the area")]
)
def test_the_wrinkle_risk_is_told_with_its_part_of_the_area(part, told):
    risk = {"wrinkle_risk_max": 1.234, "wrinkle_risk_part": part}
    value, meaning = rows(SUMMARY | risk)["Wrinkle risk"]
    assert value == "up to 1.23" and told in meaning
    assert "Wrinkle risk" not in rows(SUMMARY)
    (row,) = ply_numbers({"plies": {"under": risk}})
    assert told in row.meaning
