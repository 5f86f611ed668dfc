"""From results.json to tables and plots of docs/performance.md, experiments/speed.md and the README.

The text between the tables stays as it is.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np

matplotlib.use("Agg")
from matplotlib import pyplot

RESULTS = Path(__file__).with_name("results.json")
OTHER_MACHINE = Path(__file__).with_name("results_xeon.json")
PEER_TIMES = Path(__file__).with_name("peer_times.json")
DOCS = Path(__file__).parents[1] / "docs"
PAGE = DOCS / "performance.md"
EXPERIMENTS = Path(__file__).with_name("experiments")
SPEED = EXPERIMENTS / "speed.md"
README = DOCS.parent / "README.md"


def table(heads: list[str], rows: list[list[str]]) -> str:
    lines = [heads, ["---"] + ["---:"] * (len(heads) - 1), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def fill(page: Path, made: dict[str, str]) -> None:
    """Put each part between its mark, <!-- name -->, and <!-- end -->. Ends the program if a mark is missing."""
    text = page.read_text()
    for name, content in made.items():
        mark = f"<!-- {name} -->\n"
        if mark not in text:
            raise SystemExit(f"{page} has no {mark.strip()}")
        before, after = text.split(mark)
        text = before + mark + content + "\n" + after[after.index("<!-- end -->") :]
    page.write_text(text)


def ms(value: float) -> str:
    return f"{value:.2f}" if value < 10 else f"{value:.1f}"


def number(value: float | None, digits: int = 2, unit: float = 1.0) -> str:
    return "-" if value is None else f"{unit * value:.{digits}f}"


def spread(values: Sequence[float | None], digits: int = 3, unit: float = 1.0) -> str:
    """The mean of the seeds, and in parentheses the lowest and the highest value."""
    known = [unit * each for each in values if each is not None]
    if not known:
        return "-"
    low, high = min(known), max(known)
    mean = f"{np.mean(known):.{digits}f}"
    return mean if len(known) == 1 else f"{mean} ({low:.{digits}f} to {high:.{digits}f})"


def machine(found: dict[str, Any]) -> str:
    about = found["machine"]
    return (
        f"{about['processor']}, {about['cores']} cores, {about['vectors']}, {found['sgemm_gflops']:g} GFLOP/s in "
        f"single-precision matrix products on one core; Python {about['python']}, numpy {about['numpy']}, onnxruntime "
        f"{about['onnxruntime']}, OpenCV {about['opencv']}. Frames: {found['frames']}."
    )


def sessions(found: dict[str, Any]) -> str:
    rows = []
    for name, part in found["sessions"].items():
        row = part["median_frame"]
        operations = found["operations_per_point"][name]
        floor = 1e3 * operations * row["points"] / (1e9 * found["sgemm_gflops"])
        values = [ms(row[kind]["p50"]) for kind in ("session", "numpy")]
        rows.append([name, str(row["points"]), *values, f"{floor:.3f}"])
    return table(["network", "points", "session", "numpy", "floor"], rows)


def whole_calls(found: dict[str, Any]) -> str:
    rows = [
        [
            name,
            str(row["points"]),
            ms(row["session"]["p50"]),
            ms(row["whole"]["p50"]),
            ms(row["whole"]["p99"]),
            f"{row['whole_over_session']:.2f}",
            f"{row['p99_over_p50']:.2f}",
        ]
        for name, row in found["whole_calls"].items()
    ]
    heads = ["network", "points", "session", "whole call", "p99", "whole call / session", "p99 / median"]
    return table(heads, rows)


def shipped(found: dict[str, Any], other: dict[str, Any]) -> str:
    """Whole calls of the networks of the package on two machines."""
    rows = []
    for name, row in found["shipped"].items():
        times = [each["total"][share] for each in (row, other["shipped"][name]) for share in ("p50", "p99")]
        rows.append([name, str(row["points"]), *map(ms, times)])
    return table(["network", "points", "EPYC", "p99", "Xeon", "p99"], rows)


def stages(found: dict[str, Any]) -> str:
    names = list(dict.fromkeys(stage for row in found["shipped"].values() for stage in row["stages_ms"]))
    rows = []
    for name, row in found["shipped"].items():
        times = [ms(row["stages_ms"][each]) if each in row["stages_ms"] else "-" for each in names]
        rows.append([name, str(row["found"]), *times])
    return table(["network", "found", *names], rows)


def speed(found: dict[str, Any]) -> str:
    """The README's part: whole calls of the networks of the package, with the mesh that they come with."""
    whole = {name: row for name, row in found["shipped"].items() if name.endswith("to 14 m")}
    assert {row["found"] for row in whole.values()} == {1}
    about = f"Time for a picture of 640 x 512 px with one ball, on one core of an {found['machine']['processor']}:"
    rows = [
        [name.split(",")[0], str(row["points"]), *(f"{row['total'][share]:.1f} ms" for share in ("p50", "p99"))]
        for name, row in whole.items()
    ]
    return f"{about}\n\n{table(['network', 'points', 'whole call, median', 'p99'], rows)}"


