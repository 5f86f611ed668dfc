"""The program vm-calibrate, which estimates lens and pose of a camera."""
