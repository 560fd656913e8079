"""The event loop: event queue, neighbour filter, handlers of events, and simulate()."""
