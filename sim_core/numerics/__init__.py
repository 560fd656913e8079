"""Compilation, vectors, roots of gaps, SIMD filters, profiler."""
