"""What lies between the plies of a stack."""
