"""Draws the pictures of docs/meshes.md, and prints the figures that its tables have.

python docs/mesh_pictures.py
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vm_embedded.geometry.circle import Circle
from vm_embedded.geometry.cylinder import Cylinder
from vm_embedded.geometry.sphere import Sphere
from vm_embedded.mesh.walls import wall_distances
from vm_mesh.built_mesh import BuiltMesh, MeshPlan
from vm_mesh.drawing import draw_mesh
from vm_mesh.quality import points_on_object
from vm_train.evaluation.points_on_ball import EarlySphere
from vm_workstation.plots import new_figure, save_figure

FOLDER = Path(__file__).parent
BALL = Sphere(0.095)
POST = Cylinder(0.05, 1.8)
RING, OURS, OBJECT, GRAY = "#4c72b0", "#1b9e77", "#d95f02", "#999999"


def main() -> None:
    save_figure(models(), FOLDER / "mesh-models.png")
    save_figure(shapes(), FOLDER / "mesh-shapes.svg")
    save_figure(below(), FOLDER / "mesh-below.png")
    save_figure(tall(), FOLDER / "mesh-tall.png")


def models():
    """The reference's twelve models from above, with balls at 0, 0.5 and 1 m."""
    figure = new_figure(8.4, 11.4)
    axes = figure.subplots(4, 3)
    plan = MeshPlan(BALL, 1.0, 2.0, 4.0)
    for row, kind in zip(axes, ("ring", "xygrid", "xmgrid", "nmgrid"), strict=True):
        for each, neighbors in zip(row, (4, 6, 8), strict=True):
            made = BuiltMesh.build(f"{kind}{neighbors}", plan)
            draw_mesh(each, made, "ground", 1.7, (0.0, 0.6, 1.2))
            each.set_title(made.model, fontsize=10)
            each.set_xlim(-1.7, 1.7)
            each.set_ylim(-1.7, 1.7)
            each.set_xlabel("")
            each.set_ylabel("")
            each.tick_params(labelsize=7)
    return figure


def shapes():
    """How objects line up behind each other: circles, spheres, cylinders; and a cylinder's width."""
    figure = new_figure(10.5, 7.6)
    axes = figure.subplots(2, 2)
    height, count = 1.0, 4
    for each, shape in zip(axes.flat, (Circle(0.15), Sphere(0.15), Cylinder(0.15, 0.45)), strict=False):
        each.axhline(0.0, color=GRAY, linewidth=1.0)
        each.plot(0.0, height, "o", color="black", markersize=5)
        tops = {Circle: 0.0, Sphere: 2 * shape.radius}.get(type(shape), getattr(shape, "object_height", 0.0))
        for n in range(count + 1):
            slope = float(np.tan(shape.phi(float(n), height)))
            each.plot([0.0, slope * height], [height, 0.0], color=RING, linewidth=0.9)
            each.annotate(
                f"$\\varphi({n})$",
                (slope * height, 0.0),
                (0, -12),
                textcoords="offset points",
                fontsize=8,
                ha="center",
                color=RING,
            )
        for n in range(count):
            near, far = (float(np.tan(shape.phi(float(m), height))) for m in (n, n + 1))
            if isinstance(shape, Circle):
                each.plot([near * height, far * height], [0.0, 0.0], color=OBJECT, linewidth=3.0)
            elif isinstance(shape, Sphere):
                middle = (height - shape.radius) * np.tan((np.arctan(near) + np.arctan(far)) / 2.0)
                turn = np.linspace(0.0, 2.0 * np.pi, 60)
                each.fill(
                    middle + shape.radius * np.cos(turn), shape.radius * (1.0 + np.sin(turn)), color=OBJECT, alpha=0.5
                )
            else:
                foot = near * height
                each.fill(
                    [foot, foot + 2 * shape.radius, foot + 2 * shape.radius, foot],
                    [0, 0, tops, tops],
                    color=OBJECT,
                    alpha=0.5,
                )
        each.set_title(f"{type(shape).__name__.lower()}s, one in the end of the other's shadow", fontsize=9)
        each.set_aspect("equal")
        each.axis("off")
    each = axes[1, 1]
    away, radius, turn = 1.6, 0.3, np.linspace(0.0, 2.0 * np.pi, 100)
    each.fill(away + radius * np.cos(turn), radius * np.sin(turn), color=OBJECT, alpha=0.5)
    half = np.arcsin(radius / away)
    for sign in (-1, 1):
        end = 2.1
        each.plot([0.0, end * np.cos(half)], [0.0, sign * end * np.sin(half)], color=RING, linewidth=0.9)
    each.plot(0.0, 0.0, "o", color="black", markersize=5)
    each.plot([0.0, away], [0.0, 0.0], color=GRAY, linewidth=0.8, linestyle="--")
    each.plot([away, away - radius * np.sin(half)], [0.0, radius * np.cos(half)], color="black", linewidth=0.9)
    each.annotate("$D$", (0.8, -0.08), fontsize=10)
    each.annotate("$r$", (away + 0.03, 0.12), fontsize=10)
    each.annotate("$\\theta = 2 \\,\\arcsin(r / D)$", (0.25, 0.3), fontsize=10, color=RING)
    each.set_title("from above: the width of any of them", fontsize=9)
    each.set_aspect("equal")
    each.axis("off")
    return figure


