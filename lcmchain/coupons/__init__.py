"""Coupon tests of fabrics: simulated specimens beside their closed forms."""
