"""From a scene to pixels: ray tracing, light, the camera's sensor, masks and outlines."""
