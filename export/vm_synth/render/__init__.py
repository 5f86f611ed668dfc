"""Turns a scene into pixels: ray tracing, ground, masks and the camera's image processing."""
