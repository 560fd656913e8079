"""Show results in 3D in the window of `chamberopt inspect`."""
