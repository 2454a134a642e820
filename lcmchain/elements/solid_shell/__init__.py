"""The solid-shell element Q1STs for textiles.

::

    table ─▶ body ─┬▶ geometry: reference data, once
                   ├▶ kernel: forces of all elements, from equations ─▶ the step
                   ├▶ frequency, cut_frequency: bound of the highest frequency
                   └▶ energies: what is stored, and stretches, between steps

``equations`` holds the element of the paper, one small function for each equation; ``reference`` is
the same element once more, plainly, and tests compare the two. ``tangent`` serves statics.
``curvature`` is shared by neighbours for the thickness, ``pressure`` is what others exert,
``bending`` an option, and ``effects`` says what is compiled and why. ``together`` makes one body of
several of a kind for the loop.
"""
