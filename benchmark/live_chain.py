"""Age and rate of the disparity maps in a running nodelet manager, by live_chain.launch and rosbag play."""
import json
import os
import pathlib
import shutil
import signal
import socket
import subprocess
import tempfile

from common import BIN, CACHE, ROOT, at_least, at_most, progress, run

RUNS = {
    "disparity": "disparity alone, 3WAY",
    "refinement": "whole chain, 3WAY",
    "pictures": "the same with pictures and point cloud, unseen",
    "stock": "stock stereo_image_proc/disparity, MODE_SGBM",
}
AGE_TARGET = 1.15
UNSEEN_TARGET = 1.03  # Of the processor time
RATE_TARGET = 0.95
BAG_RATE = 10.0  # Frames per second of the bag that is played
BAG_FRAMES = 120
ROUNDS = 2
EXCESS = 1.25  # Of the input over what disparity alone sustains
STALL = 4.0  # Medians of an interval between frames that the machine has made, not the chain
WARM_UP = 3  # Frames before the first one that counts


def write_bag(source, target):
    """Frames of a bag there and back again, so that few of them make a long drive."""
    import rosbag
    import rospy
    topics = [f"/stereo/{side}/{name}" for side in ("left", "right") for name in ("image_rect", "camera_info")]
    frames = {}
    with rosbag.Bag(str(source)) as bag:
        for topic, message, _ in bag.read_messages(topics=topics):
            frames.setdefault(message.header.stamp, {})[topic] = message
    frames = [frame for _, frame in sorted(frames.items()) if len(frame) == len(topics)]
    if len(frames) < 2:
        raise SystemExit(f"benchmark: {source} has {len(frames)} frames with {', '.join(topics)}, expected at least 2")
    there_and_back = frames + frames[-2:0:-1]
    part = target.with_suffix(".part")
    with rosbag.Bag(str(part), "w") as bag:
        for i in range(BAG_FRAMES):
            stamp = rospy.Time.from_sec(1e9 + i / BAG_RATE)
            for topic, message in there_and_back[i % len(there_and_back)].items():
                message.header.stamp = stamp
                bag.write(topic, message, stamp)
    part.rename(target)


def make_bag():
    """The bag to play and where it comes from."""
    CACHE.mkdir(parents=True, exist_ok=True)
    sequence = os.environ.get("DISPARITY_REFINEMENT_KITTI_SEQUENCE")
    if not sequence:
        bag = CACHE / "street.bag"
        if not bag.exists():
            progress("Rendering the street")
            rendered = CACHE / "rendered.bag"
            run([BIN / "render_street", rendered, "--force", "--frames", 12, "--width", 1242, "--height", 375,
                 "--focal-length", 721, "--baseline", 0.54])
            write_bag(rendered, bag)
            rendered.unlink()
        return bag, "synthetic street, 1242x375"
    source = pathlib.Path(sequence)
    bag = CACHE / "sequence.bag"
    if source.is_dir():
        converted = CACHE / "converted.bag"
        run([BIN / "kitti_to_bag", source, converted, "--force"])
        source = converted
    write_bag(source, bag)
    return bag, f"sequence {pathlib.Path(sequence).name}"


def free_port():
    with socket.socket() as listener:
        listener.bind(("", 0))
        return listener.getsockname()[1]


def launch(nodelets, bag, input_rate, frames, folder, **more):
    """What probe_manager has written while that many frames of the bag were played, if need be again and again."""
    output = folder / "times.json"
    if output.exists():
        output.unlink()
    port = free_port()
    log = folder / f"{nodelets}.log"
    arguments = {"nodelets": nodelets, "bag": bag, "rate": input_rate / BAG_RATE, "output": output, **more}
    arguments.update({"duration": frames / BAG_RATE} if frames <= BAG_FRAMES else {"seconds": frames / input_rate})
    command = ["roslaunch", "-p", str(port), str(ROOT / "benchmark/live_chain.launch")]
    command += [f"{name}:={value}" for name, value in arguments.items()]
    with open(log, "w") as text:
        process = subprocess.Popen(command, stdout=text, stderr=subprocess.STDOUT, start_new_session=True,
                                   env=dict(os.environ, ROS_MASTER_URI=f"http://localhost:{port}"))
        try:
            process.wait(timeout=120 + 2 * frames / input_rate)
        except subprocess.TimeoutExpired:
            pass
        finally:
            end(process)
    if not output.exists():
        raise SystemExit(f"benchmark: no times of {nodelets}; what roslaunch printed:\n{log.read_text()[-3000:]}")
    return json.loads(output.read_text())


