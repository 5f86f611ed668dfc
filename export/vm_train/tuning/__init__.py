"""Fine-tuning of a close look on boxes of the user's own frames."""
