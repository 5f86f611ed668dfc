"""The camera sensor of one picture: its exposure, colors, blur, noise and compression, drawn from ranges.

`vm_synth.render.image_processing` applies these parameters.

The paper varies the intensity of the light (section "Dataset"); here the exposure varies.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from vm_embedded.config.entries import check_entries, share
from vm_workstation.ranges import Range, drawn, log_uniform, range_of, some_of, uniform

TONES = ("srgb", "gamma", "filmic")
MOSAICS = ("RGGB", "BGGR", "GRBG", "GBRG")
CHROMAS = ("4:2:0", "4:4:4")


@dataclass(frozen=True)
class SensorRanges:
    """Section [sensor]: ranges of the parameters of `Sensor`."""

    exposure: tuple[float, float] = range_of(
        -2.6, 0.9, "exposure error; values near the middle are more likely", "EV", (-8.0, 8.0)
    )
    bright_share: float = share(0.0, "share of pictures that are overexposed")
    bright: tuple[float, float] = range_of(
        0.9, 2.4, "exposure error of these pictures; values near the middle are more likely", "EV", (-8.0, 8.0)
    )
    balance: tuple[float, float] = range_of(
        0.4, 1.0, "share of the light's color that white balance removes", "", (0.0, 1.0)
    )
    gains: tuple[float, float] = range_of(0.93, 1.07, "error of the red and blue gains", "", (0.1, 10.0))
    cast_share: float = share(0.2, "share of pictures with a color cast")
    cast: tuple[float, float] = range_of(
        0.75, 1.33, "error of the red and blue gains in pictures with a color cast", "", (0.1, 10.0)
    )
    tones: tuple[str, ...] = some_of(TONES, "tone curves")
    gamma: tuple[float, float] = range_of(1.8, 2.4, "exponent of the tone curve 'gamma'", "", (1.0, 4.0))
    shoulder: tuple[float, float] = range_of(
        0.4, 2.5, "compression of highlights by the tone curve 'filmic'", "", (0.0, 20.0)
    )
    saturation: tuple[float, float] = range_of(
        0.65, 1.35, "saturation; values near the middle are more likely", "", (0.0, 3.0)
    )
    contrast: tuple[float, float] = range_of(
        -0.25, 0.45, "strength of the S-curve; values near the middle are more likely", "", (-1.0, 1.0)
    )
    vignetting: tuple[float, float] = range_of(0.0, 0.45, "share of the light that the corners lose", "", (0.0, 1.0))
    defocus_share: float = share(0.45, "share of pictures out of focus")
    defocus: tuple[float, float] = range_of(0.3, 2.2, "radius of the defocus blur", "px", (0.01, 50.0))
    motion_share: float = share(0.25, "share of pictures with motion blur")
    motion: tuple[float, float] = range_of(
        1.0, 12.0, "length of the motion blur; short ones are more likely", "px", (0.01, 100.0)
    )
    fringe: tuple[float, float] = range_of(-0.8, 0.8, "outward shift of red in the corners", "px", (-20.0, 20.0))
    glare: tuple[float, float] = range_of(0.0, 0.05, "share of the light that the lens scatters", "", (0.0, 1.0))
    full_well: tuple[float, float] = range_of(4000.0, 20000.0, "charge of a white pixel at gain 1", "e-", (10.0, 1e7))
    gain: tuple[float, float] = range_of(
        1.0, 12.0, "amplification (ISO / 100); low values are more likely", "", (1.0, 1000.0)
    )
    read_noise: tuple[float, float] = range_of(1.5, 6.0, "read noise of a pixel", "e-", (0.0, 1000.0))
    row_noise: tuple[float, float] = range_of(0.0, 1.2, "noise shared by a whole row", "e-", (0.0, 1000.0))
    mosaic_share: float = share(0.7, "share of pictures with a Bayer mosaic")
    patterns: tuple[str, ...] = some_of(MOSAICS, "Bayer mosaics")
    sharpening: tuple[float, float] = range_of(0.0, 0.8, "strength of the sharpening halo", "", (0.0, 5.0))
    quality: tuple[float, float] = range_of(55.0, 97.0, "JPEG quality", "", (1.0, 100.0))
    chromas: tuple[str, ...] = some_of(CHROMAS, "JPEG chroma subsampling")
    again_share: float = share(0.15, "share of pictures that are compressed twice")
    again: tuple[float, float] = range_of(40.0, 90.0, "JPEG quality of the first of two compressions", "", (1.0, 100.0))

    def __post_init__(self) -> None:
        check_entries(self)


@dataclass(frozen=True)
class Sensor:
    """The sensor of one picture. Names and units are those of SensorRanges; the defaults are an ideal sensor."""

    exposure: float = 0.0
    balance: float = 0.0
    red: float = 1.0
    """Gain after white balance, like `blue`."""
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
    """Direction of the motion blur [rad]; 0 is right, pi / 2 is down."""
    fringe: float = 0.0
    glare: float = 0.0
    full_well: float = 1e7
    gain: float = 1.0
    read_noise: float = 0.0
    row_noise: float = 0.0
    mosaic: str = ""
    """Bayer mosaic, or empty for full color at each pixel."""
    sharpening: float = 0.0
    quality: int = 95
    chroma: str = "4:4:4"
    earlier_quality: int = 0
    """JPEG quality of an earlier compression, or 0 if there was only one."""
    seed: int = 0


def draw_sensor(random: np.random.Generator, ranges: SensorRanges) -> Sensor:
    """Draw the sensor of one picture."""
    # All values are drawn, used or not: changing a share does not change the values that follow.
    cast = random.random() < ranges.cast_share
    defocused, moved = random.random() < ranges.defocus_share, random.random() < ranges.motion_share
    mosaic, again = random.random() < ranges.mosaic_share, random.random() < ranges.again_share
    gains = ranges.cast if cast else ranges.gains
    exposure = ranges.bright if drawn(random, ranges.bright_share) else ranges.exposure
    return Sensor(
        exposure=_near_middle(random, exposure),
        balance=uniform(random, ranges.balance),
        red=log_uniform(random, gains),
        blue=log_uniform(random, gains),
        tone=_choice(random, ranges.tones),
        gamma=uniform(random, ranges.gamma),
        shoulder=uniform(random, ranges.shoulder),
        saturation=_near_middle(random, ranges.saturation),
        contrast=_near_middle(random, ranges.contrast),
        vignetting=uniform(random, ranges.vignetting),
        defocus=log_uniform(random, ranges.defocus) * defocused,
        motion=log_uniform(random, ranges.motion) * moved,
        direction=uniform(random, (0.0, math.pi)),
        fringe=_near_middle(random, ranges.fringe),
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


def _near_middle(random: np.random.Generator, span: Range) -> float:
    """A number from a triangular distribution over the range."""
    return (uniform(random, span) + uniform(random, span)) / 2.0


def _choice(random: np.random.Generator, names: tuple[str, ...]) -> str:
    return names[int(random.integers(len(names)))]
