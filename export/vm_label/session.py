"""A session of labeling: the crops of a folder of boxes, and their answers."""

from __future__ import annotations

import hashlib
import threading
from typing import Any

from vm_embedded.cameras.image_files import read_image

from .answers import AnswerFile
from .box_folder import BoxFolder
from .crops import Crop, most_doubtful_first
from .cutting import cut, whole


class Session:
    """What the page shows and changes. Its methods may be called from several threads.

    answers: by crop, oldest first. file: gets each new answer.
    """

    def __init__(self, folder: BoxFolder, answers: dict[str, str], file: AnswerFile) -> None:
        self._folder, self._file = folder, file
        self._crops = {crop.id: crop for crop in most_doubtful_first(folder.crops)}
        self._answers = {crop: answer for crop, answer in answers.items() if crop in self._crops}
        self._lock = threading.Lock()
        self.id = hashlib.sha256(str(folder.path).encode(errors="surrogateescape")).hexdigest()[:16]

    def __len__(self) -> int:
        return len(self._crops)

    @property
    def answered(self) -> int:
        """Number of crops with an answer."""
        with self._lock:
            return len(self._answers)

    def state(self) -> dict[str, Any]:
        """The crops, most doubtful first, with their answers; `history` lists the answered ones, oldest first."""
        with self._lock:
            answers = dict(self._answers)
        return {
            "session": self.id,
            "folder": str(self._folder.path),
            "history": list(answers),
            "crops": [self._fields(crop) | {"answer": answers.get(crop.id)} for crop in self._crops.values()],
        }

    def _fields(self, crop: Crop) -> dict[str, Any]:
        return {"id": crop.id, "image": crop.image, "class": crop.class_name, "confidence": crop.confidence}

    def knows(self, crop: object) -> bool:
        """Whether there is a crop with this id."""
        return crop in self._crops

    def answer(self, crop: str, answer: str | None) -> None:
        """Write an answer to the disk, or None to take it back. Raises InputError if it can't be written."""
        with self._lock:
            self._file.append(self._crops[crop], answer)
            self._answers.pop(crop, None)
            if answer is not None:
                self._answers[crop] = answer

    def picture(self, crop: str, entire: bool) -> bytes:
        """A JPEG of a crop, or of its entire image. Raises InputError if the image can't be read."""
        chosen = self._crops[crop]
        image = read_image(self._folder.path / chosen.image)
        return (whole if entire else cut)(image, chosen.shares)