def below():
    """Below the camera: both meshes, and the equivalent k."""
    figure = new_figure(10.5, 8.4)
    top, bottom = figure.subfigures(2, 1, height_ratios=(1.25, 1.0))
    plan = MeshPlan(BALL, 1.0, 4.0, 6.0)
    for axes, model in zip(top.subplots(1, 2), ("ring6", "cap6"), strict=True):
        draw_mesh(axes, BuiltMesh.build(model, plan), "ground", 0.62, (0.0, 0.35))
        axes.set_title(f"{model}, k = 4", fontsize=10)
        axes.set_xlim(-0.6, 0.6)
        axes.set_ylim(-0.6, 0.6)
    distances = np.concatenate([np.linspace(0.0, 1.2, 121), np.linspace(1.25, 4.0, 20)])
    curves = {}
    axes = bottom.subplots()
    axes.axhspan(3.0, 5.0, color="#dddddd", alpha=0.6, linewidth=0)
    for name, model, shape, color in (
        ("ring6, widths of an early version of the reference", "ring6", EarlySphere(0.095), OBJECT),
        ("ring6", "ring6", BALL, RING),
        ("cap6", "cap6", BALL, OURS),
    ):
        curve = curves[name] = points_on_object(BuiltMesh.build(model, MeshPlan(shape, 1.0, 4.0, 6.0)), distances)
        axes.plot(distances, curve.mean, color=color, linewidth=1.3, label=name)
        axes.fill_between(distances, curve.low, curve.high, color=color, alpha=0.18, linewidth=0)
    axes.set_xlabel("distance of a ball from the point below the camera [m]")
    axes.set_ylabel("equivalent k")
    axes.set_xlim(0.0, 2.0)
    axes.set_ylim(bottom=0.0)
    axes.grid(alpha=0.25)
    axes.legend(frameon=False, fontsize=9)
    for height in (0.5, 1.0, 1.2):
        for k in (3.0, 4.0, 6.0):
            for model in ("ring6", "cap6"):
                made = BuiltMesh.build(model, MeshPlan(BALL, height, k, 6.0))
                found = points_on_object(made, distances)
                near = distances <= 0.7
                print(
                    f"h {height} k {k:g} {model}: {len(made.mesh)} points, k {found.low.min():.2f} to "
                    f"{found.high.max():.2f}; within 0.7 m {found.low[near].min():.2f} to {found.high[near].max():.2f}"
                )
    for name, curve in curves.items():
        print(
            name,
            " ".join(f"{d:.2f} m {curve.mean[np.argmin(abs(distances - d))]:.2f}" for d in (0, 0.05, 0.1, 0.2, 0.4)),
        )
    return figure


