"""What the Python files of scripts/benchmark share."""
import pathlib
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
BIN = ROOT / "build/devel/lib/disparity_refinement"
CACHE = ROOT / "build/benchmark"


def run(command, **options):
    """Runs a command that must succeed and returns what it printed."""
    process = subprocess.run([str(part) for part in command], stdout=subprocess.PIPE, universal_newlines=True, **options)
    if process.returncode != 0:
        sys.exit(f"benchmark: {command[0]} failed with exit code {process.returncode}\n{process.stderr or ''}")
    return process.stdout


def progress(text):
    print(text, file=sys.stderr, flush=True)


def at_most(bound):
    return f"≤ {bound:g}"


def at_least(bound):
    return f"≥ {bound:g}"


def text_table(rows):
    """The first row is the header, the first column is aligned to the left."""
    widths = [max(map(len, column)) for column in zip(*rows)]
    lines = []
    for row in rows:
        cells = [row[0].ljust(widths[0])] + [cell.rjust(width) for cell, width in zip(row[1:], widths[1:])]
        lines.append("  ".join(cells).rstrip())
    return "\n".join(lines)


def markdown_table(rows):
    lines = ["| " + " | ".join(row) + " |" for row in rows]
    return "\n".join([lines[0], "|---" * len(rows[0]) + "|"] + lines[1:])
