#!/usr/bin/python3
"""What a person sees who opens rviz by rviz:=true, with either launch file.

Usage, after `source scripts/environment`: test/rviz_test.py [PICTURE]
  PICTURE   where the first screenshot that has everything goes

Starts a display of its own, plays the synthetic street by each launch file, and takes screenshots until one has
everything, or none has had it for five minutes.
"""
import contextlib
import os
import pathlib
import re
import signal
import socket
import subprocess
import sys
import tempfile
import time
import xmlrpc.client

ROOT = pathlib.Path(__file__).resolve().parent.parent
TOOLS = ROOT / "build/devel/lib/disparity_refinement"
SCREEN = 1600, 900
WINDOW_HEIGHT = 860
PATIENCE = 300.0  # [s]
ATTEMPTS = 3  # When rviz has died
RATE = 0.05  # Of the playback of 10 frames a second: the processor draws, too.
# rviz's colours of the name of a display that has an error or a warning.
ERROR, WARNING = (192, 32, 32), (192, 128, 0)
TOPICS = ["disparity_color", "disparity_refined_color", "segment_borders", "refused_segments", "confidence",
          "plane_markers", "points2"]


class Region:
    """A rectangle of the screen and its pixels."""

    def __init__(self, x, y, width, height, screen=b""):
        self.x, self.y, self.width, self.height = x, y, width, height
        rows = (screen[3 * (SCREEN[0] * row + x):3 * (SCREEN[0] * row + x + width)] for row in range(y, y + height))
        data = b"".join(rows)
        self.pixels = list(zip(data[0::3], data[1::3], data[2::3]))

    def share(self, condition):
        """Share of the pixels for which condition(red, green, blue) holds [%]."""
        return 100.0 * sum(condition(*pixel) for pixel in self.pixels) / max(1, len(self.pixels))


def is_black(r, g, b):
    return max(r, g, b) < 8


def is_dark(r, g, b):
    return max(r, g, b) < 60


def is_bright(r, g, b):
    return min(r, g, b) > 220


def is_gray(r, g, b):
    return max(r, g, b) - min(r, g, b) < 8


def is_red(r, g, b):
    return r > 2 * max(g, b) and r > 90


def is_green(r, g, b):
    return g > 1.5 * max(r, b) and g > 90


def is_blue(r, g, b):
    return b > 1.3 * max(r, g) and b > 90


def is_yellow(r, g, b):
    return min(r, g) > 1.8 * b and min(r, g) > 120


def is_orange(r, g, b):
    return r > g + 40 and g > b + 40


def is_tinted(r, g, b):
    return max(r, g, b) - min(r, g, b) > 60


def is_background(r, g, b):
    return (r, g, b) == (70, 80, 95)


def run(*command):
    return subprocess.run([str(part) for part in command], check=True, stdout=subprocess.PIPE).stdout


def end(process):
    """Ends roslaunch, which ends its nodes: by SIGKILL those that do not end otherwise, which takes it a while."""
    process.send_signal(signal.SIGINT)
    try:
        process.wait(timeout=90)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


@contextlib.contextmanager
def started(command, log):
    with open(log, "w") as text:
        process = subprocess.Popen([str(part) for part in command], stdout=text, stderr=subprocess.STDOUT,
                                   start_new_session=True)
    try:
        yield process
    finally:
        end(process)


@contextlib.contextmanager
def display():
    """An X server with a free display number, of which programs draw by the processor."""
    ours, theirs = os.pipe()
    command = ["Xvfb", "-displayfd", str(theirs), "-screen", "0", "%dx%dx24" % SCREEN, "-nolisten", "tcp", "-noreset"]
    process = subprocess.Popen(command, pass_fds=[theirs], stderr=subprocess.DEVNULL)
    os.close(theirs)
    try:
        with os.fdopen(ours) as number:
            os.environ.update(DISPLAY=":" + number.readline().strip(), LIBGL_ALWAYS_SOFTWARE="1")
        yield
    finally:
        process.terminate()
        process.wait()


def free_port():
    with socket.socket() as listener:
        listener.bind(("", 0))
        return listener.getsockname()[1]


def screenshot(file):
    """The screen as bytes in the order red, green, blue."""
    run("import", "-window", "root", "-depth", 8, file)
    data = file.read_bytes()
    size = 3 * SCREEN[0] * SCREEN[1]
    assert data.startswith(b"P6") and len(data) > size
    return data[-size:]


