"""From a frame and an orientation to objects on the plane."""
