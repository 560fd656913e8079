"""Compilation, vectors, roots of polynomials, SIMD filters, profiler."""
