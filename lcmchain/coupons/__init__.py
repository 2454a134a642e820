"""Coupon tests of fabrics: simulated specimens beside their closed forms.

    material ─▶ scene and supports of the test ─▶ specimen: record ─▶ curves ─┬▶ result ─▶ files
                                                                  analytic ───┘

Each test has a file with its specimen, its supports and its curves: ``bias_extension``,
``picture_frame``, ``off_axis``, ``compaction``, ``cantilever``, ``pure_bending``. ``specimen.py``
makes and records the simulation, ``analytic`` has the closed forms, ``result.py`` compares both,
writes files and draws. ``pulled.py`` lists by name the tests in which a specimen is pulled: studies
run them.
"""
