"""Pictures, masks, lenses and poses on disk; classes; and the split of a data set."""
