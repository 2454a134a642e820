"""Mapping onto solid cells: the sheet as a slab of columns, and what each cell holds of them."""
