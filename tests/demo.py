"""Paths of the demo's files, which the repository holds."""

from pathlib import Path

FOLDER = Path(__file__).parent / "fixtures" / "demo"
MODEL = FOLDER / "ball.onnx"
CHECKPOINT = FOLDER / "ball.pt"
IMAGES = sorted(FOLDER.glob("image*.jpg"))
TRUTH = FOLDER / "balls.json"
