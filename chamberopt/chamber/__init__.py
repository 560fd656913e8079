"""From a design to a closed cavity, and from the cavity to a scene of the simulator."""
