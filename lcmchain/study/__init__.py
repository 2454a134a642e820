"""Studies: what accuracy costs in time, what effects change, what results depend on."""

from __future__ import annotations

from lcmchain.study.accuracy import AccuracyStudy, study_accuracy
from lcmchain.study.runs import Workers
from lcmchain.study.scene_text import SceneText
from lcmchain.study.source import Source, read_source
from lcmchain.study.variant import Variant

__all__ = [
    "AccuracyStudy",
    "SceneText",
    "Source",
    "Variant",
    "Workers",
    "read_source",
    "study_accuracy",
]
