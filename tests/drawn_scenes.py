"""Paths of drawn scenes and of a network that was trained on such, which the repository holds."""

from pathlib import Path

FOLDER = Path(__file__).parent / "fixtures" / "drawn"
MODEL = FOLDER / "ball.onnx"
CHECKPOINT = FOLDER / "ball.pt"
IMAGES = sorted(FOLDER.glob("image*.jpg"))
TRUTH = FOLDER / "balls.json"
