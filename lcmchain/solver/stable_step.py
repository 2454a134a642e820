"""Upper bound of an element's highest frequency, from its present tangent and stress.

In the space of the mode vectors the element stiffness is K = Σ_i d_i b_i b_iᵀ + Σ ⊗ 1, with one row
b_i for every strain component of every Taylor term (Eq. 10), the weights d_i of Eqs. (15) and (16)
times the tangent, and the generalised stresses Σ of ``stress_matrix``. With equal nodal masses m/8
the highest circular frequency obeys ω² = λ_max(K)/m, and the block form of Gershgorin's theorem
bounds λ_max by the largest row sum Σ_l ‖K_kl‖ over the seven modes. For a fibre-aligned rectangle
the bound is exact.
"""

from __future__ import annotations

import numpy as np

from lcmchain.elements.reference import _PRODUCTS, TERMS

CHUNK = 64
IN_PLANE, THICKNESS = 0, 1

# (term, component, mode k, mode l, factor) of every product a_k·a_l in the covariant strains
_TABLE = [
    (TERMS.index(term), component, k - 1, m - 1, factor)
    for term, components in _PRODUCTS.items()
    for component, products in components.items()
    for factor, k, m in products
]
PRODUCT_INDEX = np.array([entry[:4] for entry in _TABLE], dtype=np.int64)
PRODUCT_FACTOR = np.array([entry[4] for entry in _TABLE])
