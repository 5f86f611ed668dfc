"""Networks in torch, their checkpoints, and their export to self-describing ONNX files."""
