"""What a user can put right: one sentence that names the field, file or triangle, and the remedy."""


class InputError(Exception):
    """A design, study, mesh or results folder that cannot be used as it is.

    The command line prints the message alone and exits with status 2.
    """
