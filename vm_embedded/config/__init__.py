"""TOML sections that check themselves, and a strict YAML reader."""
