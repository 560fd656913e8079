"""A design simulated in independent replicas, and the figures that follow from them."""
