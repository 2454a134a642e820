"""Pictures, plots and the report of a run.

::

    scene, forming.nc ─▶ start, pictures, stack_pictures, sections, plots
                                          │  by renderer, seen through view; style has colours,
                                          │  how fields are shown, files and captions;
                                          │  drawn_tools, fibre_segments: what of these is shown
                                          ▼
                                 run_pictures: all PNG files of a run, and its film
                                          │
    summary.json ─▶ numbers, chapters: what a run found, in words ──▶ terminal
                │                         │
                └─▶ lcmchain.judgements: grade, words and remedy of every measure
                                          ▼
    forming.nc ─────────────────────────▶ html: report.html, in one file

Drawing functions take the groups of a result or plain arrays, and know nothing of the solver.
"""

import lazy_loader

# The names are those of the stub beside this file; each is imported when it is first asked for.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
