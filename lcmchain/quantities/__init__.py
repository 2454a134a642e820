"""Physical quantities and the entry types of scene tables; every room may build on them."""
