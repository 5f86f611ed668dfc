"""The model file, the layouts of its points, and ONNX Runtime."""
