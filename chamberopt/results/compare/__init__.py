"""Comparison of candidates, figure by figure and place by place."""
