"""Draws the pictures of meshes in docs/ and prints the numbers of their tables: python -m benchmarks.mesh_pictures"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from vm_embedded import Circle, Cylinder, Equisolid, Orientation, Sphere
from vm_embedded.arrays import Number
from vm_embedded.mesh.walls import wall_distances
from vm_mesh.built_mesh import BuiltMesh, MeshPlan
from vm_mesh.drawing import draw_mesh
from vm_mesh.quality import points_on_object
from vm_train.evaluation.points_on_ball import PosedCamera
from vm_train.evaluation.points_on_ball_plot import points_figure, points_over_distance
from vm_workstation.plots import new_figure, save_figure

FOLDER = Path(__file__).parents[1] / "docs"
BALL = Sphere(0.095)
POST = Cylinder(0.05, 1.8)
RING, OURS, OBJECT, GRAY = "#4c72b0", "#1b9e77", "#d95f02", "#999999"

PAPER_CAMERA = PosedCamera(
    Orientation.from_roll_pitch(0.9, pitch=math.radians(45.0)),
    Equisolid(focal_length=420.0, fov=2.6, size=(1280, 1024)),
    (1280, 1024),
)
"""A camera like that of the pictures of the paper's authors. It sees from the point below itself to the horizon.

Of the camera in its figure, the paper gives only the size of the pictures, 1280 x 1024 px. Height and lens come from
the pictures published with the paper's code: 0.78 to 1.2 m high, median 0.9 m; equisolid, f = 420 px, fov 1.6 to 2.6
rad.
"""


class EarlySphere(Sphere):
    """A ball with the theta of an early version of the reference: 2 asin(r / (h tan(phi) + r)).

    The added r avoids the singularity of the paper's `circle_dtheta`, where the sine would exceed 1. But it makes the
    rings near the camera's foot too dense, by (d + r) / d at distance d. The result is a peak at 0 m like the one in
    the paper's figure (section "Precision"); our theta has no such peak.
    """

    def theta(self, n: Number, height: Number) -> Number:
        return 2.0 * np.arcsin(self.radius / (height * np.tan(self.phi(n, height)) + self.radius))


def main() -> None:
    save_figure(draw_models(), FOLDER / "mesh-models.png")
    save_figure(draw_shapes(), FOLDER / "mesh-shapes.svg")
    save_figure(draw_below(), FOLDER / "mesh-below.png")
    save_figure(draw_tall(), FOLDER / "mesh-tall.png")
    save_figure(draw_ball_distance(), FOLDER / "ball-distance.svg")


def draw_models():
    """The reference's twelve models from above, with balls at 0, 0.6 and 1.2 m."""
    figure = new_figure(8.4, 11.4)
    axes = figure.subplots(4, 3)
    plan = MeshPlan(BALL, 1.0, 2.0, 4.0)
    for row, kind in zip(axes, ("ring", "xygrid", "xmgrid", "nmgrid"), strict=True):
        for each, neighbors in zip(row, (4, 6, 8), strict=True):
            built = BuiltMesh.build(f"{kind}{neighbors}", plan)
            draw_mesh(each, built, "ground", 1.7, (0.0, 0.6, 1.2))
            each.set_title(built.model, fontsize=10)
            each.set_xlim(-1.7, 1.7)
            each.set_ylim(-1.7, 1.7)
            each.set_xlabel("")
            each.set_ylabel("")
            each.tick_params(labelsize=7)
    return figure


def draw_shapes():
    """Circles, spheres and cylinders behind each other, and the width of an object."""
    figure = new_figure(10.5, 7.6)
    axes = figure.subplots(2, 2)
    for each, shape in zip(axes.flat, (Circle(0.15), Sphere(0.15), Cylinder(0.15, 0.45)), strict=False):
        draw_objects_in_a_row(each, shape, height=1.0, count=4)
    draw_width(axes[1, 1], away=1.6, radius=0.3)
    return figure


