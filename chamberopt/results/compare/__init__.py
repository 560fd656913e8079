"""Candidates compared with one another, figure by figure and place by place."""
