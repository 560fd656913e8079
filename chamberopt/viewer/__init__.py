"""Show results of simulations in 3D, in the window of `chamberopt inspect`."""
