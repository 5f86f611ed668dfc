"""What balls look like: designs drawn from ranges, painted as textures without poles and seams."""
