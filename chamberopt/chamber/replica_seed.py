"""The random seed of a replica, which is one of several simulations of the same design."""

import hashlib

STREAMS = ("search", "confirm")


def replica_seed(seed: int, replica: int, stream: str = "search") -> int:
    """Return the random seed, 128 bits, of one replica of a design with this seed.

    The seed is the same for every candidate of a study (common random numbers). It differs between
    replicas and between streams, so that a candidate that was chosen on "search" is confirmed on
    other seeds. It comes from sha256, because hash() differs between Python processes.

    Args:
        stream: use of the simulation: "search" or "confirm".
    """
    if stream not in STREAMS:
        raise ValueError(f"stream {stream!r}: one of {', '.join(STREAMS)}")
    digest = hashlib.sha256(f"chamberopt/{stream}/{seed}/{replica}".encode()).digest()
    return int.from_bytes(digest[:16], "big")


def step_seed(seed: int, step: int) -> int:
    """Return the random seed, 128 bits, of one step of a replica with this seed.

    The first step, number 0, has the seed of the replica.
    """
    if not step:
        return seed
    return int.from_bytes(
        hashlib.sha256(f"chamberopt/step/{seed}/{step}".encode()).digest()[:16], "big"
    )
