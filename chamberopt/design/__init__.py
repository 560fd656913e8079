"""Design files: the tables and keys of a chamber and its process, and their loading.

Example: load the shipped plate, make a copy with another height and save it.

    >>> from chamberopt.design.load import load_design, save_design
    >>> plate = load_design("designs/plate.toml")
    >>> lower = plate.changed({"chamber.height_mm": 45})
    >>> lower.value("chamber.height_mm")
    45.0
    >>> save_design(lower, "lower_plate.toml")  # doctest: +SKIP
"""
