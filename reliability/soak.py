"""A bag in a loop through the chain while parameters change twenty times a second; started by scripts/soak."""
import argparse
import json
import os
import pathlib
import random
import shutil
import signal
import statistics
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "benchmark"))
import live_chain  # noqa: E402
from common import progress, text_table  # noqa: E402

CHANGES = 20.0  # A second
WARM_UP = 60.0  # The memory at the end is compared with that after this time [s]
PARTS = 5  # After each the memory is measured
SETTLING = 20.0  # Before the memory is measured, with the parameters of the start [s]
GROWTH = 0.05
NODELETS = ("disparity", "segmentation", "plane_refinement")


def odd(least, largest):
    return 2 * random.randint(least // 2, (largest - 1) // 2) + 1


def disparity():
    """Some parameters of the matcher that go together."""
    P1 = random.randint(1, 60)
    return random.choice([
        {"stereo_algorithm": random.randint(0, 2)},
        {"sgbm_mode": random.randint(0, 3), "fullDP": random.random() < 0.1},
        {"min_disparity": random.randint(-8, 8), "disparity_range": 16 * random.randint(2, 10)},
        {"correlation_window_size": odd(5, 11), "prefilter_cap": random.randint(1, 63)},
        {"P1": P1, "P2": P1 + random.randint(1, 150)},
        {"P1": 0, "P2": 0},
        {"uniqueness_ratio": random.randint(0, 30), "texture_threshold": random.randint(0, 30)},
        {"disp12MaxDiff": random.randint(-1, 4)},
        {"speckle_size": random.randint(0, 400), "speckle_range": random.randint(0, 8)},
        {"full_width": random.random() < 0.5, "aggregate_rows": random.random() < 0.5},
    ])


def segmentation():
    return random.choice([
        {"lambda": random.randint(0, 200)},
        {"h": random.randint(0, 40)},
        {"lambda": random.randint(0, 200), "h": random.randint(0, 40)},
        {"connectivity": random.choice([4, 8]), "structuring_element": random.randint(0, 1)},
        {"shadow_enhancement": random.random() < 0.5, "shadow_threshold": random.randint(0, 255),
         "shadow_gamma": random.uniform(0.05, 1.0)},
    ])


def plane_refinement():
    return random.choice([
        {"refinement_mode": random.randint(0, 1)},
        {"further_segmentations": random.randint(0, 2)},
        {"inlier_threshold": random.uniform(0.1, 4.0), "confidence": random.uniform(0.5, 0.999)},
        {"min_valid_fraction": random.uniform(0.0, 0.6), "min_valid_points": random.randint(3, 40)},
        {"max_iterations": random.randint(1, 200)},
        {"disparity_error": random.uniform(0.0, 0.5), "max_depth_error": random.uniform(0.5, 10.0)},
        {"max_divergence": random.uniform(0.0, 8.0), "divergence_action": random.randint(0, 2),
         "out_of_range_action": random.randint(0, 1)},
    ])


# What takes most memory, among it buffers of all pixels that have a disparity.
LARGEST = {
    "disparity": {"sgbm_mode": 1, "min_disparity": -8, "disparity_range": 160, "correlation_window_size": 11, "full_width": True,
                  "aggregate_rows": True, "uniqueness_ratio": 0, "texture_threshold": 0, "disp12MaxDiff": -1,
                  "speckle_size": 1, "speckle_range": 0},
    "segmentation": {"lambda": 0, "h": 0, "connectivity": 4, "structuring_element": 0,
                     "shadow_enhancement": True, "shadow_threshold": 50, "shadow_gamma": 0.05},
    "plane_refinement": {"refinement_mode": 1, "further_segmentations": 2, "min_valid_fraction": 0.0, "min_valid_points": 3},
}


class Chain:
    """The running chain, seen from outside."""

    def __init__(self):
        import rosgraph
        import rosnode
        import rospy
        from diagnostic_msgs.msg import DiagnosticArray
        from dynamic_reconfigure.msg import Config
        from dynamic_reconfigure.srv import Reconfigure
        rospy.init_node("soak", disable_signals=True, anonymous=True)
        self._rosnode = rosnode
        self._status = {}
        self._calls = {}
        for nodelet in NODELETS:
            service = f"/stereo/{nodelet}/set_parameters"
            rospy.wait_for_service(service, timeout=60)
            self._calls[nodelet] = rospy.ServiceProxy(service, Reconfigure, persistent=True)
        # What it answers is all that is set.
        self._start = {nodelet: call(Config()).config for nodelet, call in self._calls.items()}
        self._listener = rospy.Subscriber("/diagnostics", DiagnosticArray, self._keep)
        self._uri = rosnode.get_api_uri(rosgraph.Master("soak"), "/stereo/refinement_manager")

    def _keep(self, array):
        for status in array.status:
            for nodelet in NODELETS:
                if status.name.startswith(f"stereo/{nodelet}:") or f"/stereo/{nodelet}:" in status.name:
                    self._status[nodelet] = {value.key: value.value for value in status.values}

    def status(self):
        return dict(self._status)

    def manager(self):
        """Its process id."""
        import xmlrpc.client
        _, _, pid = xmlrpc.client.ServerProxy(self._uri).getPid("soak")
        return pid

    def change(self, nodelet, values):
        from dynamic_reconfigure.msg import BoolParameter, Config, DoubleParameter, IntParameter
        message = Config()
        for name, value in values.items():
            if isinstance(value, bool):
                message.bools.append(BoolParameter(name, value))
            elif isinstance(value, int):
                message.ints.append(IntParameter(name, value))
            else:
                message.doubles.append(DoubleParameter(name, value))
        self._calls[nodelet](message)

    def reset(self):
        """The parameters of the start, in all nodelets."""
        for nodelet, config in self._start.items():
            self._calls[nodelet](config)

    def stop_player(self):
        self._rosnode.kill_nodes(["/play"])

    def stop_check(self):
        self._rosnode.kill_nodes(["/stereo/soak_check"])


def resident_megabytes(pid):
    for line in pathlib.Path(f"/proc/{pid}/status").read_text().splitlines():
        if line.startswith("VmRSS:"):
            return int(line.split()[1]) / 1024.0
    raise SystemExit(f"soak: process {pid} has no resident memory")


def soak(seconds, rate, folder, port):
    """Figures of the whole run; everything runs already but may not have connected yet."""
    os.environ["ROS_MASTER_URI"] = f"http://localhost:{port}"
    chain = Chain()
    pid = chain.manager()
    memory, changes = [], 0

    def settled_memory():
        """That depends on the parameters, which are always the same here, and a little on the frames under way."""
        chain.reset()
        samples = []
        for _ in range(int(SETTLING)):
            time.sleep(1.0)
            samples.append(resident_megabytes(pid))
        return statistics.median(samples[len(samples) // 2:])

    def fill_buffers(some_seconds):
        for algorithm in range(3):
            for nodelet, values in LARGEST.items():
                chain.change(nodelet, dict(values, stereo_algorithm=algorithm) if nodelet == "disparity" else values)
            time.sleep(some_seconds / 3.0)

    def change_for(some_seconds):
        nonlocal changes
        begin, before = time.time(), changes
        while time.time() - begin < some_seconds:
            nodelet = random.choice(NODELETS)
            chain.change(nodelet, globals()[nodelet]())
            changes += 1
            if len(memory) <= changes / CHANGES:
                memory.append(resident_megabytes(pid))
                if len(memory) % 300 == 0:
                    frames = chain.status()["plane_refinement"]["frames published"]
                    progress(f"{len(memory)} s: {memory[-1]:.0f} MB, {frames} frames")
            time.sleep(max(0.0, begin + (changes - before) / CHANGES - time.time()))

    settled = []
    if seconds <= 2.0 * WARM_UP:
        change_for(seconds)
    else:
        fill_buffers(0.5 * WARM_UP)
        change_for(0.5 * WARM_UP)
        settled.append(settled_memory())
        for part in range(PARTS):
            change_for((seconds - WARM_UP) / PARTS)
            settled.append(settled_memory())
            progress(f"part {part + 1} of {PARTS}: {settled[-1]:.0f} MB with the parameters of the start, "
                     f"{settled[0]:.0f} MB at first")
    chain.stop_player()
    time.sleep(15.0)  # What is under way arrives, and is reported.
    status = chain.status()
    if chain.manager() != pid:
        raise SystemExit("soak: the manager has been started anew")
    chain.stop_check()
    output = folder / "check.json"
    for _ in range(100):
        if output.exists() and output.stat().st_size > 0:
            break
        time.sleep(0.2)
    return {"seconds": seconds, "changes": changes, "memory": memory, "settled_memory": settled, "status": status,
            "check": json.loads(output.read_text())}


def judge(figures):
    """(text, whether it holds) of everything that is asked for."""
    status, check = figures["status"], figures["check"]
    count = {nodelet: {key: int(value) for key, value in status[nodelet].items()
                       if key.startswith("frames") or key in ("pairs", "errors")} for nodelet in NODELETS}
    for nodelet in NODELETS:
        frames = count[nodelet]
        reasons = {key.split(", ")[1]: value for key, value in frames.items()
                   if key.startswith("frames dropped, ") and value > 0}
        text = f"{nodelet}: {frames['frames received']} received, {frames['frames published']} published"
        text += "".join(f", {value} dropped: {reason}" for reason, value in reasons.items())
        yield text, (frames["frames received"] == frames["frames published"] + frames["frames dropped"]
                     and frames["errors"] == 0 and frames["frames published"] > 0)
    messages = check["messages"]
    images = [int(value) for key, value in status["disparity"].items() if key.startswith("messages on")]
    sent = [messages[f"{side}/{name}"] for side in ("left", "right") for name in ("image_rect", "camera_info")]
    pairs = count["disparity"]["pairs"]
    yield f"{max(sent)} pairs played, {pairs} paired", pairs == max(sent) == min(images)
    published = count["plane_refinement"]
    yield (f"{count['disparity']['frames published']} disparity maps published, {published['frames received']} received "
           "by plane_refinement", count["disparity"]["frames published"] == published["frames received"])
    differences = sum(check["differences"].values())
    yield (f"{check['checked']} frames computed again by the core with the parameters of their planes message, "
           f"{differences} not the same bits, {check['without_parameters']} without parameters",
           check["checked"] > 0 and differences == 0 and check["without_parameters"] == 0)
    if figures["settled_memory"]:
        start, end = figures["settled_memory"][0], figures["settled_memory"][-1]
        yield (f"resident memory with the parameters of the start: {start:.0f} MB after a minute, {end:.0f} MB at the end "
               f"({100.0 * (end / start - 1.0):+.1f} %); with any: at most {max(figures['memory']):.0f} MB",
               end <= (1.0 + GROWTH) * start)


def main():
    parser = argparse.ArgumentParser(prog="scripts/soak", description="Plays a bag in a loop through the chain while "
                                     "parameters change at random, and checks what comes out. docs/reliability.md.")
    parser.add_argument("minutes", type=float, nargs="?", default=60.0)
    parser.add_argument("--rate", type=float, default=5.0, help="frames a second")
    parser.add_argument("--seed", type=int, default=0, help="of the changes")
    parser.add_argument("--json", metavar="FILE", help="write every figure")
    options = parser.parse_args()
    random.seed(options.seed)

    bag, name = live_chain.make_bag()
    folder = pathlib.Path(tempfile.mkdtemp())
    port = live_chain.free_port()
    log = folder / "roslaunch.log"
    progress(f"Playing {name}, {options.rate:g} frames/s, for {options.minutes:g} minutes")
    command = ["roslaunch", "-p", str(port), str(ROOT / "reliability/soak.launch"), f"bag:={bag}",
               f"rate:={options.rate / live_chain.BAG_RATE}", f"output:={folder / 'check.json'}"]
    with open(log, "w") as text:
        process = subprocess.Popen(command, stdout=text, stderr=subprocess.STDOUT, start_new_session=True,
                                   env=dict(os.environ, ROS_MASTER_URI=f"http://localhost:{port}"))
        try:
            time.sleep(3.0)
            figures = soak(60.0 * options.minutes, options.rate, folder, port)
        except BaseException:
            progress(log.read_text()[-3000:])
            raise
        finally:
            live_chain.end(process)
    if options.json:
        pathlib.Path(options.json).write_text(json.dumps(figures, indent=1) + "\n")
    rows = [["", "holds"]]
    results = list(judge(figures))
    rows.append([f"{figures['changes']} changes of parameters in {figures['seconds']:.0f} s", ""])
    rows += [[text, "yes" if holds else "NO"] for text, holds in results]
    print(text_table(rows))
    if not all(holds for _, holds in results):
        progress(f"soak: the log is {log}")
        sys.exit(1)
    shutil.rmtree(folder)


# As an exception: what was started is ended.
signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))
main()
