"""The 2D approach: superimposed membrane and rotation-free shell triangles.

::

    table ─▶ body ─┬▶ patch: reference geometry, once
                   ├▶ kernel: forces, energies and frequency bound, from equations ─▶ the step
                   └▶ membrane: the same without the shell part
"""
