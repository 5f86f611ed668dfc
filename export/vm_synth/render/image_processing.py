"""From light to the JPEG of a robot's camera: exposure, lens, noise, mosaic, white balance, tone curve, compression.

`draw_sensor` decides once what a picture's camera is like; all else follows from that Sensor, its noise included.
Nothing here moves a thing: blurs are centered and green stays in place, so that masks of the scene stay right.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from vm_embedded.arrays import Floats, Image, Singles
from vm_embedded.config.entries import check_entries, share

from ..ranges import Range, drawn, log_uniform, some_of, uniform

TONES = ("srgb", "gamma", "filmic")
PATTERNS = {
    "RGGB": cv2.COLOR_BayerRGGB2RGB_EA,
    "BGGR": cv2.COLOR_BayerBGGR2RGB_EA,
    "GRBG": cv2.COLOR_BayerGRBG2RGB_EA,
    "GBRG": cv2.COLOR_BayerGBRG2RGB_EA,
}
CHROMAS = {"4:2:0": cv2.IMWRITE_JPEG_SAMPLING_FACTOR_420, "4:4:4": cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444}

LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)
RESPONSE = np.array([0.55, 1.0, 0.7], np.float32)
"""How sensitive the chip is to red, green and blue: white balance amplifies red and blue, and their noise."""

MID_GRAY = 0.18
BRIGHTEST = 64.0
"""Light above this many times white is cut off before the lens: a sun of 1e5 would turn the picture into glare."""


@dataclass(frozen=True)
class SensorRanges:
    """Section [sensor]: what the cameras are like that take the pictures. Lengths are in pixels of the picture."""

    exposure: tuple[float, float] = drawn(-2.6, 0.9, "exposure error, mostly near the middle", "EV", (-8.0, 8.0))
    balance: tuple[float, float] = drawn(0.4, 1.0, "how much of the light's color is removed", "", (0.0, 1.0))
    gains: tuple[float, float] = drawn(0.93, 1.07, "error of the gains of red and blue", "", (0.1, 10.0))
    cast_share: float = share(0.2, "share of pictures that keep a color cast")
    cast: tuple[float, float] = drawn(0.75, 1.33, "gains of red and blue where it stays", "", (0.1, 10.0))
    tones: tuple[str, ...] = some_of(TONES, "tone curves to choose from")
    gamma: tuple[float, float] = drawn(1.8, 2.4, "exponent of the tone curve gamma", "", (1.0, 4.0))
    shoulder: tuple[float, float] = drawn(0.4, 2.5, "bend of highlights of the tone curve filmic", "", (0.0, 20.0))
    saturation: tuple[float, float] = drawn(0.65, 1.35, "saturation, mostly near the middle", "", (0.0, 3.0))
    contrast: tuple[float, float] = drawn(-0.25, 0.45, "S-curve, mostly near the middle", "", (-1.0, 1.0))
    vignetting: tuple[float, float] = drawn(0.0, 0.45, "part of the light lost in the corners", "", (0.0, 1.0))
    defocus_share: float = share(0.45, "share of pictures out of focus")
    defocus: tuple[float, float] = drawn(0.3, 2.2, "radius of the blur where out of focus", "px", (0.01, 50.0))
    motion_share: float = share(0.25, "share of pictures with motion blur")
    motion: tuple[float, float] = drawn(1.0, 12.0, "length of motion blur, mostly short", "px", (0.01, 100.0))
    fringe: tuple[float, float] = drawn(-0.8, 0.8, "how far out red lies in the corners", "px", (-20.0, 20.0))
    glare: tuple[float, float] = drawn(0.0, 0.05, "part of the light that the lens scatters", "", (0.0, 1.0))
    full_well: tuple[float, float] = drawn(4000.0, 20000.0, "charge of a white pixel at gain 1", "e-", (10.0, 1e7))
    gain: tuple[float, float] = drawn(1.0, 12.0, "amplification (ISO / 100), mostly low", "", (1.0, 1000.0))
    read_noise: tuple[float, float] = drawn(1.5, 6.0, "noise of reading a pixel", "e-", (0.0, 1000.0))
    row_noise: tuple[float, float] = drawn(0.0, 1.2, "noise that a whole row shares", "e-", (0.0, 1000.0))
    mosaic_share: float = share(0.7, "share of pictures taken through a Bayer mosaic at full resolution")
    patterns: tuple[str, ...] = some_of(tuple(PATTERNS), "Bayer mosaics to choose from")
    sharpening: tuple[float, float] = drawn(0.0, 0.8, "strength of the sharpening halo", "", (0.0, 5.0))
    quality: tuple[float, float] = drawn(55.0, 97.0, "JPEG quality", "", (1.0, 100.0))
    chromas: tuple[str, ...] = some_of(tuple(CHROMAS), "JPEG chroma sampling to choose from")
    again_share: float = share(0.15, "share of pictures compressed once before")
    again: tuple[float, float] = drawn(40.0, 90.0, "JPEG quality of that compression", "", (1.0, 100.0))

    def __post_init__(self) -> None:
        check_entries(self)


@dataclass(frozen=True)
class Sensor:
    """The camera of one picture; names and units are those of SensorRanges. Defaults are an ideal camera."""

    exposure: float = 0.0
    balance: float = 0.0
    red: float = 1.0
    """Gain on top of white balance, as `blue`."""
    blue: float = 1.0
    tone: str = "srgb"
    gamma: float = 2.2
    shoulder: float = 1.0
    saturation: float = 1.0
    contrast: float = 0.0
    vignetting: float = 0.0
    defocus: float = 0.0
    motion: float = 0.0
    direction: float = 0.0
    """Of motion [rad], from right to down."""
    fringe: float = 0.0
    glare: float = 0.0
    full_well: float = 1e7
    gain: float = 1.0
    read_noise: float = 0.0
    row_noise: float = 0.0
    mosaic: str = ""
    """Empty for three chips: no mosaic."""
    sharpening: float = 0.0
    quality: int = 95
    chroma: str = "4:4:4"
    earlier_quality: int = 0
    """0 for a picture compressed only once."""
    seed: int = 0


def draw_sensor(random: np.random.Generator, ranges: SensorRanges) -> Sensor:
    """The camera of one picture."""
    # Every number is drawn whether it's used or not: a share that changes leaves the other draws as they were.
    cast = random.random() < ranges.cast_share
    defocused, moved = random.random() < ranges.defocus_share, random.random() < ranges.motion_share
    mosaic, again = random.random() < ranges.mosaic_share, random.random() < ranges.again_share
    gains = ranges.cast if cast else ranges.gains
    return Sensor(
        exposure=_middling(random, ranges.exposure),
        balance=uniform(random, ranges.balance),
        red=log_uniform(random, gains),
        blue=log_uniform(random, gains),
        tone=_choice(random, ranges.tones),
        gamma=uniform(random, ranges.gamma),
        shoulder=uniform(random, ranges.shoulder),
        saturation=_middling(random, ranges.saturation),
        contrast=_middling(random, ranges.contrast),
        vignetting=uniform(random, ranges.vignetting),
        defocus=log_uniform(random, ranges.defocus) * defocused,
        motion=log_uniform(random, ranges.motion) * moved,
        direction=uniform(random, (0.0, math.pi)),
        fringe=_middling(random, ranges.fringe),
        glare=uniform(random, ranges.glare),
        full_well=log_uniform(random, ranges.full_well),
        gain=log_uniform(random, ranges.gain),
        read_noise=uniform(random, ranges.read_noise),
        row_noise=uniform(random, ranges.row_noise),
        mosaic=_choice(random, ranges.patterns) * mosaic,
        sharpening=uniform(random, ranges.sharpening),
        quality=round(uniform(random, ranges.quality)),
        chroma=_choice(random, ranges.chromas),
        earlier_quality=round(uniform(random, ranges.again)) * again,
        seed=int(random.integers(2**32)),
    )


def _middling(random: np.random.Generator, span: Range) -> float:
    return (uniform(random, span) + uniform(random, span)) / 2.0


def _choice(random: np.random.Generator, names: tuple[str, ...]) -> str:
    return names[int(random.integers(len(names)))]


def metered(radiance: Singles, sensor: Sensor) -> Singles:
    """Radiance (h, w, 3), scaled by auto exposure: its log-average becomes mid gray, times 2 ** exposure error.

    Lamps, deep shadows and whatever is black, as around the circle of a fisheye, don't count.
    """
    luminance = radiance[::4, ::4] @ LUMINANCE
    seen = luminance[luminance > 0]
    if not seen.size:
        return radiance
    logarithm = np.log(seen)
    average = float(np.clip(logarithm, *np.percentile(logarithm, [15, 95])).mean())
    bend = sensor.shoulder if sensor.tone == "filmic" else 0.0
    # A filmic camera exposes lower and lifts the shadows again.
    gray = MID_GRAY / (1.0 + bend - MID_GRAY * bend)
    return np.asarray(radiance * np.float32(gray * 2.0**sensor.exposure / math.exp(average)))


def white_gains(light: Singles, sensor: Sensor) -> Singles:
    """Gains (3,) of white balance for metered light (h, w, 3): what might be white or gray becomes a bit more so.

    Only colors that lamps have count, below white: turf is too green, so a picture of nothing else stays green.
    """
    colors = np.clip(light[::4, ::4].reshape(-1, 3), 1e-4, 1.0)
    logs = np.log(colors)
    tint = 2.0 * logs[:, 1] - logs[:, 0] - logs[:, 2]
    weights = np.exp(-((tint / 0.6) ** 2)) * (colors @ LUMINANCE) * (colors.max(axis=1) < 1.0)
    red, green, blue = weights @ logs / (weights.sum() + 0.01 * len(weights))
    # More than the difference between daylight and a light bulb isn't the light's color.
    red_gain, blue_gain = np.exp(np.clip(sensor.balance * np.array([green - red, green - blue]), -0.7, 1.2))
    return np.array([red_gain * sensor.red, 1.0, blue_gain * sensor.blue], np.float32)


def developed(radiance: Singles, sensor: Sensor) -> Image:
    """The picture (h, w, 3) BGR that the camera takes of linear RGB radiance (h, w, 3), in whatever unit."""
    light = np.clip(metered(np.asarray(radiance, np.float32), sensor), 0.0, BRIGHTEST)
    gains = white_gains(light, sensor)
    signal = _read(_through_lens(light, sensor) * RESPONSE, sensor)
    # Green fills up first: what it lacks then must be cut from red and blue too, or lamps turn pink.
    balanced = np.minimum(signal * (gains / RESPONSE), 1.0)
    color = np.clip(cv2.transform(balanced, _saturation_matrix(sensor.saturation)), 0.0, 1.0)
    table = _tone_table(sensor)
    levels = table[(color * np.float32(len(table) - 1) + np.float32(0.5)).astype(np.uint16)]
    if sensor.sharpening > 0:
        levels += np.float32(sensor.sharpening) * (levels - cv2.GaussianBlur(levels, (5, 5), 1.0))
    # cv2 rounds and clips; numpy would wrap around.
    return np.asarray(cv2.cvtColor(cv2.convertScaleAbs(np.maximum(levels, 0.0)), cv2.COLOR_RGB2BGR), np.uint8)


def encoded(picture: Image, sensor: Sensor) -> bytes:
    """A picture (h, w, 3) BGR as JPEG file."""
    if sensor.earlier_quality:
        once = _jpeg(picture, sensor.earlier_quality, sensor.chroma)
        picture = np.asarray(cv2.imdecode(np.frombuffer(once, np.uint8), cv2.IMREAD_COLOR), np.uint8)
    return _jpeg(picture, sensor.quality, sensor.chroma)


def _jpeg(picture: Image, quality: int, chroma: str) -> bytes:
    options = [cv2.IMWRITE_JPEG_QUALITY, quality, cv2.IMWRITE_JPEG_SAMPLING_FACTOR, CHROMAS[chroma]]
    return cv2.imencode(".jpg", picture, options)[1].tobytes()


def blur_kernel(sensor: Sensor) -> Singles:
    """Weights (k, k), k odd, of defocus (a disk) and motion (a line) at once; sum 1, centered to the last digit.

    Sample points of the blur are shared out among the pixels around them, which keeps their center of mass.
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
    """Light (h, w, 3) on the chip: blurred, darker and fringed in the corners, with glare around lamps."""
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


def _read(light: Singles, sensor: Sensor) -> Singles:
    """What the chip makes of light (h, w, 3): full at 1, with the noise of light and electronics, and demosaiced."""
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
    colors = cv2.demosaicing(counts, PATTERNS[sensor.mosaic])
    return np.asarray((colors.astype(np.float32) - black) / (white - black), np.float32)


def _saturation_matrix(saturation: float) -> Singles:
    return np.asarray(saturation * np.eye(3) + (1.0 - saturation) * np.tile(LUMINANCE, (3, 1)), np.float32)


def _tone_table(sensor: Sensor) -> Singles:
    """Levels from 0 to 255, not yet rounded, of linear light from 0 to 1 in equal steps."""
    light = np.linspace(0.0, 1.0, 1 << 15)
    if sensor.tone == "filmic":
        light = light * (1.0 + sensor.shoulder) / (1.0 + sensor.shoulder * light)
    if sensor.tone == "gamma":
        tone = light ** (1.0 / sensor.gamma)
    else:
        tone = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1.0 / 2.4) - 0.055)
    tone = tone - sensor.contrast * np.sin(2.0 * np.pi * tone) / (2.0 * np.pi)
    return np.asarray(255.0 * tone, np.float32)
