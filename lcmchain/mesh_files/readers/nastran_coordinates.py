"""Coordinate systems of Nastran decks, and places given in them.

Source: MSC/NX Nastran Quick Reference Guide, CORD1R/C/S and CORD2R/C/S: A is the origin, B lies on
the z axis, C in the plane of x and z.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lcmchain.mesh_files.readers.nastran_card import Card

KINDS = {"CORD1R", "CORD1C", "CORD1S", "CORD2R", "CORD2C", "CORD2S"}


class System(NamedTuple):
    """Kind (R, C or S), origin (3,), and unit vectors of the axes as rows (3, 3)."""

    kind: str
    origin: np.ndarray
    axes: np.ndarray

    def places(self, given: np.ndarray) -> np.ndarray:
        """Return the places (N, 3) in the basic system of coordinates (N, 3) in this one."""
        a, b, c = given.T
        if self.kind == "C":
            turn = np.radians(b)
            given = np.stack([a * np.cos(turn), a * np.sin(turn), c], axis=1)
        elif self.kind == "S":
            polar, turn = np.radians(b), np.radians(c)
            given = np.stack(
                [a * np.sin(polar) * np.cos(turn), a * np.sin(polar) * np.sin(turn),
                 a * np.cos(polar)], axis=1,
            )  # fmt: skip
        return given @ self.axes + self.origin


class Systems:
    """The coordinate systems of a deck, made when they are first asked for.

    Parameters
    ----------
    cards : CORD entries. node_place : returns the place of a node for those defined by nodes.
    """

    def __init__(self, cards: list[Card]) -> None:
        self._definitions: dict[int, tuple[Card, int]] = {}
        for card in cards:
            self._definitions[card.whole(0)] = (card, 0)
            if card.name[4] == "1" and card.text(4):
                self._definitions[card.whole(4)] = (card, 4)  # two to a line
        self._made: dict[int, System] = {}
        self._in_work: list[int] = []

    def place(
        self, number: int, given: np.ndarray, card: Card, nodes: dict[int, Card]
    ) -> np.ndarray:
        """Return places (N, 3) in the basic system of coordinates in a system.

        Parameters
        ----------
        card : that names the system. nodes : GRID entries by number, for systems defined by nodes.

        Raises
        ------
        InputError : the system does not exist, has no axes, or is defined by itself.
        """
        if number == 0:
            return given
        if number not in self._made:
            if number not in self._definitions:
                raise card.place.error(
                    f"{card.name} {card.text(0)} is given in the coordinate system {number}, which "
                    "the file does not define"
                )
            if number in self._in_work:
                raise card.place.error(f"coordinate system {number} is defined by itself")
            self._in_work.append(number)
            self._made[number] = self._system(*self._definitions[number], nodes)
            self._in_work.pop()
        return self._made[number].places(given)

    def _system(self, card: Card, first: int, nodes: dict[int, Card]) -> System:
        if card.name[4] == "2":
            given = np.array([card.real(field) for field in range(2, 11)]).reshape(3, 3)
            points = self.place(card.whole(1, 0), given, card, nodes)
        else:
            points = np.concatenate(
                [self._of_node(card, card.whole(first + k), nodes) for k in (1, 2, 3)]
            )
        with np.errstate(over="ignore", invalid="ignore"):
            z = points[1] - points[0]
            y = np.cross(z, points[2] - points[0])
            lengths = float(np.linalg.norm(z)), float(np.linalg.norm(y))
        if not np.isfinite(lengths).all() or min(lengths) <= 1e-12 * max(1.0, *lengths):
            raise card.place.error(f"{card.name} {card.text(first)} has no three different axes")
        z, y = z / lengths[0], y / lengths[1]
        return System(card.name[5], points[0], np.stack([np.cross(y, z), y, z]))

    def _of_node(self, card: Card, number: int, nodes: dict[int, Card]) -> np.ndarray:
        if number not in nodes:
            raise card.place.error(f"{card.name} names the node {number}, which does not exist")
        grid = nodes[number]
        given = np.array([[grid.real(field) for field in (2, 3, 4)]])
        return self.place(grid.whole(1, 0), given, grid, nodes)
