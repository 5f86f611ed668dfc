"""What a picture shows, drawn from the ranges of scene.toml: camera, field, light and where things stand."""
