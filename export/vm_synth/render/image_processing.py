"""Turns rendered light into the JPEG of a robot's camera.

The steps: auto exposure, lens, noise, Bayer mosaic, white balance, tone curve and compression. A `Sensor` holds all
parameters and the seed of the noise. No step shifts the picture, so the scene's masks stay valid: blurs are centered,
and color fringes move red and blue but not green.
"""

from __future__ import annotations

import math

import cv2
import numpy as np

from vm_embedded.arrays import Floats, Image, Singles
from vm_workstation.colors import LUMINANCE, saturation_matrix

from ..scene.sensor import Sensor

_DEMOSAICING = {
    "RGGB": cv2.COLOR_BayerRGGB2RGB_EA,
    "BGGR": cv2.COLOR_BayerBGGR2RGB_EA,
    "GRBG": cv2.COLOR_BayerGRBG2RGB_EA,
    "GBRG": cv2.COLOR_BayerGBRG2RGB_EA,
}
_CHROMA_SAMPLING = {"4:2:0": cv2.IMWRITE_JPEG_SAMPLING_FACTOR_420, "4:4:4": cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444}

RESPONSE = np.array([0.55, 1.0, 0.7], np.float32)
"""Sensitivity of the chip to red, green and blue: white balance amplifies red and blue with their noise."""

_MID_GRAY = 0.18

BRIGHTEST = 64.0
"""Limit of the light before the lens, in multiples of white: a sun of 1e5 would fill the picture with glare."""


def apply_exposure(radiance: Singles, sensor: Sensor) -> Singles:
    """Scale radiance (h, w, 3) so that its log-average becomes mid gray, times 2 ** exposure error.

    The average ignores lamps, deep shadows and black pixels, as around the circle of a fisheye.
    """
    luminance = radiance[::4, ::4] @ LUMINANCE
    seen = luminance[luminance > 0]
    if not seen.size:
        return radiance
    logarithm = np.log(seen)
    average = float(np.clip(logarithm, *np.percentile(logarithm, [15, 95])).mean())
    bend = sensor.shoulder if sensor.tone == "filmic" else 0.0
    # A filmic camera exposes lower and lifts the shadows again.
    gray = _MID_GRAY / (1.0 + bend - _MID_GRAY * bend)
    return np.asarray(radiance * np.float32(gray * 2.0**sensor.exposure / math.exp(average)))


def white_balance_gains(light: Singles, sensor: Sensor) -> Singles:
    """Gains (3,) of red, green and blue that remove part of the color of the light from exposed light (h, w, 3).

    They are estimated from pixels below white whose color a lamp can have. Turf is greener than any lamp, so a picture
    of turf alone stays green.
    """
    colors = np.clip(light[::4, ::4].reshape(-1, 3), 1e-4, 1.0)
    logs = np.log(colors)
    tint = 2.0 * logs[:, 1] - logs[:, 0] - logs[:, 2]
    weights = np.exp(-((tint / 0.6) ** 2)) * (colors @ LUMINANCE) * (colors.max(axis=1) < 1.0)
    red, green, blue = weights @ logs / (weights.sum() + 0.01 * len(weights))
    # The limits span daylight to light bulb; a stronger tint is not the color of the light.
    red_gain, blue_gain = np.exp(np.clip(sensor.balance * np.array([green - red, green - blue]), -0.7, 1.2))
    return np.array([red_gain * sensor.red, 1.0, blue_gain * sensor.blue], np.float32)


def process_image(radiance: Singles, sensor: Sensor) -> Image:
    """The 8-bit picture (h, w, 3) BGR that the camera takes of linear RGB radiance (h, w, 3), in any unit."""
    light = np.clip(apply_exposure(np.asarray(radiance, np.float32), sensor), 0.0, BRIGHTEST)
    gains = white_balance_gains(light, sensor)
    signal = _read_chip(_through_lens(light, sensor) * RESPONSE, sensor)
    # Green saturates first. Red and blue are cut at the same level, or lamps would turn pink.
    balanced = np.minimum(signal * (gains / RESPONSE), 1.0)
    color = np.clip(cv2.transform(balanced, saturation_matrix(sensor.saturation).astype(np.float32)), 0.0, 1.0)
    table = _tone_table(sensor)
    levels = table[(color * np.float32(len(table) - 1) + np.float32(0.5)).astype(np.uint16)]
    if sensor.sharpening > 0:
        levels += np.float32(sensor.sharpening) * (levels - cv2.GaussianBlur(levels, (5, 5), 1.0))
    # cv2 rounds and clips; numpy would wrap around.
    return np.asarray(cv2.cvtColor(cv2.convertScaleAbs(np.maximum(levels, 0.0)), cv2.COLOR_RGB2BGR), np.uint8)


def encode_jpeg(picture: Image, sensor: Sensor) -> bytes:
    """The JPEG file of a picture (h, w, 3) BGR, compressed once or twice."""
    if sensor.earlier_quality:
        once = _jpeg(picture, sensor.earlier_quality, sensor.chroma)
        picture = np.asarray(cv2.imdecode(np.frombuffer(once, np.uint8), cv2.IMREAD_COLOR), np.uint8)
    return _jpeg(picture, sensor.quality, sensor.chroma)


def _jpeg(picture: Image, quality: int, chroma: str) -> bytes:
    options = [cv2.IMWRITE_JPEG_QUALITY, quality, cv2.IMWRITE_JPEG_SAMPLING_FACTOR, _CHROMA_SAMPLING[chroma]]
    return cv2.imencode(".jpg", picture, options)[1].tobytes()


