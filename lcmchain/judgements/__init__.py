"""Judgements of a result: one place for a measure, its limit, its grade, its words and its remedy.

::

    thresholds ─▶ quasi_static   pace, energies, rest, snaps, resolution   ┐
                  contact        depth in tools and plies, what it hides   ├─▶ verdicts ─▶ report
                  fields         waves, strain of fibres, shear, packing   ┘   (and mappings)
                    └ crossings  a sheet that passes through itself
                        │
                        └─▶ warnings of ``summary.json``, which terminal and report repeat

A measure has a warning, which a run gives with the value that cures it, and a verdict, which is
good, doubtful or bad (``grades``). Both stand side by side and read the same threshold, so that a
check is doubtful exactly where the summary warns.
"""
