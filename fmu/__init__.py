"""Functional mock-up units of the stages."""
