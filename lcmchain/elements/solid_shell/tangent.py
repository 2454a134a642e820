"""Consistent tangent of the element's internal forces, for quasi-static and vibration analyses.

In the space of the mode vectors the forces are p = 8 J⁰ Bᵀ R: B the gradients of the material
strains of the seven Taylor terms of Eq. (10), R the stress resultants of Eqs. (15) and (16). Their
derivative is

    K = 8 J⁰ (Bᵀ D B + Σ ⊗ 1 + S33 ∇²E33),   D = ∂R/∂E,

with Σ the generalised stresses of the products a_k·a_l, and the last term only where compaction is
measured by the normal thickness, which is no such product. K is symmetric where the element has a
potential: not for cross terms with C^M ≠ C^B (Eq. 19), an enhanced strain that couples different
C^M and C^B, or hourglass forces as published.

Plain NumPy over blocks of elements, written separately from the compiled kernel.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from lcmchain.elements.blocks import from_blocks
from lcmchain.elements.family import Body
from lcmchain.elements.solid_shell.equations import NINTH, THIRD
from lcmchain.elements.solid_shell.geometry import COVARIANT_PRODUCTS, MODES, TERMS
from lcmchain.elements.solid_shell.kernel import CURVATURE_ROWS
from lcmchain.materials.law import (
    bending_response,
    bends_by_curves,
    stabilising_tangent,
    tangent_coupling_of,
)

# bounds the temporary arrays to about 50 MB
ELEMENTS_PER_BLOCK = 512

CENTRE, ZETA, ZETA2, XI, ETA, ETA_ZETA, XI_ZETA = range(7)
HOURGLASS = [XI, ETA]
NORMAL, SHEAR = 2, 3  # Voigt components 33 and 12

_PRODUCTS = [
    (TERMS.index(term), component, factor, k - 1, m - 1)
    for term, component, products in COVARIANT_PRODUCTS
    for factor, k, m in products
]
# (term, source, direction): the term receives the change of T along ξ (0), η (1) or ζ (2) times
# the covariant source term, as in ``curved_material_strain``
_CURVED = (
    (ZETA, CENTRE, 2),
    (ZETA2, ZETA, 2),
    (XI, CENTRE, 0),
    (ETA, CENTRE, 1),
    (ETA_ZETA, ZETA, 1),
    (ETA_ZETA, ETA, 2),
    (XI_ZETA, ZETA, 0),
    (XI_ZETA, XI, 2),
)

# Products of modes (counted from 0) in the shared curvature's part of E33, and their row there
_CURVATURE_PRODUCTS = ((0, 5, 0), (1, 4, 1), (0, 4, 2), (1, 5, 2))

# Mode vectors from the corners' means and half differences of top and bottom, (7, 8): the means
# (first four columns) only enter a1, a2, a4, the half differences only a3, a5, a6, a7.
PAIR_MODES = MODES @ np.block([[np.eye(4), -np.eye(4)], [np.eye(4), np.eye(4)]])


class Linearisation(NamedTuple):
    """Tangent of E elements and what a mixed iteration keeps of them.

    stiffness : (E, 7, 3, 7, 3), derivative of the forces on the mode vectors [N/m].
    resultants : (E, 42) stress resultants R per volume [Pa].
    resultant_gradient : (E, 42, 21), D B: their change with the mode vectors.
    """

    stiffness: np.ndarray
    resultants: np.ndarray
    resultant_gradient: np.ndarray


class LinearisedModel(Protocol):
    """What is read of a model of one sheet; it is above the elements."""

    @property
    def element_count(self) -> int: ...
    @property
    def history_size(self) -> int: ...
    def only_body(self, asked_by: str) -> Body: ...
    def renew(self, positions: np.ndarray, history: np.ndarray) -> object: ...


def linearise(
    model: LinearisedModel,
    displacement: np.ndarray,
    resultants: np.ndarray | None = None,
    history: np.ndarray | None = None,
) -> Linearisation:
    """Linearise the internal forces of all elements of a model about a displacement.

    Parameters
    ----------
    model : :class:`lcmchain.model.Model`.
    displacement : (3, node_count) [m].
    resultants : (E, 42) stress resultants [Pa] for the geometric stiffness in place of those of the
        displacement, see ``statics/newton.py``.
    history : (history_size,), what elements share with neighbours, taken as constant; that of the
        displacement by default.

    Raises
    ------
    InputError : the model has several sheets.
    """
    count = model.element_count
    body = model.only_body("the tangent of the elements")
    if history is None:
        history = np.zeros(model.history_size)
        model.renew(body.mesh.node_positions.T + displacement, history)
    shared = from_blocks(history, body.history_count, count)[:, :CURVATURE_ROWS]
    result = Linearisation(
        np.empty((count, 7, 3, 7, 3)), np.empty((count, 42)), np.empty((count, 42, 21))
    )
    for first in range(0, count, ELEMENTS_PER_BLOCK):
        block = slice(first, min(first + ELEMENTS_PER_BLOCK, count))
        given = None if resultants is None else resultants[block]
        part = _linearise_block(body, displacement, block, given, shared)
        for whole, piece in zip(result, part, strict=True):
            whole[block] = piece.reshape(whole[block].shape)
    return result


def node_stiffness(mode_stiffness: np.ndarray, basis: np.ndarray = MODES) -> np.ndarray:
    """Return the tangent (E, 24, 24) [N/m] on eight vectors from that on the mode vectors.

    ``basis`` (7, 8) gives the mode vectors from them: :data:`MODES` from the corner nodes,
    :data:`PAIR_MODES` from means and half differences over the thickness. In thin elements the
    latter spare the tangent the cancellation of large thickness stiffnesses.
    """
    count = len(mode_stiffness)
    half = np.tensordot(mode_stiffness, basis, axes=(3, 0))  # (E, 7, 3, 3, 8)
    full = np.tensordot(half, basis, axes=(1, 0))  # (E, 3, 3, 8, 8)
    return full.transpose(0, 4, 1, 3, 2).reshape(count, 24, 24)


def _linearise_block(body, displacement, block, given, shared):
    options = body.data.options
    A = body.geometry.modes[block]
    corner = displacement.T[body.mesh.elements[block]]
    change = np.einsum("kn,end->ekd", MODES, corner)
    a = A + change
    B, E = _strains(body, block, A, change)
    if options.director is None:
        height = body.geometry.height[block]
        E[:, CENTRE, NORMAL], gradient, hessian = normal_compaction(a[:, :3], height)
        B[:, CENTRE, NORMAL] = 0.0
        B[:, CENTRE, NORMAL, :9] = gradient
        curvature = shared[block]
        E[:, CENTRE, NORMAL] -= curvature[:, 3]
        for k, m, column in _CURVATURE_PRODUCTS:
            factor = curvature[:, column]
            E[:, CENTRE, NORMAL] += factor * np.einsum("ed,ed->e", a[:, k], a[:, m])
            row = B[:, CENTRE, NORMAL].reshape(-1, 7, 3)
            row[:, k] += factor[:, None] * a[:, m]
            row[:, m] += factor[:, None] * a[:, k]
    unscaled = B
    if options.reference_bending is not None:
        B, E = at_reference_thickness(B, E)
    R, D = _resultants(body, E, block)
    R, D, B = R.reshape(-1, 42), D.reshape(-1, 42, 42), B.reshape(-1, 42, 21)

    DB = D @ B
    K = B.transpose(0, 2, 1) @ DB
    geometric = (R if given is None else given).reshape(-1, 7, 6)
    if options.reference_bending is not None:
        hessian33, geometric = geometric_part(unscaled, E, geometric)
        K += hessian33
    S33 = geometric[:, CENTRE, NORMAL].copy()
    if options.director is None:
        K[:, :9, :9] += S33[:, None, None] * hessian
        geometric = geometric.copy()
        geometric[:, CENTRE, NORMAL] = 0.0
    sigma = _stress_matrix(body, block, geometric)
    if options.director is None:
        for k, m, column in _CURVATURE_PRODUCTS:
            sigma[:, k, m] += S33 * curvature[:, column]
            sigma[:, m, k] += S33 * curvature[:, column]
    blocks = K.reshape(-1, 7, 3, 7, 3)
    for d in range(3):
        blocks[:, :, d, :, d] += sigma
    blocks *= body.geometry.volume[block, None, None, None, None]
    return blocks, R, DB


def _strains(body, block, A, change):
    """Return gradients (E, 7, 6, 21) and values (E, 7, 6) of the material strains, Eq. (10)."""
    a = A + change
    covariant = np.zeros((len(a), 7, 6, 22))  # 21 gradients, then the strain itself
    for term, component, f, k, m in _PRODUCTS:
        row = covariant[:, term, component]
        row[:, 3 * k : 3 * k + 3] += f * a[:, m]
        row[:, 3 * m : 3 * m + 3] += f * a[:, k]
        # a_k·a_m - A_k·A_m without the cancellation of its two parts
        row[:, 21] += f * np.einsum("ed,ed->e", change[:, k], a[:, m])
        row[:, 21] += f * np.einsum("ed,ed->e", A[:, k], change[:, m])
    material = body.data.transformation[block][:, None] @ covariant
    if body.data.options.curved is not None:
        T_change = body.data.transformation_change[block]
        for term, source, direction in _CURVED:
            material[:, term] += T_change[:, direction] @ covariant[:, source]
    if body.data.options.in_plane_shear != 1.0:
        material[:, HOURGLASS] = _shear_scaling(body, block)[:, None] @ material[:, HOURGLASS]
    return material[..., :21].copy(), material[..., 21].copy()


def _stress_matrix(body, block, S):
    """Return Σ (E, 7, 7) of material stress resultants S (E, 7, 6)."""
    if body.data.options.in_plane_shear != 1.0:
        S = S.copy()
        back = _shear_scaling(body, block).transpose(0, 2, 1)
        S[:, HOURGLASS] = (back[:, None] @ S[:, HOURGLASS, :, None])[..., 0]
    T = body.data.transformation[block].transpose(0, 2, 1)
    covariant = (T[:, None] @ S[..., None])[..., 0]
    if body.data.options.curved is not None:
        T_change = body.data.transformation_change[block]
        for term, source, direction in _CURVED:
            back = T_change[:, direction].transpose(0, 2, 1) @ S[:, term, :, None]
            covariant[:, source] += back[..., 0]
    sigma = np.zeros((len(S), 7, 7))
    for term, component, factor, k, m in _PRODUCTS:
        value = factor * covariant[:, term, component]
        sigma[:, k, m] += value
        sigma[:, m, k] += value
    return sigma


def _shear_scaling(body, block):
    """Return the maps (E, 6, 6) that weight the in-plane shear in the covariant axes."""
    T = body.data.transformation[block]
    unit, read = T[:, :, 3], np.linalg.inv(T)[:, 3]
    return np.eye(6) + (body.data.options.in_plane_shear - 1.0) * _outer(unit, read)


def _resultants(body, E, block):
    """Return R (E, 7, 6) of Eqs. (15) and (16) and D = ∂R/∂E (E, 7, 6, 7, 6)."""
    options, material = body.data.options, body.material
    S_centre, C_M = material.stress_and_tangent(E[:, CENTRE])
    C_B = material.bending_matrix()
    height = body.geometry.height[block]
    S_zeta, C_zeta, _ = bending_response(material, E[:, ZETA], height)
    if options.enhanced is not None:
        # the enhanced strain -S33^ζ / C^M_33 of ``condensed_enhanced_strain`` adds C^M_i3 of it
        column = C_M[:, :, NORMAL]
        if material.is_diagonal:
            column = column * (np.arange(6) == NORMAL)
        share = column / C_M[:, NORMAL, NORMAL, None]
        C_zeta = C_zeta - share[:, :, None] * C_B[NORMAL]
        S_zeta = S_zeta - share * (E[:, ZETA] @ C_B[NORMAL])[:, None]
    fibres = np.array([1.0, 1.0, 0.0, 0.0, 0.0, 0.0])
    share = np.ones(6)
    terms = None
    if hasattr(material, "stabilising_terms"):
        terms = material.stabilising_terms(E[:, CENTRE])
        C_hg = _along_directions(terms, options.fibre_share)
    elif options.conservative is None:
        C_hg, slope = C_M, material.tangent_slope(E[:, CENTRE])
    else:
        C_hg, slope, curvature = stabilising_tangent(material, E[:, CENTRE])
    if material.is_diagonal:
        share = 1.0 - fibres + options.fibre_share * fibres
        C_hg = C_hg * share[:, None]
    D = np.zeros((len(E), 7, 6, 7, 6))
    D[:, CENTRE, :, CENTRE] = C_M
    D[:, CENTRE, :, ZETA2] = options.cross * C_B
    D[:, ZETA, :, ZETA] = options.zeta2 * C_zeta
    D[:, ZETA2, :, CENTRE] = options.cross * C_M
    D[:, ZETA2, :, ZETA2] = options.zeta4 * C_B
    for term, weight, C in (
        (XI, THIRD, C_hg),
        (ETA, THIRD, C_hg),
        (ETA_ZETA, NINTH, C_B),
        (XI_ZETA, NINTH, C_B),
    ):
        D[:, term, :, term] = weight * C
    # linear in every strain but that of the centre, and of the bending by a curve
    R = np.einsum("etipj,epj->eti", D[:, :, :, 1:], E[:, 1:])
    if bends_by_curves(material):
        R[:, ZETA] = options.zeta2 * S_zeta
    R[:, CENTRE] += S_centre
    R[:, ZETA2] += options.cross * S_centre

    # the hourglass terms ξ, η follow the tangent at the centre, Eq. (18)
    if terms is not None:
        if options.conservative is not None:
            _add_change_of_moduli(terms, E, R, D)
        return R, D
    slope = share * slope
    i = np.arange(6)
    for term in (XI, ETA):
        coupling = THIRD * slope * E[:, term]
        D[:, term, i, CENTRE, i] = coupling
        if options.conservative is not None:
            D[:, CENTRE, i, term, i] = coupling
    if options.conservative is not None:
        squares = E[:, XI] ** 2 + E[:, ETA] ** 2
        R[:, CENTRE] += 0.5 * THIRD * slope * squares
        D[:, CENTRE, i, CENTRE, i] += 0.5 * THIRD * share * curvature * squares
        _add_coupling(tangent_coupling_of(material, E[:, CENTRE]), E, squares, R, D)
    return R, D


def _along_directions(terms, fibre_share):
    """Return the stabilising stiffness (E, 6, 6) of moduli along directions."""
    modulus = terms.modulus * (1.0 + terms.fibre * (fibre_share - 1.0))
    return np.einsum("et,ti,tj->eij", modulus, terms.readers, terms.readers)


def _add_change_of_moduli(terms, E, R, D):
    """Add to R and D what moduli take from the strain of the centre that they depend on."""
    r = terms.readers
    read = E @ r.T
    squares = read[:, XI] ** 2 + read[:, ETA] ** 2
    R[:, CENTRE] += 0.5 * THIRD * (terms.slope * squares) @ r
    itself = 0.5 * THIRD * terms.curvature * squares
    D[:, CENTRE, :, CENTRE] += np.einsum("et,ti,tj->eij", itself, r, r)
    for term in (XI, ETA):
        pair = np.einsum("et,ti,tj->eij", THIRD * terms.slope * read[:, term], r, r)
        D[:, term, :, CENTRE] += pair
        D[:, CENTRE, :, term] += pair


def _add_coupling(coupling, E, squares, R, D):
    """Add to R and D what the stabilising C33 takes from the shear of the centre."""
    if coupling is None:
        return
    slope, mixed, curvature = coupling
    normal = 0.5 * THIRD * squares[:, NORMAL]
    R[:, CENTRE, SHEAR] += slope * normal
    D[:, CENTRE, SHEAR, CENTRE, SHEAR] += curvature * normal
    D[:, CENTRE, SHEAR, CENTRE, NORMAL] += mixed * normal
    D[:, CENTRE, NORMAL, CENTRE, SHEAR] += mixed * normal
    for term in (XI, ETA):
        pair = THIRD * slope * E[:, term, NORMAL]
        D[:, term, NORMAL, CENTRE, SHEAR] += pair
        D[:, CENTRE, SHEAR, term, NORMAL] += pair


def normal_compaction(
    a: np.ndarray, height: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return E33 = ½(t²/h² - 1) (E,) of the normal thickness, its gradient and its Hessian.

    ``a`` (E, 3, 3) are a1, a2, a3 and t = a3·(a1 x a2)/|a1 x a2|; the gradient is (E, 9), the
    Hessian (E, 9, 9).
    """
    a1, a2, a3 = a[:, 0], a[:, 1], a[:, 2]
    c = np.cross(a1, a2)
    J = np.einsum("ed,ed->e", a3, c)
    q = np.einsum("ed,ed->e", c, c)
    dJ = np.concatenate([np.cross(a2, a3), np.cross(a3, a1), c], axis=1)
    a11 = np.einsum("ed,ed->e", a1, a1)[:, None]
    a12 = np.einsum("ed,ed->e", a1, a2)[:, None]
    a22 = np.einsum("ed,ed->e", a2, a2)[:, None]
    dq = np.concatenate([2 * (a22 * a1 - a12 * a2), 2 * (a11 * a2 - a12 * a1)], axis=1)
    dq = np.pad(dq, ((0, 0), (0, 3)))

    ddJ = np.zeros((len(a), 9, 9))
    ddq = np.zeros((len(a), 9, 9))
    one, two, three = slice(0, 3), slice(3, 6), slice(6, 9)
    eye = np.eye(3)
    for rows, columns, upper in (
        (one, two, -_skew(a3)),
        (one, three, _skew(a2)),
        (two, three, -_skew(a1)),
    ):
        ddJ[:, rows, columns] = upper
        ddJ[:, columns, rows] = upper.transpose(0, 2, 1)
    upper = 2 * (2 * _outer(a1, a2) - _outer(a2, a1) - a12[..., None] * eye)
    ddq[:, one, one] = 2 * (a22[..., None] * eye - _outer(a2, a2))
    ddq[:, two, two] = 2 * (a11[..., None] * eye - _outer(a1, a1))
    ddq[:, one, two] = upper
    ddq[:, two, one] = upper.transpose(0, 2, 1)

    # t² = J²/q by the chain rule
    w = (J / q)[:, None]
    gradient = 2 * w * dJ - w**2 * dq
    step = dJ - w * dq
    w, q = w[..., None], q[:, None, None]
    hessian = 2 * _outer(step, step) / q + 2 * w * ddJ - w**2 * ddq
    h2 = height[:, None] ** 2
    strain = 0.5 * (J**2 / q[:, 0, 0] / height**2 - 1.0)
    return strain, 0.5 * gradient / h2, 0.5 * hessian / h2[..., None]