def draw_objects_in_a_row(axes, shape, height, count):
    """The camera's rays phi(0) to phi(count) from the side, and the objects that fill the gaps between them."""
    axes.axhline(0.0, color=GRAY, linewidth=1.0)
    axes.plot(0.0, height, "o", color="black", markersize=5)
    for n in range(count + 1):
        slope = float(np.tan(shape.phi(float(n), height)))
        axes.plot([0.0, slope * height], [height, 0.0], color=RING, linewidth=0.9)
        place = (slope * height, 0.0)
        style = {"textcoords": "offset points", "fontsize": 8, "ha": "center", "color": RING}
        axes.annotate(f"$\\varphi({n})$", place, (0, -12), **style)
    for n in range(count):
        near, far = (float(np.tan(shape.phi(float(m), height))) for m in (n, n + 1))
        if isinstance(shape, Circle):
            axes.plot([near * height, far * height], [0.0, 0.0], color=OBJECT, linewidth=3.0)
        elif isinstance(shape, Sphere):
            middle = (height - shape.radius) * np.tan((np.arctan(near) + np.arctan(far)) / 2.0)
            turn = np.linspace(0.0, 2.0 * np.pi, 60)
            x, y = middle + shape.radius * np.cos(turn), shape.radius * (1.0 + np.sin(turn))
            axes.fill(x, y, color=OBJECT, alpha=0.5)
        else:
            left, right, top = near * height, near * height + 2 * shape.radius, shape.object_height
            axes.fill([left, right, right, left], [0, 0, top, top], color=OBJECT, alpha=0.5)
    axes.set_title(f"{type(shape).__name__.lower()}s, each at the end of the shadow before it", fontsize=9)
    axes.set_aspect("equal")
    axes.axis("off")


def draw_width(axes, away, radius):
    """An object from above, with the two tangents from the camera."""
    turn = np.linspace(0.0, 2.0 * np.pi, 100)
    axes.fill(away + radius * np.cos(turn), radius * np.sin(turn), color=OBJECT, alpha=0.5)
    half = np.arcsin(radius / away)
    for sign in (-1, 1):
        end = 2.1
        axes.plot([0.0, end * np.cos(half)], [0.0, sign * end * np.sin(half)], color=RING, linewidth=0.9)
    axes.plot(0.0, 0.0, "o", color="black", markersize=5)
    axes.plot([0.0, away], [0.0, 0.0], color=GRAY, linewidth=0.8, linestyle="--")
    axes.plot([away, away - radius * np.sin(half)], [0.0, radius * np.cos(half)], color="black", linewidth=0.9)
    axes.annotate("$D$", (0.8, -0.08), fontsize=10)
    axes.annotate("$r$", (away + 0.03, 0.12), fontsize=10)
    axes.annotate("$\\theta = 2 \\,\\arcsin(r / D)$", (0.25, 0.3), fontsize=10, color=RING)
    axes.set_title("the width of an object, from above", fontsize=9)
    axes.set_aspect("equal")
    axes.axis("off")


def draw_below():
    """ring6 and cap6 below the camera, and the equivalent k over distance."""
    figure = new_figure(10.5, 8.4)
    top, bottom = figure.subfigures(2, 1, height_ratios=(1.25, 1.0))
    plan = MeshPlan(BALL, 1.0, 4.0, 6.0)
    for axes, model in zip(top.subplots(1, 2), ("ring6", "cap6"), strict=True):
        draw_mesh(axes, BuiltMesh.build(model, plan), "ground", 0.62, (0.0, 0.35))
        axes.set_title(f"{model}, k = 4", fontsize=10)
        axes.set_xlim(-0.6, 0.6)
        axes.set_ylim(-0.6, 0.6)
    distances = np.concatenate([np.linspace(0.0, 1.2, 121), np.linspace(1.25, 4.0, 20)])
    draw_points_on_ball(bottom.subplots(), distances)
    print_points_on_ball(distances)
    return figure


