"""Coupon tests of fabrics: closed forms, and identification of parameters from test data."""
