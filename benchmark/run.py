"""Measures the stages, the live chain, instructions and memory; started by scripts/benchmark."""
import argparse
import json
import os
import pathlib
import signal
import sys

import instructions
import live_chain
import stages
from common import markdown_table, text_table

MARKER = "<!-- scripts/benchmark --markdown writes what follows. -->"


def machine():
    def first(file, key, separator):
        try:
            lines = pathlib.Path(file).read_text().splitlines()
        except OSError:
            return "unknown"
        values = [line.split(separator, 1)[1].strip(' "') for line in lines if line.startswith(key)]
        return values[0] if values else "unknown"

    return dict(stages.versions(), processor=first("/proc/cpuinfo", "model name", ":"), cores=os.cpu_count(),
                system=first("/etc/os-release", "PRETTY_NAME", "="), load_at_start=os.getloadavg()[0])


def sections(figures):
    """(title, text before the table, rows) of everything that was measured."""
    found = figures["machine"]
    about = (f"{found['processor']}, {found['cores']} cores; {found['system']}; {found['compiler']}, OpenCV "
             f"{found['opencv']}; load at the start {found['load_at_start']:.1f}.")
    if "stages" in figures:
        text = about + ("\nBest of several repetitions; one thread: processor time, two threads: wall time. All matchers "
                        "search 128 disparities.")
        if not found["ximgproc"]:
            text += "\nWithout the WLS filter: OpenCV's ximgproc is not installed."
        yield "Stages", text, stages.table(figures["stages"])
    if "live_chain" in figures:
        slow = figures["live_chain"]["slow"]["disparity"]["input_rate"]
        text = (f"Age: from the arrival of the later image to the publication, at {slow:.1f} frames/s, with the processors "
                "in use then.\nStock has no 3WAY mode.")
        yield "Live chain", text, live_chain.table(figures["live_chain"])
    if "instructions" in figures:
        text = "The second frame of a process, by valgrind: the same in every run."
        yield "Instructions and memory", text, instructions.table(figures["instructions"])


def write_markdown(file, parts):
    tables = "\n\n".join(f"## {title}\n\n{text}\n\n{markdown_table(rows)}" for title, text, rows in parts)
    before, marker, _ = file.read_text().partition(MARKER)
    file.write_text((before + marker + "\n\n" if marker else "") + tables + "\n")


def main():
    parser = argparse.ArgumentParser(prog="scripts/benchmark", description="Measures how fast the package is, in ratios "
                                     "to OpenCV's matchers in the same run. docs/performance.md explains the tables.")
    parser.add_argument("--short", action="store_true", help="less of everything, in about a minute")
    parser.add_argument("--json", metavar="FILE", help="write every figure")
    parser.add_argument("--markdown", metavar="FILE", help="write the tables; in a file that has the line "
                        f"{MARKER}, as docs/performance.md does, they replace what follows it")
    parser.add_argument("--instructions", action="store_true",
                        help="only instructions and memory; exit code 1 above a bound of "
                        "benchmark/instruction_bounds.txt")
    parser.add_argument("--set-bounds", action="store_true", help="the same, and set the bounds by what was counted")
    options = parser.parse_args()
    # A file that cannot be written is told before minutes of measuring.
    for file in filter(None, (options.json, options.markdown)):
        pathlib.Path(file).touch()

    figures = {"short": options.short, "machine": machine()}
    if not options.instructions and not options.set_bounds:
        figures["stages"] = stages.measure(options.short)
        figures["live_chain"] = live_chain.measure(options.short)
    if not options.short:
        figures["instructions"] = instructions.measure()
    if options.set_bounds:
        instructions.write_bounds(figures["instructions"])

    parts = list(sections(figures))
    print("\n\n".join(f"{title}\n{text}\n\n{text_table(rows)}" for title, text, rows in parts))
    if options.markdown:
        write_markdown(pathlib.Path(options.markdown), parts)
    if options.json:
        pathlib.Path(options.json).write_text(json.dumps(figures, indent=1) + "\n")
    failures = instructions.failures(figures["instructions"]) if options.instructions else []
    for failure in failures:
        print(f"benchmark: {failure}", file=sys.stderr)
    sys.exit(1 if failures else 0)


# As an exception: what was started is ended.
signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))
try:
    main()
except KeyboardInterrupt:
    sys.exit(130)