def draw_points_on_ball(axes, distances):
    """The equivalent k over distances (m,) [m] for three meshes; prints some of its values."""
    axes.axhspan(3.0, 5.0, color="#dddddd", alpha=0.6, linewidth=0)
    for name, model, shape, color in (
        ("ring6, widths of an early version of the reference", "ring6", EarlySphere(0.095), OBJECT),
        ("ring6", "ring6", BALL, RING),
        ("cap6", "cap6", BALL, OURS),
    ):
        curve = points_on_object(BuiltMesh.build(model, MeshPlan(shape, 1.0, 4.0, 6.0)), distances)
        axes.plot(distances, curve.mean, color=color, linewidth=1.3, label=name)
        axes.fill_between(distances, curve.low, curve.high, color=color, alpha=0.18, linewidth=0)
        shown = (0, 0.05, 0.1, 0.2, 0.4)
        print(name, " ".join(f"{d:.2f} m {curve.mean[np.argmin(abs(distances - d))]:.2f}" for d in shown))
    axes.set_xlabel("distance of a ball from the point below the camera [m]")
    axes.set_ylabel("equivalent k")
    axes.set_xlim(0.0, 2.0)
    axes.set_ylim(bottom=0.0)
    axes.grid(alpha=0.25)
    axes.legend(frameon=False, fontsize=9)


def print_points_on_ball(distances):
    """The table of ring6 and cap6: lowest and highest equivalent k over all bearings and distances (m,) [m]."""
    near = distances <= 0.7
    for height in (0.5, 1.0, 1.2):
        for k in (3.0, 4.0, 6.0):
            for model in ("ring6", "cap6"):
                built = BuiltMesh.build(model, MeshPlan(BALL, height, k, 6.0))
                found = points_on_object(built, distances)
                print(
                    f"h {height} k {k:g} {model}: {len(built.mesh)} points, k {found.low.min():.2f} to "
                    f"{found.high.max():.2f}; within 0.7 m {found.low[near].min():.2f} to {found.high[near].max():.2f}"
                )


def draw_ball_distance():
    """The paper's fig:ball_distance_graph for a ball of 0.075 m; prints the points on it at some distances."""
    distances = np.linspace(0.0, 10.0, 201)
    curves = points_over_distance(PAPER_CAMERA, Sphere(0.075), (3, 4, 5), distances)
    for curve in curves:
        shown = (f"{curve.mean[np.argmin(abs(distances - d))]:.1f} at {d} m" for d in (0, 1, 2, 5, 10))
        print(curve.mesh, curve.intersections, curve.count, "points on screen; on the ball:", ", ".join(shown))
    return points_figure(curves, "camera 0.9 m high, 45 degrees down, 1280 x 1024 px; ball of radius 0.075 m")


def draw_tall():
    """The points of rings and of walls on a goal post that is higher than the camera."""
    figure = new_figure(10.5, 8.6)
    top, bottom = figure.subfigures(2, 1, height_ratios=(1.25, 1.0))
    titles = {"ring6": "ring6, for the post's foot", "wall6": "wall6, each post with its own wall"}
    for axes, (model, title) in zip(top.subplots(1, 2, sharey=True), titles.items(), strict=True):
        draw_posts(axes, mesh_for_posts(model, height=1.0), OURS if model == "wall6" else RING)
        axes.set_title(title, fontsize=10)
    figure.axes[0].set_ylabel("elevation [deg]")
    titles = ("rows of points that cross the post", "points in a row across it")
    for part, (axes, title) in enumerate(zip(bottom.subplots(1, 2), titles, strict=True)):
        draw_points_on_post(axes, part, title, np.geomspace(0.3, 9.9, 40))
    figure.axes[-1].legend(frameon=False, fontsize=8)
    return figure


def mesh_for_posts(model, height):
    """wall6 for posts, or ring6 for their feet (circles of the same radius on the ground), from a camera height [m]."""
    shape = POST if model == "wall6" else Circle(POST.radius)
    return BuiltMesh.build(model, MeshPlan(shape, height, 4.0, 10.0))


