"""The folder of pictures that vm-synth writes, and its reports."""
