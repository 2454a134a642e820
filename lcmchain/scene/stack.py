"""The stack of a scene: its plies with all that each is built from, however the scene names them.

A scene names its plies in one of three ways: ``[blank]`` and ``[material]`` for one,
``layup`` for plies of one outline, ``[[plies]]`` for any. What builds, checks or shows a sheet asks
:attr:`lcmchain.scene.Scene.stack`, which is the same for all three.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, Protocol, overload

import numpy as np
import shapely
from numpy.typing import ArrayLike

from lcmchain.elements.families import SheetElement
from lcmchain.errors import InputError
from lcmchain.interfaces.table import Interface
from lcmchain.materials.law import Material, with_fibre_modulus
from lcmchain.materials.laws import AnyMaterial
from lcmchain.mesh.blank import Blank, BlankMesh, build_blank
from lcmchain.mesh.contours import Contours, contours_of
from lcmchain.mesh.courses import Courses
from lcmchain.mesh.outline import outline_of
from lcmchain.scene.plies import Ply, angles_of
from lcmchain.scene.process import Process

#: Name of the sheet of a scene with one.
ONE_SHEET = "sheet"

#: What is wrong with a scene without a sheet.
NO_SHEET = "a scene needs [blank] and [material], or [[plies]] and their materials"


@dataclass(frozen=True)
class PlySettings:
    """What one ply of a scene is built from, wherever the scene says it.

    name : of the ply, "sheet" where there is one.
    blank : its outline, edge length and fibre angle; ``height`` is that of its mid-surface.
    center : shift of the outline in the plane [m].
    material : table of its material. element : table of its elements.
    fibre_modulus_factor : of ``process``.
    key : scene entry that the blank stands in, ``blank`` or ``plies[1] "top"``.
    material_key : scene entry of the material, ``material`` or ``materials.biaxial``.
    element_key : scene entry of the element.
    film : whether it is taken off after forming.
    stages : names of the stages in which it is there, None for all.
    """

    name: str
    blank: Blank
    center: tuple[float, float]
    material: AnyMaterial
    element: SheetElement
    fibre_modulus_factor: float
    key: str
    material_key: str
    element_key: str
    film: bool = False
    stages: tuple[str, ...] | None = None

    @property
    def thickness(self) -> float:
        """Initial thickness [m]."""
        return self.material.thickness

    @property
    def bottom(self) -> float:
        """z of the lower face [m]."""
        return self.blank.height - 0.5 * self.thickness

    @property
    def top(self) -> float:
        """z of the upper face [m]."""
        return self.blank.height + 0.5 * self.thickness

    @property
    def outline(self) -> np.ndarray:
        """Corners (n, 2) of the outline where it lies [m], anticlockwise, darts cut out."""
        return self.contours.rim

    @cached_property
    def contours(self) -> Contours:
        """Outline, holes, darts and slits where they lie."""
        with self.own_keys():
            return contours_of(self.blank)[0].shifted(np.array(self.center))

    @property
    def courses(self) -> Courses | None:
        """The courses that it is laid in, where they lie; None for one piece."""
        if self.blank.courses is None:
            return None
        return self.blank.courses.shifted(float(np.array(self.center) @ self._across))

    @property
    def strips(self) -> dict[str, tuple[float, float]]:
        """Where each course begins and ends along fibre 2 [m], by its name; empty for one piece."""
        if self.courses is None:
            return {}
        across = self.outline @ self._across
        strips = self.courses.strips(float(across.min()), float(across.max()))
        return dict(zip(self.courses.names, strips, strict=True))

    @property
    def _across(self) -> np.ndarray:
        """Direction of fibre 2 in the plane (2,)."""
        return np.array([-math.sin(self.blank.fibre_angle), math.cos(self.blank.fibre_angle)])

    @property
    def shape(self) -> dict[str, Any]:
        """Entries of the shape of the blank where it lies; an outline, and no size."""
        with self.own_keys():
            rim = outline_of(self.blank)[0]

        def lying(points: ArrayLike) -> tuple[tuple[float, ...], ...]:
            return tuple(map(tuple, (np.array(points) + np.array(self.center)).tolist()))

        cuts = {name: tuple(map(lying, cuts)) for name, cuts in self.blank.cuts.items()}
        return {"size": None, "outline": lying(rim), **cuts}

    def built_material(self) -> Material:
        """Return the material as it is simulated, with the modulus of fibres that is asked for."""
        built: Any = self.material.build()
        if self.film:
            built.is_film, built.fibre_density = True, None
        if not self.material.has_fibres:  # beside plies with fibres; check_scene sees to the rest
            return built
        return with_fibre_modulus(built, self.fibre_modulus_factor)

    def build_blank(self, *, perturbation: float = 0.0, seed: int = 0) -> BlankMesh:
        """Mesh the ply with solid-shells, whatever its elements.

        perturbation, seed : as for :func:`lcmchain.mesh.blank.build_blank`.

        Raises
        ------
        InputError : as :func:`lcmchain.mesh.blank.build_blank`; names the entry of this ply.
        """
        with self.own_keys():
            mesh = build_blank(self.blank, self.thickness, perturbation=perturbation, seed=seed)
        if not any(self.center):
            return mesh
        return replace(mesh, node_positions=mesh.node_positions + [*self.center, 0.0])

    @contextmanager
    def own_keys(self) -> Iterator[None]:
        """Name entries of this ply in the errors of the block, in place of those of ``blank``."""
        try:
            yield
        except InputError as error:
            if self.key == "blank":
                raise
            key = None if error.key is None else self.in_own_words(error.key)
            raise InputError(self.in_own_words(error.message), key=key, file=error.file) from None

    def in_own_words(self, text: str) -> str:
        """Return a text about ``blank`` and ``material`` as one about the entries of this ply."""
        text = text.replace("blank.", f"{self.key}.")
        return text.replace("material.", f"{self.material_key}.")

    def remarks(self, mesh: BlankMesh) -> list[str]:
        """Say where the elements of the ply are too large for its outline."""
        remarks = [self.in_own_words(text) for text in mesh.remarks()]
        if self.blank.left_out:
            remarks.append(
                f"{self.key}.drawing holds what is no contour, left out: {self.blank.left_out}"
            )
        return remarks


@dataclass(frozen=True)
class Stack(Sequence[PlySettings]):
    """The plies of a scene, bottom first; one for a scene with one sheet."""

    plies: tuple[PlySettings, ...]

    @overload
    def __getitem__(self, index: int) -> PlySettings: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[PlySettings, ...]: ...

    def __getitem__(self, index: int | slice) -> PlySettings | tuple[PlySettings, ...]:
        return self.plies[index]

    def __len__(self) -> int:
        return len(self.plies)

    @property
    def preform(self) -> tuple[PlySettings, ...]:
        """The plies that stay: all but the films."""
        return tuple(ply for ply in self.plies if not ply.film)

    @property
    def films(self) -> tuple[PlySettings, ...]:
        """The plies that are taken off after forming."""
        return tuple(ply for ply in self.plies if ply.film)

    @property
    def materials(self) -> dict[str, AnyMaterial]:
        """Tables of the materials that plies are made of, by their scene entry."""
        return {ply.material_key: ply.material for ply in self.plies}

    @property
    def elements(self) -> dict[str, SheetElement]:
        """Tables of the elements of the plies, by their scene entry."""
        return {ply.element_key: ply.element for ply in self.plies}

    @property
    def least_thickness(self) -> float:
        """Thickness of the thinnest ply [m]."""
        return min(ply.thickness for ply in self.plies)

    @property
    def thickness(self) -> float:
        """Largest sum of the thicknesses of plies that lie on each other, gaps left out [m]."""
        if len(self.plies) == 1:
            return self.plies[0].thickness
        outlines = [ply.contours.polygon for ply in self.plies]
        lines = shapely.unary_union([outline.boundary for outline in outlines])
        return max(
            sum(
                ply.thickness
                for ply, outline in zip(self.plies, outlines, strict=True)
                if outline.contains(region.representative_point())
            )
            for region in shapely.polygonize([lines]).geoms
        )

    @property
    def has_one_outline(self) -> bool:
        """Whether all plies cover the same part of the plane at the start."""
        first, *others = (ply.contours for ply in self.plies)
        return all(
            other.starts == first.starts and np.allclose(other.points, first.points, atol=1e-9)
            for other in others
        )

    def lying_on_each_other(self) -> Iterator[tuple[PlySettings, PlySettings]]:
        """Yield plies with the highest one that they lie over at the start, which comes first."""
        if self.has_one_outline:
            yield from pairwise(self.plies)
            return
        areas = [ply.contours.polygon for ply in self.plies]
        for number, ply in enumerate(self.plies):
            beneath = [
                other
                for other, area in zip(self.plies[:number], areas, strict=False)
                if area.intersects(areas[number]) and not area.touches(areas[number])
            ]
            if beneath:
                yield max(beneath, key=lambda other: other.top), ply

    @property
    def shortest_edge(self) -> float:
        """Shortest edge length of the plies [m]."""
        return min(ply.blank.edge_length for ply in self.plies)

    @property
    def bottom(self) -> float:
        """z of the lowest face [m]."""
        return min(ply.bottom for ply in self.plies)

    @property
    def top(self) -> float:
        """z of the highest face [m]."""
        return max(ply.top for ply in self.plies)

    @property
    def extent(self) -> tuple[float, float]:
        """Width along x and height along y of the box around all plies [m]."""
        if len(self.plies) == 1:
            return self.plies[0].blank.extent
        corners = np.concatenate([ply.outline for ply in self.plies])
        width, height = np.ptp(corners, axis=0)
        return float(width), float(height)

    def thickness_at(self, x: float, y: float) -> float:
        """Thickness of all plies over a place of the plane [m]; that of the stack beside them."""
        if len(self.plies) == 1:
            return self.plies[0].thickness
        place = shapely.Point(x, y)
        here = sum(p.thickness for p in self.plies if p.contours.polygon.covers(place))
        return here or self.thickness

    @property
    def edge_entry(self) -> str:
        """Scene entry of the edge length, in words."""
        return "blank.edge_length" if self.plies[0].key == "blank" else "edge_length of [[plies]]"

    def in_own_words(self, text: str) -> str:
        """Return a text about entries of ``[blank]`` as one about those of the plies."""
        if self.plies[0].key == "blank":
            return text
        text = re.sub(r'blank\.edge_length = "[^"]*"', "a smaller edge_length of [[plies]]", text)
        return re.sub(r"\bblank\.(\w+)", r"\1 of [[plies]]", text)

    @property
    def has_thickness(self) -> bool:
        """Whether the elements of every ply predict its thickness."""
        return all(ply.element.has_thickness for ply in self.plies)

    @property
    def has_fibres(self) -> bool:
        """Whether any ply tells stiff fibres from the rest."""
        return any(ply.material.has_fibres for ply in self.plies)

    def named(self, name: str) -> PlySettings:
        """Return the ply of a name."""
        return next(ply for ply in self.plies if ply.name == name)

    def interfaces(self, entries: Sequence[Interface]) -> tuple[Interface, ...]:
        """Return what lies between plies by the names of the plies.

        A single one has at most an interface with itself. Entries without ``between`` come first,
        as they hold for all that no other one names. An entry of two plies goes before one of their
        materials.
        """
        if len(self.plies) < 2:
            return tuple(entries)
        anywhere = [entry for entry in entries if entry.between is None]
        of_pair: dict[tuple[str, str], Interface] = {}
        names = {ply.name for ply in self.plies}
        by_rank = sorted(
            (entry for entry in entries if entry.between is not None),
            key=lambda entry: set(entry.between or ()) <= names,
        )
        for index, lower in enumerate(self.plies):
            for upper in self.plies[index + 1 :]:
                for entry in by_rank:
                    if _is_between(entry, lower, upper):
                        pair = (lower.name, upper.name)
                        of_pair[pair] = entry.model_copy(update={"between": pair})
        return (*(anywhere or [Interface()]), *of_pair.values())


def _is_between(entry: Interface, lower: PlySettings, upper: PlySettings) -> bool:
    """Whether an entry names two plies, or what they are made of."""
    one, other = entry.between  # type: ignore[misc]
    first, second = _names_of(lower), _names_of(upper)
    return (one in first and other in second) or (one in second and other in first)


def _names_of(ply: PlySettings) -> tuple[str, str]:
    return ply.name, ply.material_key.removeprefix("materials.")


# --- from the tables of a scene -------------------------------------------------------------------


class PlyTables(Protocol):
    """The tables of a scene that its plies are made of, and are checked with."""

    @property
    def process(self) -> Process: ...
    @property
    def element(self) -> SheetElement: ...
    @property
    def plies(self) -> tuple[Ply, ...]: ...
    @property
    def layup(self) -> str | None: ...
    @property
    def blank(self) -> Blank | None: ...
    @property
    def material(self) -> AnyMaterial | None: ...
    @property
    def materials(self) -> dict[str, AnyMaterial]: ...
    @property
    def interfaces(self) -> tuple[Interface, ...]: ...


def stack_of(scene: PlyTables) -> Stack:
    """Return the plies of a scene, whatever form it names them in."""
    factor = scene.process.fibre_modulus_factor
    if not scene.plies and scene.layup is None:
        ply = PlySettings(
            ONE_SHEET, _blank_of(scene), (0.0, 0.0), _material_of(scene),
            scene.element, factor, "blank", "material", "element",
        )  # fmt: skip
        return Stack((ply,))
    laid: list[PlySettings] = []
    for index, entry in enumerate(scene.plies or _plies_of_layup(scene)):
        key = f'plies[{index}] "{entry.name}"' if scene.plies else "blank"
        name = entry.material
        material = _material_of(scene) if name is None else scene.materials[name]
        ply = PlySettings(
            name=str(entry.name),
            blank=entry,
            center=entry.center,
            material=material,
            element=entry.element or scene.element,
            fibre_modulus_factor=factor,
            key=key,
            material_key="material" if name is None else f"materials.{name}",
            element_key="element" if entry.element is None else f"{key}.element",
            film=entry.film,
            stages=entry.stages,
        )
        height = entry.height if entry.height is not None else _height_on(laid, ply)
        laid.append(replace(ply, blank=entry.model_copy(update={"height": height})))
    return Stack(tuple(laid))


def _blank_of(scene: PlyTables) -> Blank:
    if scene.blank is None:  # a scene that is built past its own checks
        raise InputError(NO_SHEET)
    return scene.blank


def _material_of(scene: PlyTables) -> AnyMaterial:
    if scene.material is None:  # as above
        raise InputError(NO_SHEET)
    return scene.material


def _plies_of_layup(scene: PlyTables) -> list[Ply]:
    """Return the plies of the short form: one outline, an angle for each."""
    blank = _blank_of(scene)
    shared = {**blank.shape, "courses": blank.courses, "edge_length": blank.edge_length}
    return [
        Ply(
            **shared,
            fibre_angle=angle,
            height=blank.height if index == 0 else None,
            name=f"ply_{index + 1}",
        )
        for index, angle in enumerate(angles_of(scene.layup))  # type: ignore[arg-type]
    ]


def _height_on(laid: Sequence[PlySettings], ply: PlySettings) -> float:
    """Return the z of the mid-surface of a ply that lies on those before it [m]."""
    if not laid:
        return 0.0
    below = [under.top for under in laid if lie_over_each_other(under, ply)]
    return max(below, default=laid[0].bottom) + 0.5 * ply.thickness


def lie_over_each_other(one: PlySettings, other: PlySettings) -> bool:
    """Whether two plies cover a common part of the plane."""
    if one.blank.shape == other.blank.shape and one.center == other.center:
        return True
    area = one.contours.polygon.intersection(other.contours.polygon).area
    return bool(area > 1e-9 * math.prod(one.blank.extent))