def draw_posts(axes, built, color):
    """Three posts by bearing and elevation, each with the points that serve it."""
    bearing = np.degrees(np.arctan2(built.mesh.rays[:, 1], built.mesh.rays[:, 0]))
    elevation = np.degrees(np.arcsin(built.mesh.rays[:, 2]))
    for away, around in ((0.5, -35.0), (1.6, 0.0), (6.0, 25.0)):
        outline = POST.outline(post_at(away, np.radians(around), built.plan.height), built.plan.height, 160)
        x, y = np.degrees(np.arctan2(outline[:, 1], outline[:, 0])), np.degrees(np.arcsin(outline[:, 2]))
        axes.fill(x, y, color=OBJECT, alpha=0.35, linewidth=0)
        axes.annotate(f"{away:g} m", (around, 62.0), ha="center", fontsize=8, color=OBJECT)
        chosen = serves(built, away) & (np.abs(bearing - around) < 14.0)
        axes.plot(bearing[chosen], elevation[chosen], ".", color=color, markersize=1.5)
    axes.axhline(0.0, color=GRAY, linewidth=0.8, linestyle="--")
    axes.set_xlim(-52.0, 40.0)
    axes.set_ylim(-68.0, 68.0)
    axes.set_xlabel("bearing [deg]")


def draw_points_on_post(axes, part, title, distances):
    """Rows (part 0) or points in a row (part 1) on a post over distances (m,) [m]; prints their ranges."""
    axes.axhspan(3.0, 5.0, color="#dddddd", alpha=0.6, linewidth=0)
    for camera, style in ((0.5, ":"), (1.2, "-")):
        for model, color in (("ring6", RING), ("wall6", OURS)):
            values = points_on_post(mesh_for_posts(model, camera), distances)[part]
            label = f"{model}, camera {camera:g} m"
            axes.loglog(distances, values.mean(axis=1), style, color=color, linewidth=1.2, label=label)
            print(f"{title}: {model} h {camera}: {values.min():.2f} to {values.max():.2f}")
    axes.set_xlabel("distance of the post [m]")
    axes.set_title(title + ", k = 4", fontsize=10)
    axes.set_xticks([0.3, 1, 3, 10], labels=["0.3", "1", "3", "10"])
    axes.set_yticks([1, 3, 4, 5, 10, 30, 100, 300], labels=["1", "3", "4", "5", "10", "30", "100", "300"])
    axes.minorticks_off()
    axes.grid(alpha=0.25)


def points_on_post(built, distances):
    """Rows that cross a post, and the median number of points in them: (2, m, bearings) at distances (m,) [m]."""
    rays = np.ascontiguousarray(built.mesh.rays)
    level, bearing = np.round(rays[:, 2], 12), np.arctan2(rays[:, 1], rays[:, 0])
    bearings = np.linspace(0.5, 1.4, 7)
    found = np.zeros((2, len(distances), len(bearings)))
    for i, away in enumerate(distances.tolist()):
        serving = serves(built, away)
        for j, around in enumerate(bearings.tolist()):
            near = np.flatnonzero(serving & (np.abs(bearing - around) < 1.1 * np.arcsin(POST.radius / away)))
            center = post_at(away, around, built.plan.height)
            hit = near[POST.offset(rays[near], center[None], built.plan.height)[0] < 1.0]
            _, counts = np.unique(level[hit], return_counts=True)  # the first and last row may be hit only in part
            found[:, i, j] = len(counts), np.median(counts)
    return found


def serves(built, away):
    """Mask (n,) of the points that serve a post at a distance [m]: all of a ring mesh, one wall of wall6."""
    if built.walls is None:
        return np.ones(len(built.mesh), dtype=bool)
    return built.walls == np.argmin(np.abs(wall_distances(POST, 4.0, 10.0) / away - 1.0))


def post_at(away: float, around: float, height: float):
    """Center (3,) [m] of a post at a distance [m] and bearing [rad], relative to a camera."""
    return np.array([away * np.cos(around), away * np.sin(around), POST.center_height - height])


if __name__ == "__main__":
    main()
