"""Estimators of a covered share and their confidence intervals."""
