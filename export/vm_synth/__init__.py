"""Training pictures, rendered with the lenses and poses of the runtime: the program vm-synth."""
