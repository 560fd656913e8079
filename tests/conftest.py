"""Settings of all tests."""

import gc

# Python's collector of garbage looks through what the compiler keeps again and again. It took a
# sixth of compiling the simulator.
gc.set_threshold(100_000, 50, 1000)
