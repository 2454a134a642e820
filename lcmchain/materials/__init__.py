"""Material laws: second Piola-Kirchhoff stress and tangent, each with its source.

    [material] ─▶ laws: the table of that law ─▶ build() ─▶ Material: in plain NumPy, and its law,
                                                            a NamedTuple of numbers
                                                                 │
                     kernels ask by the type of the law ◀────────┴─ law: what a law answers

- **Laws, one file each**: ``fabric``, ``fabric_with_set``, ``fibre_families``,
  ``st_venant_kirchhoff``; films: ``neo_hooke`` and ``ogden``, both on ``hyperelastic``.
- **What a fabric may know beside the published law**: the folder ``features``.
- What all of them share: ``law`` (what a law answers, and how kernels find it), ``stiffness`` (in
  which forms a stiffness comes), ``table`` (entries of scene tables), ``twins`` (a class of laws
  that answers one thing more), ``laws`` (those that a scene can choose), ``shear_waves`` (how fast
  a process may go).
"""
