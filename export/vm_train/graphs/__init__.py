"""From pictures to labeled graphs, the examples that a network learns from."""