def peers(found: dict[str, Any], other: dict[str, Any]) -> str:
    """Whole calls on two machines, and how much longer they take than the first network, which is ours."""
    rows = []
    for name, row in sorted(found["peers"]["calls"].items(), key=lambda item: item[1]["p50"]):
        line = [name]
        for each in (found, other):
            calls = each["peers"]["calls"]
            line += [ms(calls[name]["p50"]), f"{calls[name]['p50'] / calls['Visual Mesh 5x4']['p50']:.1f}"]
        rows.append([*line, ms(row["first"])])
    return table(["detector", "EPYC", "relative", "Xeon", "relative", "first call, EPYC"], rows)


def instruction_sets(found: dict[str, Any]) -> str:
    sets = found["instruction_sets"]
    first = next(iter(sets.values()))
    rows = [
        [name, kind, *(ms(each[name][kind]["p50"]) for each in sets.values())] for name in first for kind in first[name]
    ]
    return table(["network", "call", *sets], rows)


def growth(found: dict[str, Any]) -> str:
    names = {"intersections": "k", "distance": "m", "resolution": "megapixels"}
    parts = []
    for part, key in names.items():
        rows = [[f"{row[key]:g}", str(row["points"]), ms(row["total"]["p50"])] for row in found["growth"][part]]
        parts.append(table([f"{part} [{key}]" if part != "intersections" else part, "points", "whole call"], rows))
    threads = [
        [row["network"], str(row["threads"]), str(row["points"]), ms(row["total"]["p50"]), ms(row["total"]["p99"])]
        for row in found["growth"]["threads"]
    ]
    parts.append(table(["network", "threads", "points", "whole call", "p99"], threads))
    return "\n\n".join(parts)


def walks(found: dict[str, Any]) -> str:
    rows = [
        [name, f"{row['height_m']:g}", f"{100 * row['hit_rate']:.1f} %", f"{row['cache_mib']:.1f}"]
        for name, part in found["walks"].items()
        for row in part["walks"]
    ]
    return table(["mesh of", "height [m]", "hits after the first swing", "cache [MiB]"], rows)


def cold(found: dict[str, Any]) -> str:
    """The time to prepare a bucket."""
    rows = []
    for name, part in found["walks"].items():
        kinds = [part["cold"][kind] for kind in ("bucket_ms", "mesh_and_bucket_ms")]
        rows.append([name, *(ms(kind[share]) for kind in kinds for share in ("p50", "p99"))])
    return table(["mesh of", "bucket", "p99", "bucket and mesh", "p99"], rows)


def soak(found: dict[str, Any]) -> str:
    row = found["soak"]
    marks = table(
        ["frames", *(f"{mark['frames']:,}" for mark in row["marks"])],
        [["RSS [MiB]", *(f"{mark['rss_mib']:.1f}" for mark in row["marks"])]],
    )
    return f"{marks}\n\nMemory growth after the first 10 % of the run: {100 * row['growth_since_a_tenth']:.2f} %."


def tables() -> dict[Path, dict[str, str]]:
    """All tables of each page, by the names of their marks."""
    found, other = (json.loads(file.read_text()) for file in (RESULTS, OTHER_MACHINE))
    of_both = {"shipped": shipped(found, other), "peers": peers(found, other)}
    return {
        PAGE: {"machine": machine(found), **of_both, "cold": cold(found)},
        SPEED: {
            "sessions": sessions(found),
            "whole-calls": whole_calls(found),
            "stages": stages(found),
            "growth": growth(found),
            "instruction-sets": instruction_sets(found),
            "walks": walks(found),
            "soak": soak(found),
        },
        README: {"speed": speed(found)},
    }


