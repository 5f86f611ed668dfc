"""The appearance of balls: designs drawn from ranges, and their textures."""
