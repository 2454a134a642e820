"""What flows into a control volume beyond its pores goes on to its neighbours."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

#: Fill factor from which a control volume counts as full. What it lacks then it never gets.
FULL = 1.0 - 1e-8
#: Least share of a time step that is tried next.
LEAST_SHARE = 1e-6


class Passed(NamedTuple):
    """Volumes after the overflow.

    volume (N,) : resin [m3], never above the pores' nor below zero.
    rate (N,) : inflow [m3/s] that each volume had, with what was passed on to it.
    vented (N,) : what left at open vents [m3].
    source, target, moved : rows and volumes [m3] of what was passed on.
    """

    volume: np.ndarray
    rate: np.ndarray
    vented: np.ndarray
    source: np.ndarray
    target: np.ndarray
    moved: np.ndarray


class Stuck(NamedTuple):
    """Some excess found no room: about this share of the time step fills the volume exactly."""

    share: float


def pass_on(
    edges: np.ndarray,
    flow: np.ndarray,
    before: np.ndarray,
    volume: np.ndarray,
    pores: np.ndarray,
    pores_before: np.ndarray,
    rate: np.ndarray,
    bleeds: np.ndarray,
    full: np.ndarray,
    spare: float = 0.0,
) -> Passed | Stuck:
    """Pass the excess of over-full volumes on to those with room, as the edges conduct.

    A volume that would be drained below zero takes what it lacks from its neighbours in the same
    way. Nothing is lost: the sum of volumes and what is vented stays to round-off.

    Parameters
    ----------
    edges (E, 2), flow (E,) : conductances.
    before, volume : of resin before and after the step, (N,). pores, pores_before : after and
        before it, (N,). rate : (N,), see :class:`Passed`.
    bleeds : nodes where excess leaves the sheet, (N,).
    full : those that were full before the step and take nothing, (N,).
    spare : share of its pores that a volume may keep as excess where it finds no room.

    Returns
    -------
    :class:`Stuck` if some excess found no room: a smaller time step is needed.
    """
    volume, rate = volume.copy(), rate.copy()
    vented = np.zeros_like(volume)
    out = bleeds & (volume > pores)
    vented[out] = (volume - pores)[out]
    volume[out] = pores[out]
    records: list[tuple[np.ndarray, ...]] = []
    stuck = _spread(edges, flow, volume, pores, rate, full, spare, records)
    if stuck.any():
        room = (pores_before - before)[stuck]
        narrower = (volume - before - pores + pores_before)[stuck]
        share = np.maximum(room / narrower, LEAST_SHARE)
        return Stuck(float(np.min(share)) * (1.0 - 2e-9))
    if (volume < 0.0).any() and not _draw(edges, flow, volume, records):
        return Stuck(0.5)
    joined = [np.concatenate(column) for column in zip(*records, strict=True)] if records else [
        np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64), np.empty(0)
    ]  # fmt: skip
    return Passed(volume, rate, vented, *joined)


def _spread(edges, flow, volume, pores, rate, full, spare, records) -> np.ndarray:
    """Pass on what is too much; return which volumes (N,) found no neighbour with room."""
    done, kept = full.copy(), full.copy()
    while True:
        excess = volume - pores
        over = (excess > 0.0) & ~kept
        if not over.any():
            return over
        done |= over
        room = ~done & (volume < pores)
        source, target, between = _neighbours(edges, flow, over, room)
        share = _shares(between, source, len(volume))
        stuck = over.copy()
        stuck[source] = False
        kept |= stuck & (excess <= spare * pores)
        stuck &= ~kept
        if stuck.any():
            return stuck
        over &= ~kept
        moved = share * excess[source]
        records.append((source, target, moved))
        volume += np.bincount(target, moved, minlength=len(volume))
        rate += np.bincount(target, share * rate[source], minlength=len(volume))
        volume[over] = pores[over]


def _neighbours(
    edges: np.ndarray, flow: np.ndarray, these: np.ndarray, those: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Edges from some volumes to others: rows of both ends, and conductances."""
    first, second = edges.T
    forth = np.flatnonzero(these[first] & those[second])
    back = np.flatnonzero(these[second] & those[first])
    return (
        np.concatenate([first[forth], second[back]]),
        np.concatenate([second[forth], first[back]]),
        np.concatenate([flow[forth], flow[back]]),
    )


def _shares(flow: np.ndarray, owner: np.ndarray, count: int) -> np.ndarray:
    """Shares of each owner's edges: as they conduct, or alike where none of them conducts."""
    positive = np.maximum(flow, 0.0)
    total = np.bincount(owner, positive, minlength=count)
    number = np.bincount(owner, minlength=count)
    conducts = total[owner] > 0.0
    return np.where(conducts, positive / np.where(conducts, total[owner], 1.0), 1.0 / number[owner])


def _draw(edges, flow, volume, records) -> bool:
    """Let drained volumes take what they lack from wet neighbours; return whether all could."""
    done = np.zeros(len(volume), dtype=bool)
    while True:
        under = volume < 0.0
        if not under.any():
            return True
        done |= under
        wet = ~done & (volume > 0.0)
        target, source, between = _neighbours(edges, flow, under, wet)
        share = _shares(between, target, len(volume))
        lost = under.copy()
        lost[target] = False
        if lost.any():
            return False
        moved = share * -volume[target]
        records.append((source, target, moved))
        volume -= np.bincount(source, moved, minlength=len(volume))
        volume[under] = 0.0
