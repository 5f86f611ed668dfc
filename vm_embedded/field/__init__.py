"""What a soccer robot needs besides the ball: goal posts, robots, field lines and the border of the field."""
