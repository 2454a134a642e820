"""Cases by which element and solver are judged: benchmarks with known solutions, hard cases."""
