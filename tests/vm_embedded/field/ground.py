"""Mesh points on a plane, and what a perfect network would say about a drawn field."""

import numpy as np

from vm_embedded.field.ground_points import GroundPoints, ground_map

HEIGHT, ACROSS = 0.9, 0.06


def mesh(height=HEIGHT, across=ACROSS, reach=12.0, half_angle=1.2, heading=0.0):
    """Places (n, 2) of rings of points around the camera, as those of a Visual Mesh."""
    rings, r = [], 0.3
    while r < reach:
        count = int(2.0 * half_angle * r / across)
        angles = heading - half_angle + (np.arange(count) + 0.5 * (len(rings) % 2)) * across / r
        rings.append(r * np.stack([np.cos(angles), np.sin(angles)], axis=1))
        r += across * np.hypot(r, height) / height
    return np.concatenate(rings)


def turned(angle):
    """Rotation (2, 2) for rows."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, s], [-s, c]])


def ground(places, labels, height=HEIGHT, across=ACROSS, sure=0.95):
    """Points from near to far with labels (n,): goal, robot, line, field or outside.

    The rest of each probability is outside.
    """
    ahead = places.sum(axis=0) if len(places) else np.array([1.0, 0.0])
    heading = np.column_stack([ahead, [-ahead[1], ahead[0]]]) / np.hypot(*ahead)
    rays = np.column_stack([places @ heading, np.full(len(places), -height)])
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    inside = np.where(
        np.isin(labels, ["line", "field"]), 2.0 * sure - 1.0, np.where(labels == "outside", -1.0, sure - 1.0)
    )
    return GroundPoints(
        ground_map(rays, np.arange(len(rays))),
        np.ones(len(rays), dtype=bool),
        np.where(labels == "line", sure, 0.0).astype(np.float32),
        inside.astype(np.float32),
        height,
        across,
        heading,
    )


def inside_of(places, corners):
    """Which places (n, 2) are inside of a convex polygon (m, 2) with its corners counterclockwise."""
    ahead = np.roll(corners, -1, axis=0) - corners
    away = places[:, None] - corners
    return (ahead[:, 0] * away[..., 1] - ahead[:, 1] * away[..., 0] >= 0.0).all(axis=1)


def near_segment(places, start, end):
    """Distance (n,) of places (n, 2) to a straight piece."""
    start, end = np.asarray(start, float), np.asarray(end, float)
    along = end - start
    t = np.clip((places - start) @ along / (along @ along), 0.0, 1.0)
    return np.hypot(*(places - start - t[:, None] * along).T)


def behind(places, base, width, height, camera=HEIGHT):
    """Which places (n, 2) are hidden by something upright: its base (2,), width and height [m]."""
    base = np.asarray(base, float)
    distance = np.hypot(*base)
    toward = base / distance
    r, across = places @ toward, places @ np.array([-toward[1], toward[0]])
    farthest = distance * camera / (camera - height) if height < camera else np.inf
    return (r >= distance) & (r <= farthest) & (np.abs(across) <= 0.5 * width * r / distance)
