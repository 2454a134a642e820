"""Cases by which element and solver are judged.

``benchmarks`` have known solutions, ``hard_cases`` have criteria. ``random_elements`` serve the
hard cases and the tests of the elements; ``hemisphere`` compares formed hemispheres.
"""
