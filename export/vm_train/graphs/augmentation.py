"""Augmentation of training pictures: errors of the camera, blur and compression, and changes of the colors.

Labels stay correct because nothing in the image moves. A camera error changes the pose and lens that the mesh is
projected with, as errors of a robot's joints and calibration do, so the network gets other points of the same image.

No augmentation is meant to scale pictures, because objects always have the same size in the mesh (paper: section
"Discussion and Conclusion").
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
    """Section [augmentation]: how strongly training pictures are changed. 0 switches an entry off.

    height, tilt, focal_length and center are standard deviations. brightness, contrast, saturation and gamma are
    factors: up to 1 + the entry, and as often down to 1 / (1 + the entry). Raises InputError.
    """

    height: float = number(0.02, "standard deviation of the camera height, relative to the height", "", (0.0, 0.5))
    tilt: float = number(1.0, "standard deviation of the camera's roll and pitch", "deg", (0.0, 20.0))
    focal_length: float = number(
        0.01, "standard deviation of the focal length, relative to the focal length", "", (0.0, 0.2)
    )
    center: float = number(0.005, "standard deviation of the optical center, in image widths", "", (0.0, 0.1))
    brightness: float = number(0.2, "brightness changes by up to this share, in both directions", "", (0.0, 4.0))
    contrast: float = number(0.15, "contrast changes by up to this share, in both directions", "", (0.0, 4.0))
    saturation: float = number(0.25, "saturation changes by up to this share, in both directions", "", (0.0, 4.0))
    hue: float = number(6.0, "hue changes by up to this angle, in both directions", "deg", (0.0, 180.0))
    gamma: float = number(0.15, "gamma exponent is drawn from 1 / (1 + value) to 1 + value", "", (0.0, 4.0))
    noise: float = number(0.03, "largest standard deviation of the noise, as a share of white", "", (0.0, 1.0))
    blur_share: float = share(0.15, "share of the pictures that are blurred")
    blur: tuple[float, float] = range_of(0.4, 1.2, "range of the blur's standard deviation", "px", (0.1, 20.0))
    jpeg_share: float = share(0.15, "share of the pictures that are compressed as JPEG")
    jpeg: tuple[float, float] = range_of(40.0, 90.0, "range of the JPEG quality", "", (1.0, 100.0))

    def __post_init__(self) -> None:
        check_entries(self)


@dataclass(frozen=True)
class Tone:
    """A change of colors, with the names of Augmentation. The defaults change nothing.

    brightness, contrast, saturation: factors. hue: angle [deg]. gamma: exponent. noise: standard deviation, 1 is white.
    """

    brightness: float = 1.0
    contrast: float = 1.0
    saturation: float = 1.0
    hue: float = 0.0
    gamma: float = 1.0
    noise: float = 0.0


# Each of the next three functions always draws the same amount of random numbers, used or not, except for noise. So
# changing another entry leaves the draws of the others as they were.


def perturb_camera(picture: Picture, augmentation: Augmentation, random: np.random.Generator) -> Picture:
    """The picture with a random error of pose and lens; the same object if those entries are off."""
    height, roll, pitch, focal_length, right, down = random.standard_normal(6).tolist()
    error = augmentation
    if not any((error.height, error.tilt, error.focal_length, error.center)):
        return picture
    tilt = math.radians(error.tilt)
    return with_camera_error(
        picture,
        height=math.exp(error.height * height),
        tilt=(tilt * roll, tilt * pitch),
        focal_length=math.exp(error.focal_length * focal_length),
        center=(error.center * right, error.center * down),
    )


def perturb_sharpness(picture: Picture, augmentation: Augmentation, random: np.random.Generator) -> Picture:
    """The picture with its image blurred or compressed at random; the same object if neither happens."""
    blur, sigma, jpeg, quality = random.random(4).tolist()
    low, high = augmentation.blur
    worst, best = augmentation.jpeg
    soft = low + (high - low) * sigma if blur < augmentation.blur_share else 0.0
    packed = round(worst + (best - worst) * quality) if jpeg < augmentation.jpeg_share else 0
    return replace(picture, image=soften(picture.image, soft, packed)) if soft or packed else picture


def perturb_colors(colors: Singles, augmentation: Augmentation, random: np.random.Generator) -> Singles:
    """Colors (n, 3), RGB from 0 to 1, with a random tone, as of another camera or light; in the same limits."""
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
    """The same image and labels with another pose and lens.

    height, focal_length: factors above 0. tilt: rotation vector of the camera about the plane's x and y axes [rad].
    center: shift of the optical center to the right and down [image widths]. Raises InputError if the lens does not fit
    the image.
    """
    orientation, width = picture.orientation, picture.size[0]
    turn = cv2.Rodrigues(np.array([*tilt, 0.0]))[0]
    changed = Orientation(orientation.height * height, np.asarray(turn @ orientation.rotation, dtype=np.float64))
    lens = _other_lens(picture.fitted_lens, picture.size, focal_length, (center[0] * width, center[1] * width))
    return replace(picture, lens=LensFile(lens, changed))


def _other_lens(fitted: Lens, size: Size, factor: float, shift: tuple[float, float]) -> Lens:
    """A lens that fits an image of this size, its lengths scaled by a factor and its optical center shifted [px]."""
    # Scaling includes the distortion, so the lens's field of view stays the same.
    scaled = fitted.scaled(factor, size)
    if isinstance(fitted, RadialLens):
        assert isinstance(scaled, RadialLens)
        return replace(scaled, center=(fitted.center[0] - shift[0], fitted.center[1] - shift[1]))
    assert isinstance(fitted, CalibratedLens)
    assert isinstance(scaled, CalibratedLens)
    x, y = fitted.optical_center
    return replace(scaled, optical_center=(x + shift[0], y + shift[1]))


def soften(image: Image, blur: float = 0.0, jpeg: int = 0) -> Image:
    """An image (h, w, 3) BGR after a Gaussian blur [px] and JPEG compression of that quality; 0 skips either."""
    if blur:
        image = np.asarray(cv2.GaussianBlur(image, (0, 0), blur), dtype=np.uint8)
    if jpeg:
        file = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, jpeg])[1]
        image = np.asarray(cv2.imdecode(file, cv2.IMREAD_COLOR), dtype=np.uint8)
    return image


def apply_tone(colors: Singles, tone: Tone, random: np.random.Generator) -> Singles:
    """Colors (n, 3), RGB from 0 to 1, with another tone, clipped to the same limits. `random` draws the noise."""
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
