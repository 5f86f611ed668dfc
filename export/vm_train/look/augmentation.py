"""Augmentation of patches: mirror images, turns, zooms, shifts, and the colors, blur and noise of other cameras."""

from __future__ import annotations

import math
from collections.abc import Callable

import torch
from torch.nn import functional

from .configuration import PatchAugmentation

_Change = Callable[[torch.Tensor, torch.Tensor], torch.Tensor]

_HIDDEN = (0.1, 0.45)
"""Shortest and longest side of a hidden rectangle, as a share of the patch's side."""

_REACH = 3
"""Samples that the blur reaches to each side."""


def augment(
    patches: torch.Tensor,
    targets: torch.Tensor,
    extent: float,
    settings: PatchAugmentation,
    random: torch.Generator,
) -> tuple[torch.Tensor, torch.Tensor]:
    """Changed copies of patches, uint8 (n, size, size, 3), as floats from 0 to 255, and their targets (n, 3).

    extent: half the side of a patch [expected radii], the unit of targets. random: on the CPU, so that each device
    makes the same changes. An entry that is switched off leaves the random numbers of the others as they are.
    """
    count, device = len(patches), patches.device
    chance = torch.rand((5, count), generator=random).to(device)
    strength = torch.rand((2, count), generator=random).to(device)
    normal = torch.randn((6, count), generator=random).to(device)
    offset = 2.0 * torch.rand((2, count), generator=random).to(device) - 1.0
    rectangle = torch.rand((4, count), generator=random).to(device)
    color = torch.rand((count, 3), generator=random).to(device)
    x = patches.float() / 255.0
    x, targets = _mirrored(x, targets, chance[0] < settings.mirror)
    if settings.rotation or settings.zoom or settings.shift:
        angle, zoom = math.radians(settings.rotation) * normal[4], torch.exp(settings.zoom * normal[5])
        x, targets = _moved(x, targets, angle, zoom, settings.shift * offset, extent)
    x = _where(chance[1] < settings.hidden, lambda some, rows: _hidden(some, rectangle[:, rows], color[rows]), x)
    x = x.clamp_min(1e-4) ** _each(torch.exp(settings.gamma * normal[0]))
    x = x * torch.exp(settings.gain * normal[1:4].T)[:, None, None, :]
    x = _where(chance[2] < settings.gray, lambda some, rows: some.mean(dim=3, keepdim=True).expand_as(some), x)
    low, high = settings.blur
    sigma = low + (high - low) * strength[0]
    x = _where(chance[3] < settings.blur_share, lambda some, rows: _blurred(some, sigma[rows]), x)
    deviation = settings.noise * strength[1]
    x = _where(chance[4] < settings.noise_share, lambda some, rows: _noisy(some, deviation[rows], random), x)
    return x.clamp(0.0, 1.0) * 255.0, targets


def _each(values: torch.Tensor) -> torch.Tensor:
    """Values (n,) of patches, to combine with the patches."""
    return values[:, None, None, None]


def _where(chosen: torch.Tensor, change: _Change, x: torch.Tensor) -> torch.Tensor:
    """The patches x with a change of those that are chosen (n,); `change` gets these and their positions."""
    rows = chosen.nonzero()[:, 0]
    if len(rows):
        x = x.clone()
        x[rows] = change(x[rows], rows)
    return x


def _mirrored(x: torch.Tensor, targets: torch.Tensor, chosen: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """Chosen patches (n,) as mirror images; their objects lie to the other side."""
    sides = torch.where(chosen[:, None], torch.tensor([-1.0, 1.0, 1.0], device=x.device), 1.0)
    return torch.where(_each(chosen), x.flip(2), x), targets * sides


def _moved(
    x: torch.Tensor, targets: torch.Tensor, angle: torch.Tensor, zoom: torch.Tensor, shift: torch.Tensor, extent: float
) -> tuple[torch.Tensor, torch.Tensor]:
    """Patches shifted (2, n) [expected radii], then zoomed and turned [rad] around their middles, and their targets.

    What comes in from outside repeats the border.
    """
    cosine, sine = torch.cos(angle), torch.sin(angle)
    # From a place in the new patch to that in the old one, where the border is at 1; then objects the other way.
    rows = [
        torch.stack([cosine / zoom, -sine / zoom, -shift[0] / extent], dim=1),
        torch.stack([sine / zoom, cosine / zoom, -shift[1] / extent], dim=1),
    ]
    planes = x.permute(0, 3, 1, 2)
    grid = functional.affine_grid(torch.stack(rows, dim=1), list(planes.shape), align_corners=False)
    planes = functional.grid_sample(planes, grid, padding_mode="border", align_corners=False)
    right, down = targets[:, 0] + shift[0], targets[:, 1] + shift[1]
    turned = [zoom * (cosine * right + sine * down), zoom * (cosine * down - sine * right)]
    return planes.permute(0, 2, 3, 1), torch.stack([*turned, targets[:, 2] + torch.log(zoom)], dim=1)


def _hidden(x: torch.Tensor, rectangle: torch.Tensor, color: torch.Tensor) -> torch.Tensor:
    """Patches behind rectangles of a color (n, 3); rectangle (4, n): place and size of each, all from 0 to 1."""
    at = (torch.arange(x.shape[1], device=x.device) + 0.5) / x.shape[1]
    low, high = _HIDDEN
    half = 0.5 * (low + (high - low) * rectangle[2:])
    across, along = ((at - rectangle[axis][:, None]).abs() < half[axis][:, None] for axis in (0, 1))
    return torch.where((along[:, :, None] & across[:, None, :])[..., None], color[:, None, None, :], x)


def _blurred(x: torch.Tensor, sigma: torch.Tensor) -> torch.Tensor:
    """Patches after a Gaussian blur with a standard deviation (n,) for each."""
    count, size = x.shape[:2]
    steps = torch.arange(-_REACH, _REACH + 1.0, device=x.device)
    kernel = torch.exp(-0.5 * (steps / sigma[:, None]) ** 2)
    kernel = (kernel / kernel.sum(dim=1, keepdim=True)).repeat_interleave(3, dim=0)[:, None, None, :]
    rows = x.permute(0, 3, 1, 2).reshape(1, 3 * count, size, size)
    for _ in range(2):  # along the rows, then along the columns
        padded = functional.pad(rows, (_REACH, _REACH, 0, 0), mode="replicate")
        rows = functional.conv2d(padded, kernel, groups=3 * count).transpose(2, 3)
    return rows.reshape(count, 3, size, size).permute(0, 2, 3, 1)


def _noisy(x: torch.Tensor, deviation: torch.Tensor, random: torch.Generator) -> torch.Tensor:
    """Patches with noise of a standard deviation (n,) for each, where 1 is white."""
    return x + torch.randn(x.shape, generator=random).to(x.device) * _each(deviation)
