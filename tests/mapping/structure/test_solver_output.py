"""What CalculiX writes, whole and cut off, and what it says."""

import numpy as np
import pytest

from lcmchain.errors import InputError
from lcmchain.mapping.structure.calculix import (
    SolverError,
    judged,
    messages,
    read_displacements,
    read_printed,
)

from .conftest import condition, needs_calculix

SAID = """
 *WARNING in gen3delem: the thickness of node 12
          is zero

 *WARNING in gen3delem: the thickness of node 733
          is zero
 *WARNING: something else: 1.5E-03
 *INFO reading *STATIC: nothing

 *ERROR reading *NSET: set LEFT
        does not exist

 Job finished
"""

FRD = """    1C
    2C                             2                                     1
 -1         7 0.00000E+00 0.00000E+00 0.00000E+00
 -1        12 1.00000E+00 0.00000E+00 0.00000E+00
 -3
    1PSTEP                         1           1           1
  100CL  101 1.000000000           2                     0    1           1
 -4  DISP        4    1
 -5  D1          1    2    1    0
 -1         7 1.00000E-03-2.00000E-03 3.00000E-03
 -1        12-1.00000E+00 0.00000E+00-5.00000E-10
 -3
    1PSTEP                         2           1           2
    1PMODE                         1
  100CL  102 118.8513234           2                     2    2MODAL      1
 -4  DISP        4    1
 -1         7 0.00000E+00 0.00000E+00 1.00000E+00
 -1        12 0.00000E+00 0.00000E+00 0.00000E+00
 -3
 9999
"""


def test_messages_are_told_once_with_their_count():
    assert messages(SAID, "WARNING") == [
        "in gen3delem: the thickness of node 12 is zero (2 times)",
        "something else: 1.5E-03",
    ]
    assert messages(SAID, "ERROR") == ["reading *NSET: set LEFT does not exist"]
    many = "".join(f" *WARNING: kind {'abcdefgh'[k]}\n\n" for k in range(8))
    assert messages(many, "WARNING")[-1] == "and 3 further kinds"


def test_an_error_is_one_also_when_the_job_finished(tmp_path):
    with pytest.raises(SolverError, match="set LEFT does not exist"):
        judged(SAID, 0, tmp_path / "log")
    run = judged(SAID.replace("*ERROR", "*INFO"), 0, tmp_path / "log")
    assert len(run.warnings) == 2


def test_displacements_of_steps_and_modes(tmp_path):
    (tmp_path / "a.frd").write_text(FRD)
    static, mode = read_displacements(tmp_path / "a.frd")
    assert (static.mode, mode.mode) == (0, 1) and mode.value == 118.8513234
    np.testing.assert_array_equal(static.node_ids, [7, 12])
    np.testing.assert_array_equal(static.displacement, [[1e-3, -2e-3, 3e-3], [-1, 0, -5e-10]])


@pytest.mark.parametrize("kept", [0.0, 0.4, 0.7, 0.97])
def test_a_result_file_that_was_cut_off_is_told(tmp_path, kept):
    (tmp_path / "a.frd").write_text(FRD[: int(kept * len(FRD))])
    with pytest.raises(InputError, match="cut off"):
        read_displacements(tmp_path / "a.frd")


def test_a_broken_block_is_told_by_its_line(tmp_path):
    (tmp_path / "a.frd").write_text(FRD.replace("-5.00000E-10", "-5.00q00E-10"))
    with pytest.raises(InputError, match="block at line 8 is no block of a CalculiX result"):
        read_displacements(tmp_path / "a.frd")


@needs_calculix
def test_printed_results_that_were_cut_off_are_told(solve, tmp_path):
    case = condition("supports", "rim", edge="true")
    case += condition("loads", "push", point='"0.1 0.1 0 m"', force='"0 0 -10 N"')
    solve("quad", case, count=2)
    text = (tmp_path / "plate_calculix.dat").read_text()
    whole = read_printed(tmp_path / "plate_calculix.dat")
    assert whole.stress.shape == whole.strain.shape == (4 * 8, 6)
    strains = text.index(" strains (elem")
    for kept in (text[: strains - 200], text[:-100], text[: strains + 300]):
        (tmp_path / "cut.dat").write_text(kept)
        with pytest.raises(InputError, match="different elements|cut off"):
            read_printed(tmp_path / "cut.dat")