def end(process):
    """Ends roslaunch, which ends its nodes: by SIGKILL those that do not end otherwise, which takes it a while."""
    if process.poll() is None:
        process.send_signal(signal.SIGINT)
        try:
            process.wait(timeout=90)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def percentile(values, share):
    values = sorted(values)
    return values[min(len(values) - 1, int(share * len(values)))]


def evaluate(nodelets, input_rate, recordings):
    """Figures of all recordings of one kind of run."""
    name = "refined" if nodelets in ("refinement", "pictures") else "disparity"
    ages, intervals, seconds, processor_time = [], [], 0.0, 0.0
    for recording in recordings:
        done = sorted((frame for frame in recording["frames"] if name in frame), key=lambda frame: frame[name])[WARM_UP:]
        if len(done) < 2:
            raise SystemExit(f"benchmark: {len(done)} frames of {nodelets} after the first {WARM_UP}, expected at least 2")
        ages += [1e3 * (frame[name] - max(frame["left"], frame["right"])) for frame in done]
        intervals += [after[name] - before[name] for before, after in zip(done, done[1:])]
        seconds += done[-1][name] - done[0][name]
        processor_time += done[-1]["processor_time"] - done[0]["processor_time"]
    # Where machines are shared, all of them may stand still for a second. A dropped frame makes two intervals one.
    moving = [interval for interval in intervals if interval < STALL * percentile(intervals, 0.5)]
    return {
        "input_rate": input_rate,
        "ages_ms": ages,
        "age_ms_median": percentile(ages, 0.5),
        "age_ms_95": percentile(ages, 0.95),
        "rate": len(moving) / sum(moving),
        "processors": processor_time / seconds,
        "peak_megabytes": max(recording["peak_kilobytes"] for recording in recordings) / 1024.0,
    }


def measure(short):
    bag, name = make_bag()
    folder = pathlib.Path(tempfile.mkdtemp())

    def sustained(input_rate):
        """Rate of the disparity alone."""
        return evaluate("disparity", input_rate, [launch("disparity", bag, input_rate, 45, folder)])["rate"]

    def play(input_rate, frames):
        """Figures by kind of run. They take turns: what else the machine does hits all alike."""
        progress(f"Playing {name}, {input_rate:.1f} frames/s: {', '.join(RUNS.values())}")
        recordings = {nodelets: [] for nodelets in RUNS}
        for _ in range(1 if short else ROUNDS):
            for nodelets in RUNS:
                recordings[nodelets].append(launch(nodelets, bag, input_rate, frames, folder))
        return {nodelets: evaluate(nodelets, input_rate, recordings[nodelets]) for nodelets in RUNS}

    try:
        # A little more than disparity alone can do: the chain segments what comes in, so that a larger excess would
        # measure work for frames that are dropped.
        input_rate = 15.0
        while (alone := sustained(input_rate)) > 0.7 * input_rate and input_rate < 240.0:
            input_rate *= 2.0
        fast = play(EXCESS * alone, 45 if short else BAG_FRAMES)
        # One rate for all, so that their shares of the processors can be compared.
        input_rate = 0.5 * min(figures["rate"] for figures in fast.values())
        slow = play(input_rate, max(10, min(40, round((3 if short else 10) * input_rate))))
    finally:
        shutil.rmtree(folder)
    return {
        "bag": name,
        "slow": slow,
        "fast": fast,
        "age_ratio": slow["refinement"]["age_ms_median"] / slow["disparity"]["age_ms_median"],
        "age_ratio_95": slow["refinement"]["age_ms_95"] / slow["disparity"]["age_ms_95"],
        "rate_ratio": fast["refinement"]["rate"] / fast["disparity"]["rate"],
        "unseen_ratio": slow["pictures"]["processors"] / slow["refinement"]["processors"],
    }


def table(figures):
    rows = [[figures["bag"], "age, median [ms]", "95 % [ms]", "processors", "rate when flooded [1/s]", "peak memory [MB]"]]
    for nodelets, name in RUNS.items():
        slow, fast = figures["slow"][nodelets], figures["fast"][nodelets]
        rows.append([name, f"{slow['age_ms_median']:.1f}", f"{slow['age_ms_95']:.1f}", f"{slow['processors']:.2f}",
                     f"{fast['rate']:.2f}", f"{fast['peak_megabytes']:.0f}"])
    rows.append(["chain / disparity alone", f"{figures['age_ratio']:.2f}", f"{figures['age_ratio_95']:.2f}", "",
                 f"{figures['rate_ratio']:.2f}", ""])
    rows.append(["target", at_most(AGE_TARGET), "", "", at_least(RATE_TARGET), ""])
    rows.append(["pictures and point cloud, unseen / chain", "", "", f"{figures['unseen_ratio']:.3f}", "", ""])
    rows.append(["target", "", "", at_most(UNSEEN_TARGET), "", ""])
    return rows
