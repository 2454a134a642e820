"""What numba's front end is spared, without another answer."""

import gc

from numba import njit
from numba.core import event
from numba.core.compiler import Flags

import lcmchain.jit  # noqa: F401  # sets how numba compiles
from lcmchain.compilation.front_end import THRESHOLDS


def flags(**options):
    made = Flags()
    for name, value in options.items():
        setattr(made, name, value)
    return made


def test_options_are_equal_by_value_whether_they_were_set_or_not():
    default, unset = flags(nrt=Flags().nrt), flags()
    other = flags(nrt=not Flags().nrt)
    assert default == unset and hash(default) == hash(unset)
    assert other != default and other != unset and default != "no options"
    assert flags(nrt=other.nrt) == other and hash(flags(nrt=other.nrt)) == hash(other)
    assert {default: 1}[unset] == 1


def test_the_collector_looks_seldom_while_numba_compiles_and_as_before_afterwards():
    seen = []

    class Watcher(event.Listener):
        def on_start(self, event):
            seen.append(gc.get_threshold())

        def on_end(self, event):
            pass

    @njit
    def add_one(x):
        return x + 1

    before = gc.get_threshold()
    gc.set_threshold(500, 7, 9)
    try:
        with event.install_listener("numba:run_pass", Watcher()):
            assert add_one(1) == 2
        after = gc.get_threshold()
        gc.disable()
        gc.set_threshold(0)
        with event.install_listener("numba:run_pass", Watcher()):
            seen_on, seen[:] = set(seen), []
            assert add_one(1.5) == 2.5
    finally:
        gc.enable()
        gc.set_threshold(*before)
    assert seen_on == {THRESHOLDS} and after == (500, 7, 9)
    assert {threshold[0] for threshold in seen} == {0}


def test_only_the_outermost_timer_of_a_kind_listens():
    compiling, locked = event._registered["numba:compile"], event._registered["numba:llvm_lock"]
    before, seconds = (len(compiling), len(locked)), []
    for _ in range(2):
        with event.install_timer("numba:compile", seconds.append):
            with event.install_timer("numba:compile", seconds.append):
                assert len(compiling) == before[0] + 1
            with event.install_timer("numba:llvm_lock", seconds.append):
                assert len(locked) == before[1] + 1
            with event.trigger_event("numba:compile"):
                pass
    assert (len(compiling), len(locked)) == before
    assert len(seconds) == 2
