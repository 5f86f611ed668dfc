"""Pictures, masks and poses on disk, and how a set is split."""
