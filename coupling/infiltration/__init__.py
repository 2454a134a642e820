"""Infiltration of a formed textile: flow of the resin along and through the sheet."""