def tall():
    """A goal post as high as the camera and higher: what rings and walls put on it."""
    figure = new_figure(10.5, 8.6)
    top, bottom = figure.subfigures(2, 1, height_ratios=(1.25, 1.0))
    height, places = 1.0, ((0.5, -35.0), (1.6, 0.0), (6.0, 25.0))
    ring = BuiltMesh.build("ring6", MeshPlan(Circle(POST.radius), height, 4.0, 10.0))
    walls = BuiltMesh.build("wall6", MeshPlan(POST, height, 4.0, 10.0))
    for axes, made, title in zip(
        top.subplots(1, 2, sharey=True),
        (ring, walls),
        ("ring6, for the post's foot", "wall6, each post with its own wall"),
        strict=True,
    ):
        bearing = np.degrees(np.arctan2(made.mesh.rays[:, 1], made.mesh.rays[:, 0]))
        elevation = np.degrees(np.arcsin(made.mesh.rays[:, 2]))
        for away, around in places:
            center = post_at(away, np.radians(around), height)
            outline = POST.outline(center, height, 160)
            axes.fill(
                np.degrees(np.arctan2(outline[:, 1], outline[:, 0])),
                np.degrees(np.arcsin(outline[:, 2])),
                color=OBJECT,
                alpha=0.35,
                linewidth=0,
            )
            axes.annotate(f"{away:g} m", (around, 62.0), ha="center", fontsize=8, color=OBJECT)
            chosen = np.abs(bearing - around) < 14.0
            if made is walls:
                serving = np.argmin(np.abs(wall_distances(POST, 4.0, 10.0) / away - 1.0))
                chosen &= made.walls == serving
            axes.plot(bearing[chosen], elevation[chosen], ".", color=RING if made is ring else OURS, markersize=1.5)
        axes.axhline(0.0, color=GRAY, linewidth=0.8, linestyle="--")
        axes.set_xlim(-52.0, 40.0)
        axes.set_ylim(-68.0, 68.0)
        axes.set_xlabel("bearing [deg]")
        axes.set_title(title, fontsize=10)
    figure.axes[0].set_ylabel("elevation [deg]")
    distances = np.geomspace(0.3, 9.9, 40)
    for axes, what in zip(
        bottom.subplots(1, 2), ("rows of points that cross the post", "points in a row across it"), strict=True
    ):
        axes.axhspan(3.0, 5.0, color="#dddddd", alpha=0.6, linewidth=0)
        for camera, style in ((0.5, ":"), (1.2, "-")):
            for model, shape, color in (("ring6", Circle(POST.radius), RING), ("wall6", POST, OURS)):
                found = across(BuiltMesh.build(model, MeshPlan(shape, camera, 4.0, 10.0)), distances)
                values = found[0] if what.startswith("rows") else found[1]
                axes.loglog(
                    distances,
                    values.mean(axis=1),
                    style,
                    color=color,
                    linewidth=1.2,
                    label=f"{model}, camera {camera:g} m",
                )
                print(f"{what}: {model} h {camera}: {values.min():.2f} to {values.max():.2f}")
        axes.set_xlabel("distance of the post [m]")
        axes.set_title(what + ", k = 4", fontsize=10)
        axes.set_xticks([0.3, 1, 3, 10], labels=["0.3", "1", "3", "10"])
        axes.set_yticks([1, 3, 4, 5, 10, 30, 100, 300], labels=["1", "3", "4", "5", "10", "30", "100", "300"])
        axes.minorticks_off()
        axes.grid(alpha=0.25)
    figure.axes[-1].legend(frameon=False, fontsize=8)
    return figure


def across(made: BuiltMesh, distances):
    """Rows that cross a post, and the median of their points (m, bearings), at distances (m,) [m]."""
    rays = np.ascontiguousarray(made.mesh.rays)
    level, bearing = np.round(rays[:, 2], 12), np.arctan2(rays[:, 1], rays[:, 0])
    bearings = np.linspace(0.5, 1.4, 7)
    found = np.zeros((2, len(distances), len(bearings)))
    for i, away in enumerate(distances.tolist()):
        serving = np.argmin(np.abs(wall_distances(POST, 4.0, 10.0) / away - 1.0))
        for j, around in enumerate(bearings.tolist()):
            near = np.abs(bearing - around) < 1.1 * np.arcsin(POST.radius / away)
            kept = np.flatnonzero(near if made.walls is None else near & (made.walls == serving))
            hit = kept[
                POST.offset(rays[kept], post_at(away, around, made.plan.height)[None], made.plan.height)[0] < 1.0
            ]
            _, counts = np.unique(level[hit], return_counts=True)  # of the rows at its ends only a part may lie on it
            found[:, i, j] = len(counts), np.median(counts)
    return found


def post_at(away: float, around: float, height: float):
    """Center (3,) [m] of a post at a distance [m] and bearing [rad], relative to a camera."""
    return np.array([away * np.cos(around), away * np.sin(around), POST.center_height - height])


if __name__ == "__main__":
    main()
