"""Compiler, 3-vectors, times at which gaps close, filters eight numbers at a time, and profiler."""
