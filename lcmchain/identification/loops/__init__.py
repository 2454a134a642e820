"""Loops of coupon tests, there and back: an elastic law and Dahl's friction, fitted together.

    rows there and back ─▶ bending ─┐                        ┌─▶ judgement: does friction after Dahl
      (curvature, shear) ─▶ shear ──┴─▶ fit: law and Loops ──┘    describe them, branch by branch?
                                                             └─▶ parameters, notes, diagrams

``bending.py`` (moment over curvature) and ``shear.py`` (picture frames) say what their tests
measure and name what was found; ``fit.py`` fits any loop; ``judgement.py`` judges the fit.
"""
