"""What a user can put right: one sentence that names the field, file or triangle, and the remedy; and lost workers."""

from concurrent.futures import BrokenExecutor


class InputError(Exception):
    """A design, study, mesh or results folder that cannot be used as it is.

    The command line prints the message alone and exits with status 2.
    """


class WorkerLostError(BrokenExecutor):
    """A worker died of its task, and so did the next; other tasks are not touched."""


class ClusterLostError(BrokenExecutor):
    """The cluster is gone, and with it all that was to be done; the command line exits with status 1."""
