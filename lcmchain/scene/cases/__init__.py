"""Commented scenes to start from, one file per case: what ``lcmchain new`` writes."""