def keep(screen, picture):
    run("convert", screen, "-crop", f"{SCREEN[0]}x{WINDOW_HEIGHT}+0+0", "+repage", "-quality", 90, picture)


def find_regions(screen):
    """The pictures and the 3-D view by name, where the layout has them; none before rviz has opened all."""
    tree = run("xwininfo", "-root", "-tree").decode()
    if " - RViz\"" not in tree:
        return {}
    # What rviz renders into has no name.
    windows = [tuple(map(int, found)) for found in
               re.findall(r"\(has no name\): \(\)\s+(\d+)x(\d+)\+-?\d+\+-?\d+\s+\+(\d+)\+(\d+)$", tree, re.MULTILINE)]
    windows = [(x, y, width, height) for width, height, x, y in windows if width > 1]
    if len(windows) != 6:
        return {}
    # Two above; below them, from left to right, a column of two, the view and the confidence.
    windows.sort(key=lambda window: window[1])
    above, below = sorted(windows[:2]), sorted(windows[2:])
    column = sorted(below[:2], key=lambda window: window[1])
    found = dict(zip(["raw", "refined", "segments", "refused", "view", "confidence"], above + column + below[2:]))
    x, y, width, height = found["confidence"]
    found["displays"] = x, y + height, width, WINDOW_HEIGHT - y - height
    return {name: Region(*window, screen=screen) for name, window in found.items()}


def layout_faults(regions):
    """The pictures in their places, and large enough."""
    def at(name):
        return regions[name].x, regions[name].y, regions[name].width, regions[name].height

    raw, refined, segments, refused = at("raw"), at("refined"), at("segments"), at("refused")
    view, confidence = at("view"), at("confidence")
    if raw[1] != refined[1] or abs(raw[2] - refined[2]) > 5 or raw[0] + raw[2] > refined[0]:
        yield f"raw and refined disparity are not side by side: {raw}, {refined}"
    if raw[2] < 750 or raw[3] < 280:
        yield f"the disparity maps are small: {raw}"
    if segments[0] != refused[0] or segments[1] + segments[3] > refused[1] or segments[0] + segments[2] > view[0]:
        yield f"segments and refused planes are not above each other: {segments}, {refused}"
    if view[0] + view[2] > confidence[0] or view[2] < 500 or view[3] < 350:
        yield f"the 3-D view is small: {view}"
    for name, (_, _, width, height) in (("segments", segments), ("refused", refused), ("confidence", confidence)):
        if width < 300 or height < 100:
            yield f"{name} is small: {width}x{height}"
    for name in regions:
        x, y, width, height = at(name)
        # A pixel of what rviz renders into may be hidden by the window's edge.
        if x + width > SCREEN[0] + 1 or y + height > WINDOW_HEIGHT:
            yield f"{name} is cut off: {at(name)}"


def picture_faults(regions, mode):
    """What is to be seen and is not."""
    def share(name, condition):
        return regions[name].share(condition)

    def faults(name, condition, least, most=100.0):
        value = share(name, condition)
        if not least <= value <= most:
            yield f"{name}: {value:.2f} % {condition.__name__}, expected {least} to {most}"

    for name in ("raw", "refined"):
        for condition in (is_red, is_green, is_blue):
            yield from faults(name, condition, 1.0)
    yield from faults("raw", is_black, 3.0, 50.0)
    # Holes of the raw map that the refined one has not.
    yield from faults("refined", is_black, 0.0, (0.2 if mode == "quality" else 0.8) * share("raw", is_black))
    yield from faults("segments", is_yellow, 1.0, 40.0)
    yield from faults("segments", is_gray, 40.0)
    yield from faults("refused", is_gray, 40.0)
    yield from faults("refused", is_tinted, 0.1, 50.0)
    if mode == "paper":
        yield from faults("refused", is_orange, 0.1, 50.0)
    yield from faults("confidence", is_gray, 100.0)
    yield from faults("confidence", is_bright, 20.0, 98.0)
    yield from faults("confidence", is_dark, 1.0, 60.0)
    yield from faults("view", is_background, 2.0, 80.0)
    yield from faults("view", is_gray, 10.0)
    yield from faults("view", is_green, 0.3)
    yield from faults("view", is_red, 0.1)
    for colour, kind in ((ERROR, "an error"), (WARNING, "a warning")):
        # Icons may have a pixel of it.
        if regions["displays"].pixels.count(colour) > 20:
            yield f"a display has {kind}"


