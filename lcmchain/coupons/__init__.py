"""Coupon tests of fabrics: simulated specimens beside their closed forms.

Each test has a file with its specimen, its supports and its curves. ``specimen`` makes and records
the simulation, ``analytic`` has the closed forms, ``result`` compares both and writes files,
``plots`` draws. ``pulled`` lists by name the tests in which a specimen is pulled: studies run them.
"""
