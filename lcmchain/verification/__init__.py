"""Verification: problems with known solutions that the program solves on request."""