def blur_kernel(sensor: Sensor) -> Singles:
    """Weights (k, k), k odd, of defocus (a disk) and motion (a line) together; their sum is 1.

    Each sample point is split among the four pixels around it in proportion (bilinear), so that the center of mass
    stays exactly in the middle.
    """
    index = np.arange(96)
    turn, radius = index * math.pi * (3.0 - math.sqrt(5.0)), sensor.defocus * np.sqrt((index + 0.5) / len(index))
    spiral = np.stack([radius * np.cos(turn), radius * np.sin(turn)], axis=1)
    along = np.linspace(-0.5, 0.5, 2 * math.ceil(sensor.motion) + 1) * sensor.motion
    line = along[:, None] * np.array([math.cos(sensor.direction), math.sin(sensor.direction)])
    points: Floats = (np.concatenate([spiral, -spiral])[:, None] + line).reshape(-1, 2)
    half = int(np.abs(points).max()) + 1
    kernel = np.zeros((2 * half + 1, 2 * half + 1))
    corner = np.floor(points).astype(int)
    x, y = (points - corner).T
    for right, down, weight in ((0, 0, (1 - x) * (1 - y)), (1, 0, x * (1 - y)), (0, 1, (1 - x) * y), (1, 1, x * y)):
        np.add.at(kernel, (corner[:, 1] + down + half, corner[:, 0] + right + half), weight)
    return np.asarray(kernel / kernel.sum(), np.float32)


def _through_lens(light: Singles, sensor: Sensor) -> Singles:
    """Light (h, w, 3) that reaches the chip, after blur, vignetting, color fringes and glare."""
    height, width = light.shape[:2]
    if sensor.defocus > 0 or sensor.motion > 0:
        # The kernel of a wide blur is applied by Fourier transform, which may leave tiny negative numbers.
        light = np.asarray(np.maximum(cv2.filter2D(light, -1, blur_kernel(sensor)), 0.0), np.float32)
    center_x, center_y = (width - 1) / 2.0, (height - 1) / 2.0
    corner = max(math.hypot(center_x, center_y), 1.0)
    if sensor.vignetting > 0:
        x, y = np.arange(width, dtype=np.float32) - center_x, np.arange(height, dtype=np.float32) - center_y
        loss = sensor.vignetting / corner**2
        light = light * np.asarray(1.0 - loss * (x**2 + y[:, None] ** 2), np.float32)[..., None]
    if sensor.fringe:
        planes = list(cv2.split(light))
        for plane, sign in ((0, 1.0), (2, -1.0)):
            scale = 1.0 + sign * sensor.fringe / corner
            warp = np.array([[scale, 0.0, center_x * (1.0 - scale)], [0.0, scale, center_y * (1.0 - scale)]])
            planes[plane] = cv2.warpAffine(planes[plane], warp, (width, height), borderMode=cv2.BORDER_REPLICATE)
        light = np.asarray(cv2.merge(planes), np.float32)
    if sensor.glare > 0:
        small = cv2.resize(light, (max(width // 8, 1), max(height // 8, 1)), interpolation=cv2.INTER_AREA)
        halo = cv2.GaussianBlur(small, (0, 0), max(width / 160.0, 1.0))
        scattered = cv2.resize((halo + small.mean(axis=(0, 1))) * np.float32(0.5), (width, height))
        light = light * np.float32(1.0 - sensor.glare) + scattered * np.float32(sensor.glare)
    return light


def _read_chip(light: Singles, sensor: Sensor) -> Singles:
    """Signal (h, w, 3) of the chip for light (h, w, 3): saturated at 1, with shot and read noise, demosaiced."""
    random = np.random.Generator(np.random.PCG64(sensor.seed))
    height, width = light.shape[:2]
    if sensor.mosaic:
        sites = np.empty((height, width), np.float32)
        for place, color in enumerate(sensor.mosaic):
            row, column = divmod(place, 2)
            sites[row::2, column::2] = light[row::2, column::2, "RGB".index(color)]
        light = sites
    light = np.minimum(light, 1.0)
    electrons = sensor.full_well / sensor.gain
    deviation = np.sqrt(light * np.float32(1.0 / electrons) + np.float32((sensor.read_noise / electrons) ** 2))
    rows = random.standard_normal((height,) + (1,) * (light.ndim - 1), dtype=np.float32)
    signal = light + deviation * random.standard_normal(light.shape, dtype=np.float32)
    signal += rows * np.float32(sensor.row_noise / electrons)
    if not sensor.mosaic:
        return np.asarray(np.minimum(signal, 1.0), np.float32)
    # Noise below black survives until demosaicing, as behind the black level of a real chip.
    black, white = 6000.0, 65000.0
    counts = np.clip(signal * (white - black) + (black + 0.5), 0.0, white).astype(np.uint16)
    colors = cv2.demosaicing(counts, _DEMOSAICING[sensor.mosaic])
    return np.asarray((colors.astype(np.float32) - black) / (white - black), np.float32)


def _tone_table(sensor: Sensor) -> Singles:
    """Unrounded levels from 0 to 255 for linear light from 0 to 1 in equal steps."""
    light = np.linspace(0.0, 1.0, 1 << 15)
    if sensor.tone == "filmic":
        light = light * (1.0 + sensor.shoulder) / (1.0 + sensor.shoulder * light)
    if sensor.tone == "gamma":
        tone = light ** (1.0 / sensor.gamma)
    else:
        tone = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1.0 / 2.4) - 0.055)
    tone = tone - sensor.contrast * np.sin(2.0 * np.pi * tone) / (2.0 * np.pi)
    return np.asarray(255.0 * tone, np.float32)
