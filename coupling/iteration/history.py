"""Convergence history of a coupled run as data."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from lcmchain.fields.netcdf_file import write_netcdf

if TYPE_CHECKING:
    import xarray as xr

#: Outcomes of an attempt at a window.
CONVERGED, EXPLICIT, ACCEPTED, FAILED, REJECTED = 0, 1, 2, 3, 4
STANDING = (CONVERGED, EXPLICIT, ACCEPTED)
OUTCOMES = {
    CONVERGED: "converged",
    EXPLICIT: "explicit",
    ACCEPTED: "not_converged_but_accepted",
    FAILED: "failed",
    REJECTED: "rejected",
}


@dataclass(frozen=True)
class IterationRecord:
    """One iteration: ``window`` and ``attempt`` count from 0, ``iteration`` from 1.

    ``residual``, ``size`` and ``limit`` hold one value per exchange in the exchanges' units.
    """

    window: int
    attempt: int
    iteration: int
    residual: tuple[float, ...]
    size: tuple[float, ...]
    limit: tuple[float, ...]
    factor: float
    rank: int


@dataclass(frozen=True)
class WindowRecord:
    """One attempt at a window: begin and size [s], iterations, outcome, coupling residual."""

    window: int
    attempt: int
    begin: float
    size: float
    iterations: int
    outcome: int
    missed: float
    reason: str = ""


@dataclass
class History:
    """All iterations and windows of a run."""

    scheme: str
    exchanges: tuple[str, ...]
    iterations: list[IterationRecord] = field(default_factory=list)
    windows: list[WindowRecord] = field(default_factory=list)

    @property
    def accepted(self) -> list[WindowRecord]:
        """Return the windows that stand, without the attempts that were undone."""
        return [w for w in self.windows if w.outcome in STANDING]

    @property
    def restarts(self) -> int:
        """Return how many attempts were undone."""
        return len(self.windows) - len(self.accepted)

    @property
    def mean_iterations(self) -> float:
        """Return the iterations per window that stands; those of failed attempts count."""
        windows = len(self.accepted)
        total = sum(window.iterations for window in self.windows)
        return total / windows if windows else math.nan

    def save(self) -> tuple[list[IterationRecord], list[WindowRecord]]:
        """Return a copy; records never change."""
        return list(self.iterations), list(self.windows)

    def restore(self, saved: tuple[list[IterationRecord], list[WindowRecord]]) -> None:
        """Return to a saved history."""
        iterations, windows = saved
        self.iterations, self.windows = list(iterations), list(windows)

    def dataset(self) -> xr.Dataset:
        """Return the history as a dataset with the dimensions iteration, window and exchange.

        The dimension ``window`` counts all attempts in their order; those that were undone have the
        outcome failed or rejected.
        """

        def row(
            values: Sequence[float], dtype: str, long_name: str, units: str = "1"
        ) -> tuple[np.ndarray, dict[str, str]]:
            return np.array(values, dtype=dtype), {"long_name": long_name, "units": units}

        steps, attempts = self.iterations, self.windows
        per_iteration = {
            "iteration_window": row([s.window for s in steps], "i4", "window of the iteration"),
            "iteration_attempt": row([s.attempt for s in steps], "i4", "attempt at the window"),
            "iteration_number": row([s.iteration for s in steps], "i4", "iteration in the attempt"),
            "relaxation_factor": row([s.factor for s in steps], "f8", "relaxation factor"),
            "rank": row([s.rank for s in steps], "i4", "columns of the quasi-Newton step"),
        }
        per_window = {
            "window_number": row([w.window for w in attempts], "i4", "window"),
            "window_attempt": row([w.attempt for w in attempts], "i4", "restarts before this one"),
            "window_begin": row([w.begin for w in attempts], "f8", "begin of the window", "s"),
            "window_size": row([w.size for w in attempts], "f8", "size of the window", "s"),
            "window_iterations": row([w.iterations for w in attempts], "i4", "iterations"),
            "coupling_residual": row(
                [w.missed for w in attempts], "f8", "largest change against the prediction"
            ),
        }
        variables: dict[str, Any] = {}
        for name, (values, attributes) in per_iteration.items():
            variables[name] = (("iteration",), values, attributes)
        shape = (len(steps), len(self.exchanges))
        for name, rows, words in (
            ("residual", [s.residual for s in steps], "what the iteration changed"),
            ("field_size", [s.size for s in steps], "size of the field"),
            ("residual_limit", [s.limit for s in steps], "largest residual that is allowed"),
        ):
            attributes = {"long_name": words, "comment": "in the unit of the exchanged field"}
            values = np.array(rows, dtype=np.float64).reshape(shape)
            variables[name] = (("iteration", "exchange"), values, attributes)
        for name, (values, attributes) in per_window.items():
            variables[name] = (("window",), values, attributes)
        outcome = {
            "long_name": "outcome of the attempt",
            "flag_values": np.array(list(OUTCOMES), dtype="i4"),
            "flag_meanings": " ".join(OUTCOMES.values()),
        }
        outcomes = np.array([w.outcome for w in attempts], dtype="i4")
        variables["window_outcome"] = (("window",), outcomes, outcome)
        reasons = np.array([w.reason for w in attempts], dtype=object)
        variables["window_reason"] = (("window",), reasons, {"long_name": "why it was undone"})
        names = np.array(self.exchanges, dtype=object)
        return xr.Dataset(
            variables,
            coords={"exchange": ("exchange", names, {"long_name": "exchange of a field"})},
            attrs={"Conventions": "CF-1.11", "title": "Convergence history", "scheme": self.scheme},
        )

    def write(self, path: Path | str) -> Path:
        """Write the history as netCDF; the file appears complete or not at all.

        Raises
        ------
        InputError : the path cannot be written.
        OutputError : writing failed on the way.
        """
        write_netcdf(path, {"/": self.dataset()})
        return Path(path)
