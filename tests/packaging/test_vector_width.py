"""Compiled code fills the registers of the processor, unless the user chose otherwise."""

import os
import subprocess
import sys

import pytest

from lcmchain.compilation import processor

ICE_LAKE = {"avx512f": True, "avx512vbmi2": True, "sse4a": False}
SKYLAKE = {"avx512f": True, "avx512vbmi2": False}

# What numba puts into the key of a compiled function, after lcmchain was imported.
REPORT = """
import lcmchain.jit
from numba.core.registry import cpu_target
print(cpu_target.target_context.codegen().magic_tuple()[2])
"""


def features_of_new_process(**changes):
    own = ("NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES", "NUMBA_ENABLE_AVX")
    environment = {name: value for name, value in os.environ.items() if name not in own}
    done = subprocess.run(
        [sys.executable, "-P", "-c", REPORT],
        env={**environment, **changes},
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.strip()


def test_only_processors_that_keep_their_clock_get_whole_registers():
    assert processor.widest(ICE_LAKE) == "+avx512f,+avx512vbmi2,-sse4a,-prefer-256-bit"
    assert processor.widest(SKYLAKE) is None
    assert processor.widest({}) is None


@pytest.mark.skipif(
    processor.widest(processor.host_features()) is None,
    reason="the processor has no 512-bit vectors that keep its clock",
)
def test_the_width_is_in_the_key_of_compiled_functions_and_the_users_choice_stands():
    assert features_of_new_process().endswith(",-prefer-256-bit")
    own = "+sse2,+avx,+avx2,+fma"
    assert features_of_new_process(NUMBA_CPU_FEATURES=own) == own
    generic = features_of_new_process(NUMBA_CPU_NAME="generic", NUMBA_CPU_FEATURES="")
    assert "prefer-256-bit" not in generic
    assert "prefer-256-bit" not in features_of_new_process(NUMBA_ENABLE_AVX="0")
