"""The convergence history as data, as a file and as a picture."""

import struct

import numpy as np
import pytest
import xarray as xr

from lcmchain.coupling.iteration import WindowControl, gauss_seidel, iqn_ils
from lcmchain.coupling.iteration.consolidation import Column, coupled_column
from lcmchain.coupling.iteration.history import History
from lcmchain.coupling.iteration.plot import _of_a_decade, draw_history
from lcmchain.errors import InputError


@pytest.fixture(scope="module")
def system():
    control = WindowControl(1.0, smallest=0.1, largest=2.0, residual=0.2)
    system = coupled_column(Column(), iqn_ils(), control)
    system.advance(10.0)
    return system


def test_dataset_holds_every_iteration_and_every_attempt(system):
    data = system.history.dataset()
    assert data.sizes == {
        "iteration": len(system.history.iterations),
        "window": len(system.history.windows),
        "exchange": 2,
    }
    assert data["window_iterations"].sum() == data.sizes["iteration"]
    assert list(data["exchange"].values) == [
        "solid.volume_rate -> fluid.volume_rate",
        "fluid.pore_pressure -> solid.pore_pressure",
    ]
    assert all("long_name" in variable.attrs for variable in data.variables.values())


def test_windows_that_stand_follow_each_other_without_a_gap(system):
    data = system.history.dataset()
    stands = np.isin(data["window_outcome"], (0, 1, 2))
    begin, size = data["window_begin"].values[stands], data["window_size"].values[stands]
    assert begin + size == pytest.approx([*begin[1:], 10.0])
    assert list(data["window_number"].values[stands]) == list(range(stands.sum()))
    assert (~stands).sum() == system.history.restarts > 0
    undone = data["window_outcome"].values[~stands]
    assert set(undone) == {4}
    assert data["window_attempt"].values[stands].max() > 0


def test_last_iteration_of_a_window_has_converged_and_no_other(system):
    data = system.history.dataset()
    key = np.stack([data["iteration_window"], data["iteration_attempt"]], axis=1)
    last = np.append(np.any(key[1:] != key[:-1], axis=1), True)
    converged = (data["residual"] <= data["residual_limit"]).all("exchange").values
    assert np.array_equal(converged, last)
    assert data["residual_limit"].values[:, 1] == pytest.approx(
        1e-6 * data["field_size"].values[:, 1]
    )


def test_rank_and_factor_tell_which_step_was_made(system):
    data = system.history.dataset()
    assert data["relaxation_factor"].values[0] == 0.01 and data["rank"].values[0] == 0
    first = data["iteration_window"].values == 0
    first &= data["iteration_attempt"].values == 0
    assert list(data["rank"].values[first][1:4]) == [1, 2, 3]
    assert np.isnan(data["relaxation_factor"].values[first][1:]).all()


def test_mean_iterations_count_failed_attempts(system):
    history = system.history
    total = sum(window.iterations for window in history.windows)
    assert history.mean_iterations == total / len(history.accepted)
    assert np.isnan(History("none", ()).mean_iterations)


def test_the_file_gives_back_the_dataset(system, tmp_path):
    path = system.history.write(tmp_path / "coupling.nc")
    assert [file.name for file in tmp_path.iterdir()] == ["coupling.nc"]
    with xr.open_dataset(path, mask_and_scale=False) as read:
        xr.testing.assert_equal(read.load(), system.history.dataset())
        assert read.attrs["scheme"] == "IQN-ILS"
    with pytest.raises(InputError):
        system.history.write(tmp_path)


@pytest.mark.usefixtures("fine_pictures")
@pytest.mark.parametrize("scheme", [iqn_ils, gauss_seidel])
def test_picture_is_drawn(scheme, tmp_path):
    system = coupled_column(Column(modulus=1e8), scheme(), 1.0, prediction=0)
    system.advance(5.0)
    path = tmp_path / "history.png"
    draw_history(path, system.history.dataset(), "column")
    head = path.read_bytes()[:24]
    assert head.startswith(b"\x89PNG")
    assert struct.unpack(">II", head[16:24]) == (1440, 1200)


@pytest.mark.parametrize("sizes", [[1e-4, 1e-4 + 1e-19], [5e-3, 4e-3], [1e-6, 1.0], [0.0, 2.0]])
def test_the_axis_of_the_windows_shows_a_decade(sizes):
    """Windows of one size would else fill an axis with their rounding, all labels alike."""
    least, most = _of_a_decade(np.array(sizes))
    assert most >= 9.999 * least
    inside = [size for size in sizes if size > 0.0]
    assert 1.2 * least < min(inside) and most > 1.2 * max(inside)
    assert most / least < 2.0 * max(10.0, max(inside) / min(inside))


def test_picture_of_a_history_without_windows_is_drawn(tmp_path):
    draw_history(tmp_path / "empty.png", History("Aitken", ("a.y -> b.x",)).dataset())
    assert (tmp_path / "empty.png").stat().st_size > 1000
