"""Studies: what accuracy costs in time, what effects change, what results depend on."""

from __future__ import annotations

from lcmchain.study.accuracy import AccuracyStudy, study_accuracy
from lcmchain.study.runs import Workers
from lcmchain.study.variant import SceneText, Variant

__all__ = ["AccuracyStudy", "SceneText", "Variant", "Workers", "study_accuracy"]
