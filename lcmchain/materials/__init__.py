"""Material laws: second Piola-Kirchhoff stress and tangent, each with its source.

    [material] ─▶ laws: the table of that law ─▶ build() ─▶ Material: in plain NumPy, and its law,
                                                            a NamedTuple of numbers
                                                                 │
                     kernels ask by the type of the law ◀────────┴─ law: what a law answers

- The protocol: ``law.py`` says what a law answers and how kernels find it; ``stiffness.py``, in
  which forms a stiffness comes; ``table.py``, what the scene tables share; ``laws.py``, which laws
  a scene can choose.
- Laws, one file each: ``fabric.py``, ``fabric_with_set.py``, ``fibre_families.py``,
  ``st_venant_kirchhoff.py``; films: ``neo_hooke.py`` and ``ogden.py``, on ``hyperelastic.py``.
- What a fabric may know beside the published law, one file each, made as a twin of the law's class
  (``twins.py``; those with names in ``variants.py``), so that kernels of another fabric hold none
  of it. Thickness: ``compaction.py``, ``relaxation.py``; ``shear_compaction.py`` and
  ``pressure_table.py`` (with ``pressure_table_file.py``), both on ``strain_map.py``. Shear:
  ``shear_locking.py``, ``shear_friction.py``, ``viscous_shear.py``. Bending: ``bending_curve.py``,
  ``bending_losses.py``. ``temperature_field.py``: times of each element. Their scene tables stand
  in ``viscous_table.py`` and with the fabric.
- What several of them use: ``maxwell.py`` and ``dahl.py`` (moments that relax, or rub),
  ``elementary.py`` (exponential and logarithm), ``rounded_shear.py`` (a shear without a kink).
- ``shear_waves.py``: how fast a process may go.
"""