def topic_faults(master, namespace):
    """Topics that rviz does not listen to, or that nobody publishes."""
    published, subscribed, _ = master.getSystemState("/rviz_test")[2]
    published, subscribed = dict(published), dict(subscribed)
    for topic in (f"{namespace}/{name}" for name in TOPICS):
        if f"{namespace}/rviz" not in subscribed.get(topic, []):
            yield f"rviz does not subscribe to {topic}"
        if not published.get(topic):
            yield f"nobody publishes {topic}"


def log_faults(folder):
    """Lines of error in what rviz and the nodelets have printed. rviz prints it when it ends."""
    rviz_logs = list(folder.glob("**/*rviz-*.log"))
    if not rviz_logs:
        yield f"no log of rviz in {folder}"
    for log in rviz_logs + [folder / "roslaunch.log"]:
        for line in log.read_text(errors="replace").splitlines():
            if re.search(r"\[ ?(ERROR|FATAL)\]|terminate called|Segmentation fault|process has died", line):
                yield f"{log.name}: {line}"


def look(name, command, player, namespace, mode, folder):
    """The first screenshot that has everything, or the last one, and what is not as it should be."""
    folder.mkdir()
    screen = folder / "screen.ppm"
    port = free_port()
    os.environ.update(ROS_MASTER_URI=f"http://localhost:{port}", ROS_LOG_DIR=str(folder / "ros"))
    master = xmlrpc.client.ServerProxy(os.environ["ROS_MASTER_URI"])
    faults = ["no rviz with five pictures and a 3-D view"]
    with contextlib.ExitStack() as stack:
        launch = ["roslaunch", "-p", port, "disparity_refinement", name]
        stack.enter_context(started(launch + command, folder / "roslaunch.log"))
        if player:
            stack.enter_context(started(player, folder / "rosbag.log"))
        deadline = time.monotonic() + PATIENCE
        while faults and time.monotonic() < deadline:
            time.sleep(2.0)
            if re.search("rviz-.*process has died", (folder / "roslaunch.log").read_text(errors="replace")):
                break
            regions = find_regions(screenshot(screen))
            if regions:
                faults = list(layout_faults(regions)) + list(picture_faults(regions, mode)) + \
                    list(topic_faults(master, namespace))
    return screen, faults + list(log_faults(folder))


def check(name, command, player, namespace, mode, folder):
    """The screenshot; ends the program if something is wrong with it."""
    for attempt in range(ATTEMPTS):
        screen, faults = look(name, command, player, namespace, mode, folder.with_name(f"{folder.name}{attempt}"))
        # Seldom, rviz dies in OpenGL before it opens a window: another one starts.
        if not any(re.search("rviz-.*process has died", fault) for fault in faults):
            break
    if faults:
        kept = ROOT / "build/rviz_test.png"
        keep(screen, kept)
        sys.exit(f"{name} rviz:=true: the last screenshot is {kept}\n  " + "\n  ".join(faults))
    print(f"{name} rviz:=true: everything is seen")
    return screen


def main():
    if len(sys.argv) > 2:
        sys.exit(__doc__)
    with tempfile.TemporaryDirectory() as name, display():
        folder = pathlib.Path(name)
        os.environ["XDG_RUNTIME_DIR"] = name
        bag = folder / "street.bag"
        run(TOOLS / "render_street", bag)
        common = ["rviz:=true", "disparity_range:=64", "color_max_disparity:=40"]
        screen = check("kitti.launch", [f"bag:={bag}", f"rate:={RATE}", "loop:=true"] + common, None, "/stereo",
                       "quality", folder / "bag")
        if len(sys.argv) == 2:
            keep(screen, sys.argv[1])
        namespace = "/robot/camera"
        renamed = [f"/stereo/{side}/{topic}:={namespace}/{side}/{topic}" for side in ("left", "right")
                   for topic in ("image_rect", "camera_info")]
        check("stereo_refinement.launch", [f"namespace:={namespace}", "mode:=paper"] + common,
              ["rosbag", "play", "--loop", "--quiet", "-r", RATE, bag] + renamed, namespace, "paper", folder / "rig")


if __name__ == "__main__":
    # As an exception: what was started is ended.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))
    main()
