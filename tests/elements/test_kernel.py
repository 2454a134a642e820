"""The compiled element kernel against the plainly written reference element, and its code."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
import pytest
from numba import njit, typeof

from lcmchain.elements.blocks import from_blocks, in_blocks
from lcmchain.elements.solid_shell.energies import strain_energies
from lcmchain.elements.solid_shell.kernel import (
    GENERAL,
    element_forces,
)
from lcmchain.elements.solid_shell.reference import ElementOptions, ReferenceElement
from lcmchain.errors import InputError
from lcmchain.materials.fabric_with_set import FabricWithSet
from lcmchain.materials.features.bending_losses import BendingLosses, DirectionLosses
from lcmchain.materials.features.rheology import Friction, Relaxation
from lcmchain.materials.features.shear import ShearLocking
from lcmchain.materials.features.shear_compaction import PowerCoupling
from lcmchain.materials.features.shear_friction import ShearFriction
from lcmchain.materials.features.viscous_shear import ViscousShear
from lcmchain.materials.law import Step
from lcmchain.materials.st_venant_kirchhoff import StiffnessLaw
from lcmchain.verification import random_elements

# Every combination of effect slots that is compiled once; numbers (moments, the weight of the
# shear row, material parameters) vary within a combination at no cost.
FABRIC_FLAT = ("fabric", "flat", "normal", "conservative")
FULL_CURVED = ("full", "curved", "normal", "conservative")
FABRIC_MIXED = ("fabric", "mixed", "normal", "conservative")
FABRIC_ALIGNED = ("fabric", "aligned", "normal", "conservative")
COUPLED_FABRIC = ("coupled fabric", "aligned and mixed", "normal", "conservative")
FABRIC_WITH_ALL = ("fabric with all", "aligned", "normal", "conservative")
COMBINATIONS = [
    FABRIC_FLAT,
    FABRIC_ALIGNED,
    ("fabric", "aligned", "director", "published"),
    ("fabric", "aligned and mixed", "normal", "conservative"),
    ("fabric", "curved", "normal", "conservative"),
    FULL_CURVED,
    FABRIC_MIXED,
    ("full", "mixed", "director", "conservative"),
    ("orthotropic", "aligned and mixed", "normal", "conservative"),
    COUPLED_FABRIC,
]
# Each choice in these stands in one of those above, with another neighbour.
MORE_COMBINATIONS = [
    ("full", "aligned", "director", "conservative"),
    ("fabric", "flat", "director", "published"),
    ("fabric", "curved", "director", "conservative"),
    ("full", "flat", "normal", "conservative"),
    ("full", "curved", "director", "conservative"),
]
ELEMENT_COUNT = 37  # two full blocks of 16 lanes and a part of a third
CURVED_OF_MIXED = [16, 20, 31]  # the second block has elements of both kinds, the others flat ones
VISCOUS = ViscousShear(
    viscosity=2e3,
    infinite_viscosity=50.0,
    time_constant=0.05,
    exponent=0.3,
    terms=(Relaxation(0.3e6, 1e-3), Relaxation(0.1e6, 0.5)),
)
RUBBING = ShearFriction(5e3, 0.02, 0.3)
LOSSES = BendingLosses(
    (
        DirectionLosses(Friction(0.02, 4.0), 3e-4, (Relaxation(0.01, 1e-3),)),
        DirectionLosses(Friction(0.01, 2.0), 0.0, (Relaxation(0.02, 0.1),)),
    ),
    random_elements.THICKNESS,
)
STEP = Step(2e-4, 0.3)
CURVED = {"flat": (), "aligned": (), "curved": range(ELEMENT_COUNT)}


@dataclass
class Batch:
    """Random elements of one kind, deformed, with the model that packs them."""

    X: np.ndarray
    fibres: np.ndarray
    x: np.ndarray
    material: object
    options: ElementOptions
    model: object

    def reference(self):
        return [
            ReferenceElement(X, fibre, self.material, self.options).evaluate(x)
            for X, fibre, x in zip(self.X, self.fibres, self.x, strict=True)
        ]


def fabric_with_all():
    """A fabric that remembers, locks, thickens by shear, bends by curves, rubs, resists rates."""
    return FabricWithSet(
        random_elements.md600().law,
        0.3,
        thickness=random_elements.THICKNESS,
        areal_mass=0.6,
        fibre_density=1810.0,
        locking=ShearLocking.from_angle(0.8, 80e6),
        coupling=PowerCoupling(0.8),
        bending_curves=random_elements.CURVES,
        viscous=VISCOUS,
        bending_losses=LOSSES,
        shear_friction=RUBBING,
    )


@pytest.fixture(scope="session")
def batch(make):
    def build(combination, **options):
        material_kind, shape, compaction_strain, hourglass = combination
        rng = np.random.default_rng(7)
        materials = {
            "fabric": make.md600,
            "coupled fabric": lambda: make.md600(
                coupling=PowerCoupling(0.8), bending_curves=random_elements.CURVES
            ),
            "fabric with all": fabric_with_all,
            "orthotropic": lambda: make.orthotropic(rng),
            "full": lambda: make.coupled(rng),
        }
        material = materials[material_kind]()
        curved = CURVED.get(shape, CURVED_OF_MIXED)
        X, fibres = map(
            np.array,
            zip(
                *(
                    make.curved_reference(rng)
                    if i in curved
                    else make.flat_reference(rng, aligned="aligned" in shape)
                    for i in range(ELEMENT_COUNT)
                )
            ),
        )
        x = np.array([make.deformed(rng, *element) for element in zip(X, fibres)])
        options = ElementOptions(
            compaction_strain=compaction_strain, hourglass=hourglass, **options
        )
        model = make.separate_elements(X, fibres, material, options)
        return Batch(X, fibres, x, material, options, model)

    return build


@pytest.fixture(scope="session")
def forces_of(make):
    """Forces (E, 8, 3) of the compiled kernel, element by element."""

    def forces(batch):
        return make.corner_forces(batch.model, make.positions_of(batch.x))

    return forces


def assert_agree(batch, forces):
    for result, force in zip(batch.reference(), forces, strict=True):
        scale = abs(result.force).max()
        np.testing.assert_allclose(force, result.force, rtol=0.0, atol=1e-12 * scale)


def slow(*cases):
    """These cases, for the slow run."""
    return [pytest.param(case, marks=pytest.mark.slow) for case in cases]


@pytest.mark.parametrize("combination", COMBINATIONS + slow(*MORE_COMBINATIONS), ids=" ".join)
def test_forces_agree_with_the_reference_element(batch, forces_of, combination):
    case = batch(combination)
    kind, shape, strain, hourglass = combination
    options = case.model.only_body().data.options
    is_flat = shape in ("flat", "aligned")
    assert (options.flat is None, options.curved is None) == (not is_flat, is_flat)
    assert (options.director is None) == (strain == "normal")
    assert (options.conservative is None) == (hourglass == "published" or "fabric" not in kind)
    assert (options.enhanced is None) == ("fabric" in kind and is_flat)
    data = case.model.only_body().data
    assert (data.quick_data is None) == (shape in ("flat", "curved"))
    assert (data.general is None) == (shape == "aligned")
    if data.quick_data is not None:
        mixed = shape != "aligned"
        assert (data.quick_data.start != GENERAL).tolist() == [True, not mixed, True]
        assert (data.quick_options.enhanced is None) == ("fabric" in kind)
        assert (data.quick_options.aligned is None) == (shape == "mixed")
    assert_agree(case, forces_of(case))


# What is switched on in code of its own, and the combinations that take it on each of their ways;
# mixed blocks are flat ones too. All else is a number.
SWITCHED_ON = {
    "cross_terms": [FULL_CURVED, FABRIC_MIXED],
    "bending_thickness": [FABRIC_ALIGNED, FULL_CURVED, FABRIC_MIXED],
}
OPTIONS = [
    {"integration_points": 2},
    {"integration_points": 5, "in_plane_shear_hourglass": False},
    {"cross_terms": True, "integration_points": 2},
    {"fibre_hourglass": 0.1},
    {"cross_terms": True, "in_plane_shear_hourglass": False},
    {"bending_thickness": "reference", "integration_points": 2},
]


def with_options():
    """Yield combinations with options; the slow run has all."""
    for options in OPTIONS:
        for combination in (FABRIC_FLAT, FABRIC_ALIGNED, FULL_CURVED, FABRIC_MIXED):
            on = [SWITCHED_ON[name] for name in options if name in SWITCHED_ON]
            is_slow = any(combination not in combinations for combinations in on)
            marks = [pytest.mark.slow] * is_slow
            yield pytest.param(
                combination, options, marks=marks, id=f"{options}-{' '.join(combination)}"
            )


@pytest.mark.parametrize(("combination", "options"), list(with_options()))
def test_forces_agree_under_every_option(batch, forces_of, combination, options):
    if combination is FULL_CURVED and options.get("fibre_hourglass") == 0.1:
        with pytest.raises(InputError, match="element.fibre_hourglass: is 0.1, but only a law"):
            batch(combination, **options)
        return
    case = batch(combination, **options)
    assert_agree(case, forces_of(case))


def test_a_flat_element_has_the_same_forces_as_a_curved_one(batch, forces_of, make):
    """A warped element makes its block take the general path; the others do not notice."""
    flat = batch(FABRIC_FLAT)
    rng = np.random.default_rng(8)
    warped, fibre = make.curved_reference(rng)
    before = [0, 16, 32]  # one for each block
    general = make.separate_elements(
        np.insert(flat.X, before, warped, axis=0),
        np.insert(flat.fibres, before, fibre, axis=0),
        flat.material,
        flat.options,
    )
    assert general.only_body().data.options.curved is not None
    assert general.only_body().data.quick_data is None
    x = np.insert(flat.x, before, warped, axis=0)
    is_warped = np.insert(np.zeros(ELEMENT_COUNT, dtype=bool), before, True)
    forces = forces_of(Batch(None, None, x, None, None, general))
    expected = forces_of(flat)
    scale = abs(expected).max(axis=(1, 2))[:, None, None]
    np.testing.assert_allclose(forces[~is_warped] / scale, expected / scale, rtol=0.0, atol=1e-11)
    assert abs(forces[is_warped]).max() < 1e-9 * abs(expected).max()


@pytest.mark.parametrize(
    "combination, options",
    [
        (FABRIC_FLAT, {}),
        (COUPLED_FABRIC, {}),
        (FABRIC_FLAT, {"bending_thickness": "reference"}),
        (FULL_CURVED, {}),
        (FULL_CURVED, {"cross_terms": True}),
        (FULL_CURVED, {"bending_thickness": "reference"}),
    ],
    ids=str,
)
def test_stored_energies_agree_with_the_reference_element(batch, make, combination, options):
    case = batch(combination, **options)
    if case.options.cross_terms:  # only with C^M = C^B do the cross terms have a potential
        case.material.C_bending = case.material.C_membrane
        stiffness = case.material.C_membrane.ravel()
        case.material.law = StiffnessLaw(stiffness, stiffness)
        case.model = make.separate_elements(case.X, case.fibres, case.material, case.options)
    model, count = case.model, case.model.only_body().data.corner_node.size // 8
    strain, bending, hourglass = np.empty((count, 6)), np.empty(count), np.empty(count)
    positions = make.positions_of(case.x)
    strain_energies(model.only_body().data, positions, np.empty(0), strain, bending, hourglass)
    real = slice(ELEMENT_COUNT)
    membrane = case.material.membrane_energy(strain[real]) * model.only_body().geometry.volume
    results = case.reference()
    np.testing.assert_allclose(
        membrane + bending[real], [result.energy for result in results], rtol=1e-11
    )
    np.testing.assert_allclose(
        hourglass[real], [result.hourglass_energy for result in results], rtol=1e-11
    )


def test_thickness_stretch_is_that_of_the_normal(batch, make):
    """a3·n of the mid-surface over its reference value; a turned-over element shows as negative."""
    case = batch(FABRIC_FLAT)
    case.x[5] = case.x[5][[4, 5, 6, 7, 0, 1, 2, 3]]
    model = case.model
    stretch = (
        model.only_body()
        .condition(make.positions_of(case.x), model.only_body().no_history())
        .thickness_stretch
    )

    def half_thickness(nodes):
        a1, a2, a3 = make.cube.T @ nodes / 8.0
        normal = np.cross(a1, a2)
        return a3 @ normal / np.linalg.norm(normal)

    expected = [half_thickness(x) / half_thickness(X) for x, X in zip(case.x, case.X, strict=True)]
    np.testing.assert_allclose(stretch[:ELEMENT_COUNT], expected, rtol=1e-12)
    assert (stretch[:ELEMENT_COUNT] < 0.0).nonzero()[0].tolist() == [5]


def processor_flags():
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            return next((set(line.split()) for line in file if line.startswith("flags")), set())
    except OSError:
        return set()


ARITHMETIC = r"v?(?:add|sub|mul|div|fn?m(?:add|sub)(?:132|213|231))"


def lane_loops(assembly):
    """Numbers of packed and of scalar operations in straight runs of packed code, falling."""
    found = []
    for block in re.split(r"\n\.?L?\w+:|\n\s+j\w+\s", assembly):  # cut at labels and jumps
        vectors = len(re.findall(rf"\b{ARITHMETIC}pd\b.*%[yz]mm", block))
        found.append((vectors, len(re.findall(rf"\b{ARITHMETIC}sd\b", block))))
    return sorted(found, reverse=True)


def arguments_of(case, make, history):
    data = case.model.only_body().data
    return (
        make.positions_of(case.x),
        data.corner_node,
        data.corner_run,
        data.element_data,
        np.zeros(case.model.corner_force_size),
        history,
        data.law,
        data.options,
        data.quick_data,
        data.quick_options,
        data.general,
    )


def compiled(kernel, arguments):
    """Compile a kernel anew: code loaded from the disk cache cannot be inspected."""
    options = {k: v for k, v in kernel.targetoptions.items() if k != "nopython"}
    fresh = njit(**options)(kernel.py_func)
    fresh.compile(tuple(map(typeof, arguments)))
    return fresh


@pytest.fixture(scope="session")
def fabric_with_all_compiled(batch, make):
    """The kernel of a step for a fabric that knows everything, and its elements."""
    case = batch(FABRIC_WITH_ALL, bending_thickness="reference")
    arguments = (*arguments_of(case, make, np.zeros(1)), *STEP)
    return compiled(element_forces, arguments), case


def test_forces_that_depend_on_the_rate_agree_with_the_reference_element(
    fabric_with_all_compiled, make
):
    """And on friction; and so does what the law remembers, behind the largest compaction."""
    kernel, case = fabric_with_all_compiled
    elements = [
        ReferenceElement(*own, case.material, case.options) for own in zip(case.X, case.fibres)
    ]
    strains = [own.strain(x)[0] for own, x in zip(elements, case.x)]
    strain = np.array([own["centre"] for own in strains])
    curvature = np.array([own["zeta"][:2] / e.height for own, e in zip(strains, elements)]).T
    rng = np.random.default_rng(11)
    past = np.zeros((9 + len(LOSSES.memory), ELEMENT_COUNT))
    past[1:9] = rng.uniform(-1e4, 1e4, (8, ELEMENT_COUNT))
    past[[1, 6]] = strain[:, 3] + rng.uniform(-5e-3, 5e-3, (2, ELEMENT_COUNT))
    past[9:] = rng.uniform(-0.05, 0.05, (len(LOSSES.memory), ELEMENT_COUNT))
    past[9:11] = curvature + rng.uniform(-1.0, 1.0, (2, ELEMENT_COUNT))
    history = in_blocks(np.concatenate([np.zeros((4, ELEMENT_COUNT)), past]).T)
    arguments = arguments_of(case, make, history)
    kernel(*arguments, *STEP)
    rows = from_blocks(arguments[4][: case.model.placed[0].last_force], 24, ELEMENT_COUNT)
    forces = rows.reshape(ELEMENT_COUNT, 8, 3)
    results = [own.evaluate(x, p, STEP) for own, x, p in zip(elements, case.x, past.T)]
    frozen = [own.evaluate(x) for own, x in zip(elements, case.x)]
    scales = [abs(result.force).max() for result in results]
    for result, scale, force in zip(results, scales, forces):
        np.testing.assert_allclose(force, result.force, rtol=0.0, atol=1e-12 * scale)
    changes = [abs(own.force - still.force).max() for own, still in zip(results, frozen)]
    assert np.median(np.divide(changes, scales)) > 1e-4
    after = case.model.only_body().element_history(history)
    expected = VISCOUS.in_step(strain[:, 3], past[1:6], STEP.size)
    np.testing.assert_allclose(after[1:6], expected, rtol=1e-9)
    expected = RUBBING.in_step(strain[:, 3], past[6:9], case.material._shear(strain[:, 3])[0])
    np.testing.assert_allclose(after[6:9], expected, rtol=1e-9)
    expected = LOSSES.in_step(curvature, past[9:], STEP.size)
    np.testing.assert_allclose(after[9:], expected, rtol=1e-8, atol=1e-12)
    assert (after[0] < 0.0).any()


MORE_LOOPS = [
    (FABRIC_FLAT, "current"),
    (FULL_CURVED, "current"),
    *((combination, "reference") for combination in (FABRIC_FLAT, FABRIC_ALIGNED, FABRIC_MIXED)),
]


@pytest.mark.skipif("avx2" not in processor_flags(), reason="the processor has no AVX2")
@pytest.mark.parametrize(
    "combination, bending_thickness",
    [
        (FABRIC_ALIGNED, "current"),
        (FABRIC_MIXED, "current"),
        (FULL_CURVED, "reference"),
        (FABRIC_WITH_ALL, "reference"),
        *(pytest.param(*case, marks=pytest.mark.slow) for case in MORE_LOOPS),
    ],
    ids=str,
)
def test_the_lane_loop_is_packed(
    batch, make, fabric_with_all_compiled, combination, bending_thickness
):
    """The arithmetic of the element runs on vectors, with a memory of the law too.

    A function that is not inlined, a call, a division that may raise, or a store to what might be
    read would leave it scalar; a stack that begins anywhere costs a fifth.
    """
    if combination is FABRIC_WITH_ALL:
        fresh, _ = fabric_with_all_compiled
    else:
        case = batch(combination, bending_thickness=bending_thickness)
        fresh = compiled(element_forces, (*arguments_of(case, make, np.empty(0)), 0.0, 0.0))
    (assembly,) = fresh.inspect_asm().values()
    loops = lane_loops(assembly)[: 2 if combination is FABRIC_MIXED else 1]
    for packed, scalar in loops:
        assert packed > 300
        assert scalar < 0.05 * packed
    # what has no register lies in whole lines of the cache
    assert not re.search(r"vmovupd\s+(%[yz]mm\d+, )?-?\d*\(%rsp\)", assembly)
