"""The figures of vm-bench as a text table."""

from __future__ import annotations

import math
from typing import Any


def bench_table(found: dict[str, Any]) -> str:
    """The figures that vm-bench writes as JSON, as lines of text; times are milliseconds."""
    machine, cold, walk = found["machine"], found["cold"], found["walk"]
    lines = [
        f"{machine['processor']}, {machine['cores']} cores, {machine['vectors']}, onnxruntime {machine['onnxruntime']}",
        f"{found['model']['file']}: {found['operations_per_point']} operations "
        f"per point; sgemm {found['sgemm_gflops']:g} GFLOP/s on one core",
        f"{walk['frames']} frames of {found['image'][0]}x{found['image'][1]}, "
        f"median {found['runs'][0]['points']} points, around height {walk['height_m']:.2f} m, "
        f"pitch {round(math.degrees(walk['pitch_rad']))} deg, roll {round(math.degrees(walk['roll_rad']))} deg",
        "",
        f"{'threads':>8}{'p50':>9}{'p90':>9}{'p99':>9}{'p99.9':>9}"
        f"{'points/s':>12}{'x floor':>9}{'hits':>8}{'cache MiB':>11}",
    ]
    for run in found["runs"]:
        total = run["total_ms"]
        over = "-" if run["infer_over_floor"] is None else f"{run['infer_over_floor']:.1f}"
        lines.append(
            f"{run['threads']:>8}{total['p50']:>9.3f}{total['p90']:>9.3f}{total['p99']:>9.3f}{total['p99.9']:>9.3f}"
            f"{run['points_per_s']:>12,}{over:>9}{100 * run['hit_rate']:>7.1f}%{run['cache_mib']:>11.1f}"
        )
    names = list(found["runs"][0]["stages_ms"])
    lines += ["", f"{'stage':>8}" + "".join(f"{name:>9}" for name in names)]
    for run in found["runs"]:
        stages = run["stages_ms"].values()
        lines.append(f"{run['threads']:>8}" + "".join(f"{each['p50']:>9.3f}" for each in stages))
        lines.append(f"{'share':>8}" + "".join(f"{100 * each['share']:>8.1f}%" for each in stages))
    bucket, mesh = cold["bucket_ms"], cold["mesh_and_bucket_ms"]
    lines += [
        "",
        f"first frame of a new orientation bucket: {bucket['p50']:.1f} more (p99 {bucket['p99']:.1f}), "
        f"of a new mesh height: {mesh['p50']:.1f} more (p99 {mesh['p99']:.1f})",
        f"memory of the process: {found['rss_mib']:.0f} MiB",
        "times in milliseconds; stages: median and share of the total time; x floor: time of the network divided by "
        "the time of its operations at the sgemm rate; first frame: median time to prepare mesh and points that the "
        "cache does not have",
    ]
    return "\n".join(lines)
