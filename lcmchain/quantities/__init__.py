"""Physical quantities, the entry types of scene tables, and the fields of results.

Every room may build on them.
"""
