"""Three times the frames that the chain can do; started by scripts/overload."""
import argparse
import json
import pathlib
import shutil
import signal
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "benchmark"))
import live_chain  # noqa: E402
from common import progress, text_table  # noqa: E402

EXCESS = 3.0
RATE_TARGET = 0.9  # Of the sustainable rate
AGE_TARGET = 2.0  # Times that of frames which come alone: median of median, largest of largest
CALM_FRAMES = 100
GROWTH = 0.05  # Of the memory
SETTLED = 10.0  # The memory is compared with that after this time [s]


def refined(recording):
    """The frames that came out, in order."""
    return sorted((frame for frame in recording["frames"] if "refined" in frame), key=lambda frame: frame["refined"])


def ages(frames):
    return [frame["refined"] - max(frame["left"], frame["right"]) for frame in frames if "left" in frame and "right" in frame]


def measure(seconds, mode):
    bag, name = live_chain.make_bag()
    folder = pathlib.Path(tempfile.mkdtemp())

    def play(input_rate, frames):
        progress(f"{name}, mode {mode}: {frames} frames at {input_rate:.1f} frames/s")
        return live_chain.launch("refinement", bag, input_rate, frames, folder, mode=mode)

    def rate(recording):
        return live_chain.evaluate("refinement", 0.0, [recording])["rate"]

    try:
        input_rate = 10.0
        while (sustainable := rate(play(input_rate, 60))) > 0.7 * input_rate and input_rate < 240.0:
            input_rate *= 2.0
        # What it does when a little more comes is what it can do.
        sustainable = rate(play(1.25 * sustainable, 120))
        calm = ages(refined(play(0.5 * sustainable, CALM_FRAMES)))[live_chain.WARM_UP:]
        input_rate = EXCESS * sustainable
        recording = play(input_rate, round(input_rate * seconds))
    finally:
        shutil.rmtree(folder)
    frames = refined(recording)
    return {
        "bag": name, "mode": mode, "sustainable_rate": sustainable, "input_rate": input_rate, "rate": rate(recording),
        "calm_ages": calm, "ages": ages(frames),
        "received": sum("left" in frame for frame in recording["frames"]), "refined": len(frames),
        "memory": [(frame["refined"] - frames[0]["refined"], frame["resident_kilobytes"] / 1024.0) for frame in frames],
    }


def judge(figures):
    """(text, whether it holds)"""
    relative = figures["rate"] / figures["sustainable_rate"]
    yield (f"{figures['received']} frames came at {figures['input_rate']:.1f}/s, {figures['refined']} were refined at "
           f"{figures['rate']:.2f}/s: {relative:.2f} of the sustainable {figures['sustainable_rate']:.2f}/s",
           relative >= RATE_TARGET)
    shares = (0.5, 0.99, 1.0)
    calm, loaded = ([live_chain.percentile(figures[name], share) for share in shares] for name in ("calm_ages", "ages"))
    ratios = [after / before for before, after in zip(calm, loaded)]

    def listed(values, digits):
        return " / ".join(f"{value:.{digits}f}" for value in values)

    yield (f"age, median / 99 % / largest: {listed([1e3 * age for age in loaded], 0)} ms; of frames that come alone: "
           f"{listed([1e3 * age for age in calm], 0)} ms; ratio: {listed(ratios, 2)}",
           max(ratios[0], ratios[2]) <= AGE_TARGET)
    memory = figures["memory"]
    if memory[-1][0] > 2.0 * SETTLED:
        settled = max(megabytes for seconds, megabytes in memory if seconds < SETTLED)
        last = max(megabytes for seconds, megabytes in memory if seconds > memory[-1][0] - SETTLED)
        yield (f"resident memory: at most {settled:.0f} MB in the first {SETTLED:g} s, {last:.0f} MB in the last",
               last <= (1.0 + GROWTH) * settled)


def main():
    parser = argparse.ArgumentParser(prog="scripts/overload", description="Sends three times the frames that the chain can "
                                     "do. docs/reliability.md explains the figures.")
    parser.add_argument("seconds", type=float, nargs="?", default=120.0)
    parser.add_argument("--mode", default="quality", help="as in stereo_refinement.launch")
    parser.add_argument("--json", metavar="FILE", help="write every figure")
    options = parser.parse_args()
    figures = measure(options.seconds, options.mode)
    if options.json:
        pathlib.Path(options.json).write_text(json.dumps(figures) + "\n")
    results = list(judge(figures))
    print(text_table([[f"{figures['bag']}, mode {figures['mode']}", "holds"]] +
                     [[text, "yes" if holds else "NO"] for text, holds in results]))
    sys.exit(0 if all(holds for _, holds in results) else 1)


# As an exception: what was started is ended.
signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))
main()
