"""From the file of a system to the scheme, the windows and the exchanges of the coupling."""

from __future__ import annotations

from lcmchain.coupling.cosimulation.connections import Link
from lcmchain.coupling.cosimulation.system_file import SchemeEntry, System, WindowEntry
from lcmchain.coupling.iteration import (
    Exchange,
    Scheme,
    Tolerance,
    WindowControl,
    aitken,
    fixed_point,
    gauss_seidel,
    iqn_ils,
    iqn_mvj,
    jacobi,
)


def scheme_of(entry: SchemeEntry) -> Scheme:
    """Return a new scheme."""
    if entry.type == "jacobi":
        return jacobi()
    if entry.type == "gauss-seidel":
        return gauss_seidel()
    order, most = entry.order, entry.most_iterations
    factor = entry.relaxation
    if entry.type == "fixed-point":
        return fixed_point(1.0 if factor is None else factor, order=order, most_iterations=most)
    if entry.type == "aitken":
        return aitken(0.5 if factor is None else factor, order=order, most_iterations=most)
    first = 0.01 if factor is None else factor
    if entry.type == "iqn-mvj":
        return iqn_mvj(order=order, relaxation=first, most_iterations=most)
    return iqn_ils(
        order=order, relaxation=first, most_iterations=most, windows_reused=entry.windows_reused
    )


def windows_of(entry: WindowEntry) -> WindowControl:
    """Return how the windows are led."""
    return WindowControl(
        entry.size, smallest=entry.smallest, largest=entry.largest, residual=entry.residual
    )


def exchange_of(link: Link, system: System) -> Exchange:
    """Return the exchange of a connection; its unit conversion is the mapping."""
    entry = link.entry
    tolerance = Tolerance(
        relative=system.scheme.relative if entry.relative is None else entry.relative,
        absolute=entry.absolute,
    )
    return Exchange(
        link.source.name,
        link.target.name,
        link.output.name,
        link.input.name,
        mapping=None if link.conversion.is_identity else link.conversion,
        tolerance=tolerance,
        scale=entry.scale,
        relaxation=entry.relaxation,
        bounds=entry.bounds,
        of_window=entry.of_window,
        within=entry.within,
    )


def extrapolation_of(entry: SchemeEntry) -> int:
    """Return the order of the extrapolation into a new window."""
    if entry.extrapolation is not None:
        return entry.extrapolation
    return 0 if entry.explicit else 1
