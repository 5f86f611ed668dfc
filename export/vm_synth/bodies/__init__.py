"""The objects of a scene: robots, people, goals, clutter, round distractors and the camera's carrier."""
