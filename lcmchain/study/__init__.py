"""Studies: what accuracy costs in time, what effects change, what results depend on.

::

    scene file, coupon ─▶ sources: Variant, Job ─▶ runs ─▶ outcome: what is kept of a run
                                                              │
         comparison: how two outcomes differ ◀────────────────┤
              │                                               ▼
         convergence: error and time by edge length    results: numbers of a run, tables
              │                                               │
              ├─▶ accuracy ─▶ accuracy_files                  ├─▶ sweep
              ├─▶ effects                                     └─▶ sensitivity
              └─▶ chooser: a run that keeps errors or time,
                  by choice from pilots and step_settings
"""

from __future__ import annotations

from lcmchain.study.accuracy import AccuracyStudy, study_accuracy
from lcmchain.study.runs import Workers
from lcmchain.study.sources import SceneText, Source, Variant, read_source

__all__ = [
    "AccuracyStudy",
    "SceneText",
    "Source",
    "Variant",
    "Workers",
    "read_source",
    "study_accuracy",
]
