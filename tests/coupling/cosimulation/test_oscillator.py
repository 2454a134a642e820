"""Two masses in two units: analytic solution, orders, and the in-process coupling."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from lcmchain.coupling.iteration import CoupledSystem, Exchange, gauss_seidel, iqn_ils, jacobi

MASSES, STIFFNESSES, COUPLING, STOP = (2.0, 1.5), (3.0, 1.0), 2.0, 3.0


def tables(count, kind, versions=(2, 2), **scheme):
    """The system with ``count`` windows."""
    return {
        "stop_time": f"{STOP} s",
        "window": f"{STOP / count!r} s",
        "connections": ["one.position -> two.position1", "two.force -> one.force"],
        "units": [
            {"name": "one", "fmu": f"Mass_{versions[0]}.fmu",
             "start": {"mass": "2 kg", "stiffness": "3 N/m", "position0": "100 cm"}},
            {"name": "two", "fmu": f"Tail_{versions[1]}.fmu",
             "start": {"mass": "1500 g", "coupling": "2 N/m", "stiffness": "1 N/m"}},
        ],
        "scheme": {"type": kind, **scheme},
    }  # fmt: skip


def positions(system):
    fields = system.get_fields(["one.position", "two.position"])
    return np.concatenate(list(fields.values()))


def exact(time):
    k1, k2 = (stiffness + COUPLING for stiffness in STIFFNESSES)
    stiffness = np.array([[k1, -COUPLING], [-COUPLING, k2]])
    squares, modes = np.linalg.eig(np.linalg.solve(np.diag(MASSES), stiffness))
    return modes @ (np.linalg.solve(modes, [1.0, 0.0]) * np.cos(np.sqrt(squares) * time))


@pytest.mark.parametrize("scheme", ["jacobi", "gauss-seidel", "aitken", "iqn-ils"])
def test_inputs_held_over_windows_converge_with_order_one(assembled, scheme):
    errors = []
    for count in (60, 120, 240):
        assembly = assembled(tables(count, scheme, relative=1e-9))
        assembly.coupled.advance_to(STOP)
        errors.append(np.abs(positions(assembly.coupled) - exact(STOP)).max())
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(np.abs(orders - 1.0) < 0.05), orders
    assert errors[-1] < 0.02


def test_substeps_that_see_inputs_in_between_converge_with_order_two(assembled):
    errors = []
    for count in (10, 20, 40):
        data = tables(count, "iqn-ils", relative=1e-10)
        for unit in data["units"]:
            unit["substeps"] = 4 * count  # their own error, of order one, falls as fast
        assembly = assembled(data)
        assembly.coupled.advance_to(STOP)
        errors.append(np.abs(positions(assembly.coupled) - exact(STOP)).max())
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(orders > 1.8), (orders, errors)


class _Python:
    """The same mass or tail in Python; equations as in the C code."""

    def __init__(self, first):
        self.first, self.time, self.given = first, 0.0, 0.0
        self.x, self.v = (1.0, 0.0) if first else (0.0, 0.0)

    def advance(self, step):
        if self.first:
            mass, stiffness, force = MASSES[0], STIFFNESSES[0], self.given
        else:
            mass, stiffness = MASSES[1], STIFFNESSES[1] + COUPLING
            force = COUPLING * self.given
        w, rest = np.sqrt(stiffness / mass), force / stiffness
        a, b = self.x - rest, self.v / w
        c, s = np.cos(w * step), np.sin(w * step)
        self.x, self.v = rest + a * c + b * s, w * (b * c - a * s)
        self.time += step

    def save(self):
        return self.time, self.given, self.x, self.v

    def restore(self, saved):
        self.time, self.given, self.x, self.v = saved

    def set_fields(self, fields):
        (self.given,) = (float(values[0]) for values in fields.values())

    def get_fields(self, names):
        values = {"position": self.x, "force": COUPLING * (self.x - self.given)}
        return {name: np.array([values[name]]) for name in names}


@pytest.mark.parametrize("versions", [(2, 2), (3, 3), (2, 3)])
@pytest.mark.parametrize("scheme", ["jacobi", "gauss-seidel", "iqn-ils"])
def test_units_give_what_the_in_process_coupling_gives(assembled, scheme, versions):
    make = {"jacobi": jacobi, "gauss-seidel": gauss_seidel, "iqn-ils": iqn_ils}[scheme]
    one, two = _Python(True), _Python(False)
    two.given = 1.0  # what the initialisation brings
    peer = CoupledSystem(
        {"one": one, "two": two},
        [Exchange("one", "two", "position"), Exchange("two", "one", "force")],
        make(),
        window=STOP / 100,
        prediction=1 if scheme == "iqn-ils" else 0,
    )
    peer.advance_to(STOP)
    assembly = assembled(tables(100, scheme, versions))
    assembly.coupled.advance_to(STOP)
    assert np.abs(positions(assembly.coupled) - positions(peer)).max() < 1e-12
    assert assembly.coupled.history.mean_iterations == peer.history.mean_iterations


def test_extrapolation_lowers_the_error_of_an_explicit_scheme(assembled):
    errors = []
    for order in (0, 1):
        assembly = assembled(tables(100, "jacobi", extrapolation=order))
        assembly.coupled.advance_to(STOP)
        errors.append(np.abs(positions(assembly.coupled) - exact(STOP)).max())
    assert errors[1] < 0.8 * errors[0]


def test_windows_follow_the_error_of_the_extrapolation(assembled):
    window = {"size": "20 ms", "smallest": "1 ms", "largest": "200 ms", "residual": 2e-3}
    data = tables(100, "gauss-seidel", extrapolation=1) | {"window": window}
    assembly = assembled(data)
    assembly.coupled.advance_to(STOP)
    sizes = np.array([w.size for w in assembly.coupled.history.accepted])
    assert sizes.max() > 2.0 * sizes.min()
    assert sizes.min() >= 1e-3 and sizes.max() <= 0.2
    assert assembly.coupled.time == STOP


@settings(max_examples=12, deadline=None, derandomize=True,
          suppress_health_check=[HealthCheck.function_scoped_fixture])  # fmt: skip
@given(data=st.data())
def test_order_of_the_file_and_units_of_measurement_do_not_matter(assembled, data):
    """Jacobi: any order of units and connections, any version, the mass in kg, g or t."""
    versions = data.draw(st.tuples(st.sampled_from([2, 3]), st.sampled_from([2, 3])))
    system = tables(20, "jacobi", versions)
    system["units"] = data.draw(st.permutations(system["units"]))
    system["connections"] = data.draw(st.permutations(system["connections"]))
    text = data.draw(st.sampled_from(["2 kg", "2000 g", "0.002 t"]))
    next(unit for unit in system["units"] if unit["name"] == "one")["start"]["mass"] = text
    assembly = assembled(system)
    assembly.coupled.advance_to(STOP)
    plain = assembled(tables(20, "jacobi"))
    plain.coupled.advance_to(STOP)
    assert np.array_equal(positions(assembly.coupled), positions(plain.coupled))
