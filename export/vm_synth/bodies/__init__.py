"""Solid things of a scene: robots, people, goals, clutter, and balls that are not the ball."""