def plot_peers(found: dict[str, Any], path: Path) -> None:
    calls = sorted(found["peers"]["calls"].items(), key=lambda item: -item[1]["p50"])
    figure, axes = pyplot.subplots(figsize=(7.5, 3.6), layout="constrained")
    colors = ["#2a7f62" if name.startswith("Visual") else "#9aa5b1" for name, _ in calls]
    bars = axes.barh([name for name, _ in calls], [row["p50"] for _, row in calls], color=colors)
    axes.bar_label(bars, labels=[f" {ms(row['p50'])} ms" for _, row in calls], fontsize=8)
    axes.set_xscale("log")
    axes.set_xlim(0.1, 200)
    axes.set_xlabel("whole call on one core [ms], log scale")
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(labelsize=8)
    figure.savefig(path, dpi=130)
    pyplot.close(figure)


_LEFT_OF_POINT = (
    *("Visual Mesh 5", "ball", "SSD MobileNet v1, 300"),
    *("YOLO v1, 448", "YOLO v3, 416", "YOLO nano, 640"),
)
"""Names that would cover another one on the right of their points."""


def plot_roofline(found: dict[str, Any], path: Path) -> None:
    """Whole calls over the multiplications and additions of their networks, above the time that these need at least.

    found: peer_times.json, in which all detectors took turns.
    """
    rate = found["sgemm_gflops"]
    figure, axes = pyplot.subplots(figsize=(7.5, 4.0), layout="constrained")
    ends = [1e-4, 200.0]
    axes.plot(ends, [1e3 * each / rate for each in ends], color="#9aa5b1")
    axes.annotate(
        f"floor: {rate:g} GFLOP/s", (0.02, 1e3 * 0.02 / rate), (4, -12), textcoords="offset points", fontsize=8
    )
    for name, row in found["calls"].items():
        ours = name.startswith(("Visual", "ball"))
        x, y = row["operations"] / 1e9, row["p50"]
        axes.plot(x, y, "o", color="#2a7f62" if ours else "#4f81bd")
        left = name in _LEFT_OF_POINT
        place = {"xytext": (-6 if left else 6, 0), "ha": "right" if left else "left"}
        axes.annotate(name, (x, y), textcoords="offset points", fontsize=8, va="center", **place)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlim(1e-4, 2e3)
    axes.set_xlabel("multiplications and additions of a call [billions], log scale")
    axes.set_ylabel("whole call on one core [ms], log scale")
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(labelsize=8)
    figure.savefig(path, dpi=130)
    pyplot.close(figure)


def plot_growth(found: dict[str, Any], path: Path) -> None:
    figure, (left, right) = pyplot.subplots(1, 2, figsize=(7.5, 3.0), layout="constrained", sharey=True)
    for part, mark in (("intersections", "o"), ("distance", "s")):
        rows = found["growth"][part]
        left.plot([row["points"] for row in rows], [row["total"]["p50"] for row in rows], mark, label=f"more {part}")
    left.set_xlabel("points")
    left.set_ylabel("whole call, five layers [ms]")
    left.legend(frameon=False, fontsize=8)
    rows = found["growth"]["resolution"]
    right.plot([row["megapixels"] for row in rows], [row["total"]["p50"] for row in rows], "o-", color="#2a7f62")
    right.set_xscale("log")
    right.set_xlabel("picture [megapixels], log scale")
    for axes in (left, right):
        axes.set_ylim(0, None)
        axes.spines[["top", "right"]].set_visible(False)
        axes.tick_params(labelsize=8)
    figure.savefig(path, dpi=130)
    pyplot.close(figure)


def main() -> None:
    for page, parts in tables().items():
        fill(page, parts)
    found = json.loads(RESULTS.read_text())
    plot_peers(found, DOCS / "performance-peers.png")
    plot_roofline(json.loads(PEER_TIMES.read_text()), EXPERIMENTS / "speed-roofline.png")
    plot_growth(found, DOCS / "performance-growth.png")


if __name__ == "__main__":
    main()
