"""Co-simulation master: units of FMI 2.0 and 3.0 as parts of a coupled system."""