def _outer(a, b):
    return a[:, :, None] * b[:, None, :]


def _skew(v):
    """Return the matrices (E, 3, 3) of w -> v x w."""
    zero = np.zeros(len(v))
    x, y, z = v.T
    return np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 3, 3)


# --- bending at the reference thickness (:mod:`.bending`) ----------------------------------------

# Taylor terms of the bending, in the order of ``packing.TERMS``, and their powers of ζ
BENDING = [1, 2, 5, 6]
POWER = np.array([1.0, 2.0, 1.0, 1.0])


def at_reference_thickness(B: np.ndarray, E: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return gradients (E, 7, 6, 21) and strains (E, 7, 6) with the bending over powers of λ."""
    scale, r = _scale(E)
    strains, gradients = E.copy(), B.copy()
    strains[:, BENDING] *= scale[..., None]
    gradients[:, BENDING] *= scale[..., None, None]
    change = (POWER * r)[..., None] * strains[:, BENDING]
    gradients[:, BENDING] -= change[..., None] * B[:, CENTRE, NORMAL][:, None, None]
    return gradients, strains


def geometric_part(B: np.ndarray, E: np.ndarray, R: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return what the second derivatives of the scaled strains add to the tangent.

    Parameters
    ----------
    B : (E, 7, 6, 21) gradients before the scaling; E : (E, 7, 6) strains after it.
    R : (E, 7, 6) resultants of the scaled strains.

    Returns
    -------
    The products of first derivatives (E, 21, 21), and the resultants (E, 7, 6) of the unscaled
    strains, whose second derivatives the caller knows.
    """
    scale, r = _scale(E)
    b33 = B[:, CENTRE, NORMAL]
    work = np.einsum("eti,eti->et", R[:, BENDING], E[:, BENDING])
    along = np.einsum("et,eti,etij->ej", POWER * r * scale, R[:, BENDING], B[:, BENDING])
    pair = along[:, :, None] * b33[:, None, :]
    itself = np.sum(POWER * (POWER + 2.0) * r**2 * work, axis=1)
    K = itself[:, None, None] * b33[:, :, None] * b33[:, None, :]
    K -= pair + pair.transpose(0, 2, 1)
    unscaled = R.copy()
    unscaled[:, BENDING] *= scale[..., None]
    unscaled[:, CENTRE, NORMAL] -= np.sum(POWER * r * work, axis=1)
    return K, unscaled


def _scale(E: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return λ^-n of the bending terms (E, 4) and λ^-2 (E, 1)."""
    r = 1.0 / (1.0 + 2.0 * E[:, CENTRE, NORMAL, None])
    return r ** (0.5 * POWER), r
