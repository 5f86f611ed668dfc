"""Configurations in TOML: entries, sections and units; and a strict YAML reader."""
