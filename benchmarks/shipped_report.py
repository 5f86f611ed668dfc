"""Tables, plots and model cards from benchmarks/shipped.json: `python -m benchmarks.shipped_report`."""

from __future__ import annotations

import json
import textwrap
import tomllib
from typing import Any

import numpy as np

from benchmarks import measured_frames
from benchmarks.field import RESULTS as FIELD_RESULTS
from benchmarks.field import figures
from benchmarks.report import DOCS, EXPERIMENTS, README, fill, number, table
from benchmarks.shipped import METERS, NETWORKS, RANGES, RESULTS, SETS
from vm_embedded.network.bundled import DEFAULT, model_path
from vm_embedded.network.look_contract import LookContract
from vm_embedded.network.model_file import read_model
from vm_workstation.plots import new_figure, save_figure

PAGE = DOCS / "results.md"
MORE = EXPERIMENTS / "networks.md"
COLORS = {"ball": "#d95f02", "soccer": "#1b9e77"}


def networks(found: dict[str, Any], each_set: str) -> str:
    """All networks on a test set in one table, with the default settings and over all confidences.

    The paper shows far balls in fig:ball_detection_images_2.
    """
    rows = []
    for name, sets in found["networks"].items():
        scores = sets[each_set]
        used, ranked = scores["used 0.5"], scores["ranked 0.5"]
        near, far = "0.5 to 6 m", "6 to 10 m"
        rows.append(
            [
                name,
                *(number(ranked[each]["average_precision"], 3) for each in (near, far)),
                *(number(scores["ranked 0.75"][each]["average_precision"], 3) for each in (near, far)),
                *(number(used[each]["recall"], 1, 100.0) for each in (near, far)),
                number(scores["all"]["false_per_picture"], 3),
                number(used[near]["distance_error"], 2, 100.0),
            ]
        )
    heads = ["network", "AP50, 0.5 to 6 m", "6 to 10 m", "AP75, 0.5 to 6 m", "6 to 10 m"]
    heads += ["recall [%], 0.5 to 6 m", "6 to 10 m", "false per picture", "distance error [%]"]
    return table(heads, rows)


def accuracy(found: dict[str, Any]) -> str:
    """The README's part: all networks on fields."""
    tests = [each["field"] for each in found["networks"].values()]
    ((pictures, width, height),) = {(each["pictures"], *each["size"]) for each in tests}
    about = (
        f"The test is {pictures} rendered pictures of soccer fields, {width} x {height} px, lit by panoramas that no "
        "training has seen:"
    )
    rows = []
    for name, sets in found["networks"].items():
        scores = sets["field"]
        near, far = "0.5 to 6 m", "6 to 10 m"
        rows.append(
            [
                name,
                *(number(scores["ranked 0.5"][each]["average_precision"], 2) for each in (near, far)),
                *(number(scores["used 0.5"][each]["recall"], 0, 100.0) + " %" for each in (near, far)),
                number(scores["all"]["false_per_picture"]),
                number(scores["used 0.5"][near]["distance_error"], 1, 100.0) + " %",
            ]
        )
    heads = ["network", "AP50, 0.5 to 6 m", "AP50, 6 to 10 m", "found, 0.5 to 6 m", "found, 6 to 10 m"]
    made = table([*heads, "false per picture", "median distance error"], rows)
    return f"{textwrap.fill(about, 120)}\n\n{made}"


def readme() -> dict[str, str]:
    """The README's parts about accuracy, by the names of their marks."""
    found, real = (json.loads(each.read_text()) for each in (RESULTS, measured_frames.RESULTS))
    return {"accuracy": accuracy(found), "real frames": measured_frames.sentence(real)}


def proposals(found: dict[str, Any]) -> str:
    """Proposals, centers, calibration and balls of the wrong size, for each network and test set."""
    rows = []
    for name, sets in found["networks"].items():
        for each in SETS:
            scores = sets[each]
            wrong = (scores["wrong_sizes"][factor] for factor in ("0.5", "2"))
            rows.append(
                [
                    name,
                    each,
                    number(scores["proposals"]["recall_0.5"], 1, 100.0),
                    f"{scores['proposals']['mean_count']:.0f}",
                    number(scores["all"]["center_error"], 3),
                    number(scores["calibration_error"]["ranked"], 3),
                    number(scores["calibration_error"]["used"], 3),
                    *(f"{factor['accepted']} of {factor['balls']}" for factor in wrong),
                ]
            )
    heads = ["network", "test pictures", "proposed [%]", "proposals", "center error [radii]"]
    ends = ["calibration error, all", "reported", "accepted with a mesh for half the radius", "for twice"]
    return table([*heads, *ends], rows)


