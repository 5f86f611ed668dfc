"""The daemon: its configuration, health, logs and status page."""
