"""What a fabric may know beside the published law, each in a file of its own.

    scene table ─▶ what is stated, in plain NumPy ─▶ twin of the law's class, with its parameters
                                                          │
       response of the fabric (``fabric.py``) asks ◀──────┴── answers of the twin; else nothing

Each is a twin of the law's class (:mod:`lcmchain.materials.twins`): kernels of a fabric that states
none of it hold none of it.

=====================  =========================================================================
over the thickness     ``compaction``: stiffening, Eq. (23), or a constant C33;
                       ``shear_compaction``: sheared fabric is thicker, by an exponent or by a map;
                       ``pressure_table`` from ``pressure_curves``: such a map from measurements;
                       ``relaxation``: the pressure on a held gap falls
in shear               ``shear``: polynomial, Eq. (21), and locking; ``unlike_sides``: another one
                       for negative angles; ``shear_friction``; ``viscous_shear``: what resists the
                       rate
in bending             ``bending_curve``: measured moments; ``bending_losses``: friction and rates
of each element        ``temperature_field``: times by its temperature
=====================  =========================================================================

What several of them use: ``rheology`` (Maxwell's and Dahl's elements), ``elementary`` (exponential
and logarithm for kernels), ``viscous_table`` (scene tables of what is lost).
"""