def grid(found: dict[str, Any]) -> str:
    """A network on each lens, size and height: balls found, and false ones.

    The paper: with less information, the accuracy declines (section "Discussion and Conclusion").
    """
    heights = sorted({name.rsplit("-", 1)[1] for name in found["grid"]}, key=float)
    cells = sorted({name.rsplit("-", 1)[0] for name in found["grid"]}, key=lambda name: (name.split("-")[0], len(name)))
    rows = []
    for cell in cells:
        lens, size = cell.split("-")
        row = [f"{lens}, {size.replace('x', ' x ')}"]
        for height in heights:
            scores = found["grid"].get(f"{cell}-{height}")
            shown = (
                ("-", "-")
                if scores is None
                else (number(scores["recall"], 0, 100.0), number(scores["false_per_picture"]))
            )
            row.append(" / ".join(shown))
        rows.append(row)
    return table(["lens, picture [px]", *(f"{height} m" for height in heights)], rows)


def field_features(found: dict[str, Any], points: bool) -> str:
    """Features of the field on each test set, or the F1 of the mesh points by class."""
    columns = [list(figures(each["f1"], each["features"])) for each in found["sets"].values()]
    rows = [
        [same[0].name, *("-" if each.value is None else f"{each.value:.3f}" for each in same)]
        for same in zip(*columns, strict=True)
        if same[0].name.startswith("F1 of") == points
    ]
    return table(["measure", *found["sets"]], rows)


def by_distance(scores: dict[str, Any]) -> str:
    """Scores of a network on a test set over distance.

    The paper shows far balls in fig:ball_detection_images_2.
    """
    rows = []
    for meters in METERS:
        row = scores["ranked 0.5"][meters]
        rows.append(
            [
                meters,
                number(row["balls"], 0),
                number(row["average_precision"], 3),
                number(scores["ranked 0.75"][meters]["average_precision"], 3),
                number(scores["used 0.5"][meters]["recall"], 1, 100.0),
                number(scores["used 0.5"][meters]["distance_error"], 2, 100.0),
            ]
        )
    return table(["distance", "balls", "AP50", "AP75", "recall [%]", "distance error [%]"], rows)


def plot(found: dict[str, Any]) -> None:
    """Precision over recall, and average precision over distance."""
    figure = new_figure(11.0, 4.4)
    curves, distances = figure.subplots(1, 2)
    middles = np.arange(len(METERS)) + 0.5
    for name, sets in found["networks"].items():
        scores = sets["field"]
        _, precision, recall = np.array(scores["curve"]).T
        curves.plot(recall, precision, color=COLORS[name], label=name)
        for overlap, style in ((0.5, "-"), (0.75, ":")):
            values = [scores[f"ranked {overlap}"][meters]["average_precision"] for meters in METERS]
            distances.plot(middles, np.array(values, float), style, color=COLORS[name], label=f"IoU {overlap:g}")
    curves.set_xlabel("recall of balls, IoU 0.5")
    curves.set_ylabel("precision")
    distances.set_xlabel("distance on the plane [m]")
    distances.set_ylabel("average precision (dotted: IoU 0.75)")
    for axes in (curves, distances):
        axes.set_ylim(0.0, 1.02)
        axes.set_xlim(left=0.0)
        axes.grid(alpha=0.25)
        axes.spines[["top", "right"]].set_visible(False)
    curves.legend(frameon=False, loc="lower left")
    save_figure(figure, DOCS / "networks.svg")


def _look_data(look: LookContract) -> str:
    """The training data of a close look, for a card."""
    channels, made = ", ".join(map(str, look.channels)), look.provenance
    calibrated = ", ".join(f"{each.name} on {each.calibrated_on}" for each in look.classes)
    text = (
        f"- **Close look at {', '.join(look.names)}:** {look.size} x {look.size} samples, convolutions of {channels} "
        f"channels. {made['training_pictures']} pictures of the same kind. Seed {made['seed']}, configuration "
        f"`export/networks/look.toml`. Calibrated: {calibrated}"
    )
    filled = textwrap.fill(text, 120, subsequent_indent="  ", break_on_hyphens=False)
    return f"{filled}\n  (`python -m benchmarks.calibration_data`).\n"


