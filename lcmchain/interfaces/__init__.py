"""Contact between plies: deformable to deformable, with large sliding and meshes that do not match.

::

    [[interfaces]] ─▶ table ─▶ surfaces: faces as points and facets, all that stays constant
                                  │
      now and then   refresh ─────┤ search: which facet a point faces; springs: where it lies on it
                        │         │ rims: the share of its area over the other ply
                        ▼         ▼
      every step     forces ◀── rows: what a point has ◀── laws (law, slip)

``change`` is what happens where a stage brings another
interface, ``in_frames`` what a saved frame holds.
"""
