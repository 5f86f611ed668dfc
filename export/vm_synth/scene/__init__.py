"""What a picture shows, drawn from the ranges of scene.toml: camera, field, light, ball and objects."""
