"""A session of labeling: the images of a folder, their crops, and the answers."""

from __future__ import annotations

import hashlib
import re
import threading
from typing import Any

from vm_embedded.cameras.image_files import read_image
from vm_embedded.errors import InputError, unknown
from vm_embedded.output.box_files import LEAST_SIDE, Shares

from .answers import AnswerFile
from .box_folder import BoxFolder
from .crops import Crop, checked_shares, most_doubtful_first, replaced, whole_picture
from .cutting import cut, whole
from .sizing import box_at

_ID = re.compile("[0-9a-f]{16}")


class Labeling:
    """What the page shows and changes. Its methods may be called from several threads.

    answers: by crop, oldest first. file: gets each new answer.
    """

    def __init__(self, folder: BoxFolder, answers: dict[str, str], file: AnswerFile) -> None:
        self._folder, self._file = folder, file
        self._crops = {crop.id: crop for crop in most_doubtful_first(folder.crops)}
        pictures = (whole_picture(image, folder.classes) for image in folder.images)
        self._pictures = {picture.id: picture for picture in pictures}
        known = self._crops.keys() | self._pictures.keys()
        self._answers = {crop: answer for crop, answer in answers.items() if crop in known}
        self._lock = threading.Lock()
        self.id = hashlib.sha256(str(folder.path).encode(errors="surrogateescape")).hexdigest()[:16]

    def __len__(self) -> int:
        return len(self._crops)

    @property
    def answered(self) -> int:
        """Number of crops with an answer."""
        with self._lock:
            return len(self._answers.keys() & self._crops.keys())

    @property
    def saved(self) -> int:
        """A number that grows with each saved answer."""
        return self._file.size

    def state(self) -> dict[str, Any]:
        """All that the page shows: the crops, most doubtful first, and the pictures, with their answers.

        `history` lists what was answered, oldest first.
        """
        with self._lock:
            answers, crops, saved = dict(self._answers), list(self._crops.values()), self.saved
        gone = replaced(crops, answers)
        return {
            "session": self.id,
            "folder": str(self._folder.path),
            "classes": self._folder.classes,
            "saved": saved,
            "history": list(answers),
            "crops": [
                self._fields(crop) | {"answer": answers.get(crop.id), "replaced": crop.id in gone} for crop in crops
            ],
            "pictures": [
                {"id": picture.id, "image": picture.image, "answer": answers.get(picture.id)}
                for picture in self._pictures.values()
            ],
        }

    def _fields(self, crop: Crop) -> dict[str, Any]:
        fields = {"id": crop.id, "image": crop.image, "class": crop.class_name, "confidence": crop.confidence}
        return fields | {"box": crop.shares, "drawn": bool(crop.drawn)}

    def find(self, id: str) -> Crop | None:
        """The crop or the whole picture with this id; None if there is none."""
        return self._crops.get(id) or self._pictures.get(id)

    def drawn(self, id: str, picture: object, class_name: object, box: object) -> Crop:
        """The crop of a box that a person drew in a picture. Raises InputError for an unusable one."""
        if not _ID.fullmatch(id) or id in self._pictures:
            raise InputError("a drawn box needs an id of its own, of sixteen hexadecimal digits")
        if not isinstance(picture, str) or picture not in self._pictures:
            raise InputError("a drawn box needs the id of its picture")
        if class_name not in self._folder.classes:
            raise InputError(unknown("class", class_name, self._folder.classes))
        crop = Crop(self._pictures[picture].image, str(class_name), checked_shares(box), None, id)
        if id in self._crops:
            if self._crops[id] != crop:
                raise InputError("this id belongs to another box")
            return crop
        height, width = read_image(self._folder.path / crop.image).shape[:2]
        sides = [share * length for share, length in zip(crop.shares[2:], (width, height), strict=True)]
        if min(sides) < LEAST_SIDE:
            shown = " x ".join(f"{side:.1f}" for side in sides)
            raise InputError(f"a box of {shown} px is too small; draw at least {LEAST_SIDE:g} px")
        return crop

    def answer(self, crop: Crop, answer: str | None) -> list[str]:
        """Write an answer to the disk, or None to take it back, which removes a drawn box.

        Returns the ids of the replaced crops of the image. Raises ValueError for a yes to a whole picture, and
        InputError if the answer can't be written.
        """
        if answer == "yes" and crop.id in self._pictures:
            raise ValueError("a whole picture is no object")
        with self._lock:
            self._file.append(crop, answer)
            self._answers.pop(crop.id, None)
            if answer is not None:
                self._answers[crop.id] = answer
            if crop.drawn:
                self._crops.pop(crop.id, None)
                if answer is not None:
                    self._crops[crop.id] = crop
            return sorted(replaced((each for each in self._crops.values() if each.image == crop.image), self._answers))

    def picture(self, crop: Crop) -> bytes:
        """A JPEG of a crop, or of a whole picture. Raises InputError if the image can't be read."""
        image = read_image(self._folder.path / crop.image)
        return whole(image) if crop.id in self._pictures else cut(image, crop.shares)

    def box_at(self, picture: Crop, point: tuple[float, float]) -> Shares:
        """The box of an object whose center is at a point of a picture, as from `sizing.box_at`."""
        path = self._folder.path / picture.image
        height, width = read_image(path).shape[:2]
        return box_at(path, (width, height), point)
