"""What people look at and hand on: results folders, plots, viewer, report, comparison, export."""
