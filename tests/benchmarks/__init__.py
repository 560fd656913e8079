"""Tests of benchmarks/ whose tables an auditor reads."""
