"""Solid sides of a coupling with a fluid: what deforms under its pressure and drives its volume."""
