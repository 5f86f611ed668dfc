"""Training pictures made a little different: another pose and lens are told, the image is softened, colors change.

Labels stay right, because nothing in the image moves: a network is told a wrong camera, as a robot's joints and
calibration tell it, and so gets other points of the same image.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np

from vm_embedded.arrays import Floats, Image, Singles
from vm_embedded.config.entries import check_entries, number, share
from vm_embedded.geometry.calibrated_lenses import CalibratedLens
from vm_embedded.geometry.lens import Lens, Size
from vm_embedded.geometry.lens_files import LensFile
from vm_embedded.geometry.orientation import Orientation
from vm_embedded.geometry.radial_lenses import RadialLens
from vm_workstation.colors import saturation_matrix
from vm_workstation.ranges import range_of

from ..data.pictures import Picture


@dataclass(frozen=True)
class Augmentation:
    """Section [augmentation]: how far pictures are changed in training. 0 switches an entry off.

    height, tilt, focal_length and center are standard deviations. brightness, contrast, saturation and gamma are
    factors: up to 1 + the entry, and as often down to 1 / (1 + the entry). Raises InputError.
    """

    height: float = number(0.02, "usual error of the camera's height, as a share of it", "", (0.0, 0.5))
    tilt: float = number(1.0, "usual error of the camera's roll, and of its pitch", "deg", (0.0, 20.0))
    focal_length: float = number(0.01, "usual error of the focal length, as a share of it", "", (0.0, 0.2))
    center: float = number(0.005, "usual error of the optical center, in image widths", "", (0.0, 0.1))
    brightness: float = number(0.2, "colors are up to this share brighter, or as much darker", "", (0.0, 4.0))
    contrast: float = number(0.15, "contrast is up to this share higher, or as much lower", "", (0.0, 4.0))
    saturation: float = number(0.25, "colors are up to this share stronger, or as much paler", "", (0.0, 4.0))
    hue: float = number(6.0, "hues are turned by up to this, either way", "deg", (0.0, 180.0))
    gamma: float = number(0.15, "exponent of colors is up to this share above 1, or as much below", "", (0.0, 4.0))
    noise: float = number(0.03, "noise is up to this strong, standard deviation as a share of white", "", (0.0, 1.0))
    blur_share: float = share(0.15, "share of pictures that are blurred")
    blur: tuple[float, float] = range_of(0.4, 1.2, "blur where there is one, standard deviation", "px", (0.1, 20.0))
    jpeg_share: float = share(0.15, "share of pictures that are compressed again")
    jpeg: tuple[float, float] = range_of(40.0, 90.0, "JPEG quality of those", "", (1.0, 100.0))

    def __post_init__(self) -> None:
        check_entries(self)


NO_AUGMENTATION = Augmentation(
    height=0.0,
    tilt=0.0,
    focal_length=0.0,
    center=0.0,
    brightness=0.0,
    contrast=0.0,
    saturation=0.0,
    hue=0.0,
    gamma=0.0,
    noise=0.0,
    blur_share=0.0,
    jpeg_share=0.0,
)
"""Pictures stay as they are."""


@dataclass(frozen=True)
class Tone:
    """What becomes of a picture's colors; names are those of Augmentation. Defaults change nothing.

    brightness, contrast, saturation: factors. hue: a turn [deg]. gamma: exponent. noise: standard deviation [1].
    """

    brightness: float = 1.0
    contrast: float = 1.0
    saturation: float = 1.0
    hue: float = 0.0
    gamma: float = 1.0
    noise: float = 0.0


# Each of these three draws the same numbers whether they are used or not: an entry that changes leaves the others'
# draws as they were.


def perturb_camera(picture: Picture, augmentation: Augmentation, random: np.random.Generator) -> Picture:
    """The same image and labels, told to be from another pose and lens; the same object if all that is off."""
    height, roll, pitch, focal_length, right, down = random.standard_normal(6).tolist()
    told = augmentation
    if not any((told.height, told.tilt, told.focal_length, told.center)):
        return picture
    tilt = math.radians(told.tilt)
    return with_camera_error(
        picture,
        height=math.exp(told.height * height),
        tilt=(tilt * roll, tilt * pitch),
        focal_length=math.exp(told.focal_length * focal_length),
        center=(told.center * right, told.center * down),
    )


def perturb_sharpness(picture: Picture, augmentation: Augmentation, random: np.random.Generator) -> Picture:
    """The picture with its image blurred, compressed, both, or, the same object, neither."""
    blur, sigma, jpeg, quality = random.random(4).tolist()
    low, high = augmentation.blur
    worst, best = augmentation.jpeg
    soft = low + (high - low) * sigma if blur < augmentation.blur_share else 0.0
    packed = round(worst + (best - worst) * quality) if jpeg < augmentation.jpeg_share else 0
    return replace(picture, image=soften(picture.image, soft, packed)) if soft or packed else picture


def perturb_colors(colors: Singles, augmentation: Augmentation, random: np.random.Generator) -> Singles:
    """Colors (n, 3), RGB from 0 to 1, as another camera or light would have them; the same shape and limits."""
    brightness, contrast, saturation, hue, gamma, noise = random.uniform(-1.0, 1.0, 6).tolist()
    tone = Tone(
        brightness=(1.0 + augmentation.brightness) ** brightness,
        contrast=(1.0 + augmentation.contrast) ** contrast,
        saturation=(1.0 + augmentation.saturation) ** saturation,
        hue=augmentation.hue * hue,
        gamma=(1.0 + augmentation.gamma) ** gamma,
        noise=augmentation.noise * abs(noise),
    )
    return apply_tone(colors, tone, random)


def with_camera_error(
    picture: Picture,
    height: float = 1.0,
    tilt: tuple[float, float] = (0.0, 0.0),
    focal_length: float = 1.0,
    center: tuple[float, float] = (0.0, 0.0),
) -> Picture:
    """The same image and labels with another camera.

    height, focal_length: factors above 0. tilt: the camera's turn about the plane's x and y, as a rotation vector
    [rad]; nothing turns about the plane's normal. center: shift of the optical center [image widths]. Raises InputError
    if the lens does not fit the image.
    """
    orientation = picture.lens.orientation
    assert orientation is not None  # read_picture has seen to it
    turn = cv2.Rodrigues(np.array([*tilt, 0.0]))[0]
    told = Orientation(orientation.height * height, np.asarray(turn @ orientation.rotation, dtype=np.float64))
    rows, columns = picture.labels.shape
    lens = _other_lens(picture.lens.lens, (columns, rows), focal_length, (center[0] * columns, center[1] * columns))
    return replace(picture, lens=LensFile(lens, told))


def _other_lens(lens: Lens, size: Size, factor: float, shift: tuple[float, float]) -> Lens:
    """A lens for an image of this size with all its lengths times a factor, and its optical center shifted [px]."""
    fitted = lens.for_image(size)
    # Scaling takes the distortion along, so that the lens sees as far from its axis as it did.
    scaled = fitted.scaled(factor, size)
    if isinstance(fitted, RadialLens):
        assert isinstance(scaled, RadialLens)
        return replace(scaled, center=(fitted.center[0] - shift[0], fitted.center[1] - shift[1]))
    assert isinstance(fitted, CalibratedLens)
    assert isinstance(scaled, CalibratedLens)
    x, y = fitted.optical_center
    return replace(scaled, optical_center=(x + shift[0], y + shift[1]))


def soften(image: Image, blur: float = 0.0, jpeg: int = 0) -> Image:
    """An image (h, w, 3) BGR after a Gaussian blur [px], then a JPEG file of that quality; 0 leaves each out."""
    if blur:
        image = np.asarray(cv2.GaussianBlur(image, (0, 0), blur), dtype=np.uint8)
    if jpeg:
        file = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, jpeg])[1]
        image = np.asarray(cv2.imdecode(file, cv2.IMREAD_COLOR), dtype=np.uint8)
    return image


def apply_tone(colors: Singles, tone: Tone, random: np.random.Generator) -> Singles:
    """Colors (n, 3), RGB from 0 to 1, with another tone, within the same limits. `random` is for the noise."""
    saturated = saturation_matrix(tone.saturation)
    matrix = tone.brightness * tone.contrast * saturated @ _hue_turn(math.radians(tone.hue))
    found = np.asarray(colors @ matrix.T.astype(np.float32), dtype=np.float32)
    found += np.float32(0.5 * (1.0 - tone.contrast))
    np.clip(found, 0.0, 1.0, out=found)
    if tone.gamma != 1.0:
        np.power(found, np.float32(tone.gamma), out=found)
    if tone.noise:
        found += np.float32(tone.noise) * random.standard_normal(found.shape, dtype=np.float32)
        np.clip(found, 0.0, 1.0, out=found)
    return found


def _hue_turn(angle: float) -> Floats:
    """Rotation (3, 3) of RGB colors about the axis of grays by an angle [rad]."""
    across = np.array([[0.0, -1.0, 1.0], [1.0, 0.0, -1.0], [-1.0, 1.0, 0.0]]) / math.sqrt(3.0)
    cosine = math.cos(angle)
    return np.asarray(cosine * np.eye(3) + (1.0 - cosine) / 3.0 + math.sin(angle) * across)