def card(found: dict[str, Any], field: dict[str, Any], name: str) -> str:
    """A network's model card: contents, training data, accuracy and limits."""
    robots = field["sets"]["field"]["features"]["robots"]["near"]["recall"]
    weak = (
        f" Up to 6 m, {number(1.0 - robots, 0, 100.0)} % of the robots are missed, and line points beyond are rare:\n"
        "docs/results.md has the figures of all features of the field."
    )
    model = read_model(model_path(name))
    manifest = model.manifest
    configuration = tomllib.loads((NETWORKS / f"{name}.toml").read_text())
    depth, width = (configuration["network"][each] for each in ("depth", "width"))
    assert manifest.look is not None
    scores, clutter = (found["networks"][name][each] for each in SETS)
    ranges = table(
        ["distance", "balls", "AP50", "AP75", "recall [%]"],
        [
            [
                each,
                number(scores["ranked 0.5"][each]["balls"], 0),
                number(scores["ranked 0.5"][each]["average_precision"], 3),
                number(scores["ranked 0.75"][each]["average_precision"], 3),
                number(scores["used 0.5"][each]["recall"], 1, 100.0),
            ]
            for each in RANGES
        ],
    )
    made, used = manifest.provenance, scores["used 0.5"]["0.5 to 6 m"]
    hard = clutter["ranked 0.5"]["0.5 to 6 m"]
    kilobytes = model_path(name).stat().st_size / 1000
    size = " x ".join(map(str, scores["size"]))
    return f"""# {name}

Finds {"balls, goal posts, robots, lines and the border" if name == "soccer" else "balls"} on a soccer field. A network
on mesh octaves, with {depth} separable convolutions of {width} channels at full resolution, shows cells and peaks. The
mesh has k = {manifest.intersections:g} and reaches to {manifest.max_distance:g} m. A close look decides about the best
peaks. All suit balls of any radius (`--object-radius`, default {manifest.object_radius:g} m). {kilobytes:.0f} kB.
Classes: {", ".join(each.name for each in manifest.classes)}.

- **Training data of the mesh network:** {made["training_pictures"]} rendered pictures
  (`export/vm_synth/varied.toml`, seed 1). Validation on {made["validation_pictures"]} other pictures chose epoch
  {made["epoch"]} of {made["epochs"]}. Seed {made["seed"]}, configuration `export/networks/{name}.toml`.
{_look_data(manifest.look)}- **To train it again:** `make networks HDRI=folder-of-maps`. The file's SHA-256 is
  {model.sha256}.

The test has {scores["pictures"]} rendered pictures of fields under six panoramas that no training uses, {size} px, with
balls of 0.05 to 0.12 m radius:

{ranges}

With the default settings there are {number(scores["all"]["false_per_picture"], 3)} false balls per picture, and the
median distance error of balls from 0.5 to 6 m is {number(used["distance_error"], 1, 100.0)} %. Of the balls with a
radius of at least 2 px that are at least a quarter visible,
{number(scores["proposals"]["recall_0.5"], 1, 100.0)} % have a proposal within half a radius; there are
{scores["proposals"]["mean_count"]:.0f} proposals per picture on average.
On {clutter["pictures"]} pictures full of things that look like balls, AP50 from 0.5 to 6 m is
{number(hard["average_precision"], 3)}, with {number(clutter["all"]["false_per_picture"], 3)} false balls per picture.
docs/results.md has more figures.

**Limits.** It was trained on rendered pictures only. The balls were mostly white, orange, yellow or of other bright
colors, and lay on the plane. Balls darker than the field, balls in the air, and cameras below 0.35 m or above 1.3 m
were rare or absent.{weak if name == "soccer" else ""}
"""


def main() -> None:
    found, field = json.loads(RESULTS.read_text()), json.loads(FIELD_RESULTS.read_text())
    made = {
        "networks on fields": networks(found, "field"),
        "networks in clutter": networks(found, "clutter"),
        f"{DEFAULT} by distance": by_distance(found["networks"][DEFAULT]["field"]),
        "features of the field": field_features(field, points=False),
    }
    if found["grid"]:
        made["grid"] = grid(found)
    fill(PAGE, made)
    more = {"proposals": proposals(found), "points of the field": field_features(field, points=True)}
    more["false an hour"] = table(
        ["network", "test pictures", "false balls per picture", "per hour at 30 frames per second"],
        [
            [name, each, number(sets[each]["all"]["false_per_picture"], 3), f"{sets[each]['false_an_hour']:,}"]
            for name, sets in found["networks"].items()
            for each in SETS
        ],
    )
    fill(MORE, more)
    fill(README, readme())
    for name in found["networks"]:
        model_path(name).with_suffix(".md").write_text(card(found, field, name))
    plot(found)


if __name__ == "__main__":
    main()
