"""Forming and infiltration as participants of a coupling through preCICE (version 3)."""
