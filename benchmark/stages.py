"""Times of the stages, by StageBenchmark."""
import json
import os
import re
import subprocess
import tempfile

from common import BIN, at_most, progress, run

YARDSTICK = "cv::StereoSGBM, MODE_SGBM"
BLOCK_MATCHING = "cv::StereoBM, window 15"
SEGMENTATION = "segmentation (30,5)"
REFINEMENT = "plane refinement (30,5)"
MATCHING = "census SGM"
AGGREGATED = "census SGM, aggregate_rows"
QUALITY = "quality refinement (30,5)"
SIZES = ["640x480", "1242x375", "1920x1200", "4096x3000"]
TARGETS = {
    MATCHING: 0.30,
    "census SGM, 2 threads": 0.18,
    "census SGM, 16-byte vectors": 0.50,
    SEGMENTATION: 0.065,
    "segmentation (30,5), 2 threads": 0.045,
    "count surface, 161x61": 0.06,
    REFINEMENT: 0.03,
}
BOTH_IN_BLOCK_MATCHING = 0.5
# The stages of a whole frame one after the other.
FRAMES = {
    "frame: census SGM, segmentation, plane refinement": ([MATCHING, SEGMENTATION, REFINEMENT], 0.4),
    "frame: census SGM, segmentation, quality refinement": ([AGGREGATED, SEGMENTATION, QUALITY], 1.0),
    "the same, 2 threads": ([f"{stage}, 2 threads" for stage in (AGGREGATED, SEGMENTATION, QUALITY)], 0.6),
}


def versions():
    """OpenCV, compiler, and whether ximgproc is there."""
    return json.loads(run([BIN / "StageBenchmark", "--versions"]))


def run_sets(sets, repetitions):
    """{set: {stage: figures}} of one run of the program."""
    with tempfile.NamedTemporaryFile(suffix=".json") as file:
        command = [BIN / "StageBenchmark", f"--benchmark_filter=^({'|'.join(sets)})/", "--benchmark_min_time=0.05",
                   f"--benchmark_repetitions={repetitions}", f"--benchmark_out={file.name}",
                   "--benchmark_out_format=json"]
        # Since Google Benchmark 1.6: what else the machine does hits all alike.
        if "random_interleaving" in run([BIN / "StageBenchmark", "--help"]):
            command.append("--benchmark_enable_random_interleaving=true")
        run(command, stderr=subprocess.PIPE)
        with open(file.name) as text:
            results = json.load(text)["benchmarks"]
    figures = {}
    # Interleaving shuffles them.
    for result in sorted(results, key=lambda result: result.get("family_index", 0)):
        if result.get("run_type") == "aggregate":
            continue
        name, stage = re.sub("/(real_time|repeats:[0-9]+)", "", result["name"]).split("/", 1)
        stages = figures.setdefault(name, {})
        entry = stages.setdefault(stage, {"threads": int(result["threads_used"]), "megapixels": result["megapixels"],
                                          "cpu_ms": [], "wall_ms": []})
        entry["cpu_ms"].append(result["cpu_time"])
        entry["wall_ms"].append(result["real_time"])
    for stages in figures.values():
        yardstick = stages[YARDSTICK]
        for entry in stages.values():
            # One thread: what it has computed, whoever else was served. More threads: the time until they are done.
            clock = "cpu_ms" if entry["threads"] == 1 else "wall_ms"
            entry["ms"] = min(entry[clock])
            entry["ratio"] = entry["ms"] / min(yardstick[clock])
            entry["ms_per_megapixel"] = entry["ms"] / entry["megapixels"]
    return figures


def measure(short):
    kitti = ["KITTI"] if os.environ.get("DISPARITY_REFINEMENT_KITTI") else []
    runs = [(SIZES[:2] + kitti, 2)] if short else [(SIZES[:2] + kitti, 5), (SIZES[2:3], 3), (SIZES[3:], 2)]
    figures = {}
    for sets, repetitions in runs:
        progress(f"Timing the stages: {', '.join(sets)}")
        figures.update(run_sets(sets, repetitions))
    return {name: figures[name] for name in SIZES + kitti if name in figures}


def table(figures):
    sets = list(figures)
    rows = [["ratio to MODE_SGBM (ms/megapixel)"] + sets + ["target"]]
    for stage in figures[sets[0]]:
        row = [stage]
        for name in sets:
            entry = figures[name][stage]
            row.append(f"{entry['ratio']:.4f} ({entry['ms_per_megapixel']:.3g})")
        rows.append(row + [at_most(TARGETS[stage]) if stage in TARGETS else ""])
    both = [(figures[name][SEGMENTATION]["ms"] + figures[name][REFINEMENT]["ms"]) / figures[name][BLOCK_MATCHING]["ms"]
            for name in sets]
    rows.append(["segmentation + plane refinement, in cv::StereoBM"] + [f"{ratio:.2f}" for ratio in both] +
                [at_most(BOTH_IN_BLOCK_MATCHING)])
    for name, (parts, target) in FRAMES.items():
        ratios = [sum(figures[set_name][part]["ratio"] for part in parts) for set_name in sets]
        rows.append([name] + [f"{ratio:.4f}" for ratio in ratios] + [at_most(target)])
    return rows
