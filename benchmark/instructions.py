"""Instructions and memory of census matcher, segmentation and plane refinement, by valgrind and run_stage."""
import os
import re
import subprocess

from common import BIN, CACHE, ROOT, at_most, progress, run

BOUNDS = ROOT / "benchmark/instruction_bounds.txt"
SLACK = 1.15
STAGES = ["matching", "segmentation", "refinement"]
STREET = "1242x375"
SCRATCH_TARGET = 16.0


def count(stage, folder, runs):
    command = ["valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null", BIN / "run_stage", stage, folder, runs]
    process = subprocess.run([str(part) for part in command], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                             universal_newlines=True)
    found = re.search(r"Collected\s*:\s*(\d+)", process.stderr)
    if process.returncode != 0 or not found:
        raise SystemExit(f"benchmark: valgrind failed\n{process.stderr}")
    return int(found.group(1))


def measure():
    """{set: {stage: {instructions, bytes_per_pixel}}}"""
    figures = {}
    for name in [STREET] + (["KITTI"] if os.environ.get("DISPARITY_REFINEMENT_KITTI") else []):
        progress(f"Counting instructions: {name}")
        folder = CACHE / f"frame_{name}"
        folder.mkdir(parents=True, exist_ok=True)
        run([BIN / "run_stage", "prepare", name, folder])
        figures[name] = {}
        for stage in STAGES:
            # The second run: neither the start of the program nor the buffers of the first one.
            instructions = count(stage, folder, 2) - count(stage, folder, 1)
            figures[name][stage] = {"instructions": instructions,
                                    "bytes_per_pixel": float(run([BIN / "run_stage", stage, folder, 2]))}
    return figures


def read_bounds():
    lines = [line.split() for line in BOUNDS.read_text().splitlines() if line and not line.startswith("#")]
    return {stage: int(bound) for stage, bound in lines}


def write_bounds(figures):
    comments = [line for line in BOUNDS.read_text().splitlines() if line.startswith("#")]
    bounds = [f"{stage} {round(figures[STREET][stage]['instructions'] * SLACK)}" for stage in STAGES]
    BOUNDS.write_text("\n".join(comments + bounds) + "\n")


def failures(figures):
    bounds = read_bounds()
    return [f"{stage} takes {figures[STREET][stage]['instructions']} instructions, more than the bound "
            f"{bounds[stage]} of {BOUNDS.relative_to(ROOT)}"
            for stage in STAGES if figures[STREET][stage]["instructions"] > bounds[stage]]


def table(figures):
    bounds = read_bounds()
    rows = [["million instructions a frame"] + list(figures) + [f"bound, {STREET}"]]
    for stage in STAGES:
        rows.append([stage] + [f"{figures[name][stage]['instructions'] * 1e-6:.1f}" for name in figures] +
                    [at_most(round(bounds[stage] * 1e-6, 1))])
    rows.append(["scratch [bytes a pixel]"] + ["" for _ in figures] + ["target"])
    for stage, target in zip(STAGES, ("", at_most(SCRATCH_TARGET), "")):
        rows.append([stage] + [f"{figures[name][stage]['bytes_per_pixel']:.1f}" for name in figures] + [target])
    return rows
