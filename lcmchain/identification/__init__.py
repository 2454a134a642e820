"""Parameters of a fabric law from coupon tests: data, relations as fits, intervals, files."""
