#!/usr/bin/env python3
"""Installs build/ into a new prefix and uses the package from there, in an environment that knows only the prefix.

Needs a complete build: scripts/build.
"""

import os
import pathlib
import shutil
import signal
import socket
import subprocess
import tempfile
import time
import unittest

ROOT = pathlib.Path(__file__).resolve().parent.parent
BUILD = ROOT / "build"
NODELETS = ("disparity", "segmentation", "plane_refinement", "depth", "visualization")
TOOLS = ("bag_arguments", "check_bag", "evaluate", "influence_surface", "kitti_to_bag", "refine", "render_street")
# For a slow machine that does something else, too [s].
TIMEOUT = 600


def free_port():
    with socket.socket() as listener:
        listener.bind(("", 0))
        return listener.getsockname()[1]


class InstallSpace(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(tempfile.mkdtemp(prefix="install_test_"))
        cls.addClassCleanup(shutil.rmtree, cls.folder)
        cls.prefix = cls.folder / "prefix"
        cls.environment = {
            "HOME": str(cls.folder),
            "PATH": "/usr/bin:/bin",
            "ROS_HOSTNAME": "localhost",
            "ROS_MASTER_URI": "http://localhost:%d" % free_port(),
        }
        # Staged, so that a file with another destination than the prefix is found and does no harm.
        stage = cls.folder / "stage"
        subprocess.run(["cmake", "--install", str(BUILD), "--prefix", str(cls.prefix)], check=True,
                       stdout=subprocess.DEVNULL, env=dict(os.environ, DESTDIR=str(stage)))
        (stage / cls.prefix.relative_to("/")).rename(cls.prefix)
        cls.elsewhere = ["/" + str(path.relative_to(stage)) for path in stage.rglob("*") if not path.is_dir()]

    def start(self, command, **options):
        return subprocess.Popen(["bash", "-c", "source '%s/setup.bash' && %s" % (self.prefix, command)],
                                cwd=self.folder, env=self.environment, universal_newlines=True, **options)

    def run_command(self, command):
        """What a command prints that must succeed in the environment of the install space."""
        process = self.start(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        try:
            output = process.communicate(timeout=TIMEOUT)[0]
        finally:
            process.kill()
        self.assertEqual(process.returncode, 0, "%s\n%s" % (command, output))
        return output

    def launch(self, command):
        """Starts roslaunch, for a master of its own."""
        log = (self.folder / "roslaunch.log").open("w")
        self.addCleanup(log.close)
        port = self.environment["ROS_MASTER_URI"].rsplit(":", 1)[1]
        process = self.start("exec roslaunch -p %s disparity_refinement %s" % (port, command), stdout=log,
                             stderr=subprocess.STDOUT)

        def end():
            process.send_signal(signal.SIGINT)
            process.wait(TIMEOUT)
        self.addCleanup(end)
        return process

    def launch_log(self):
        return (self.folder / "roslaunch.log").read_text()

    def test_everything_is_below_the_prefix(self):
        self.assertEqual(self.elsewhere, [])

    def test_nothing_names_source_or_build_folder(self):
        for path in self.prefix.rglob("*"):
            if path.is_dir() or path.suffix == ".pyc":
                continue
            self.assertFalse(str(ROOT).encode() in path.read_bytes(), "%s names %s" % (path, ROOT))

    def test_environment(self):
        for setup in ("bash -c 'source %s/setup.bash; env'", "sh -c '. %s/setup.sh; env'", "%s/env.sh env"):
            process = subprocess.run(setup % self.prefix, shell=True, cwd=self.folder, env=self.environment, check=True,
                                     stdout=subprocess.PIPE, universal_newlines=True)
            variables = dict(line.split("=", 1) for line in process.stdout.splitlines())
            for name, folder in (("CMAKE_PREFIX_PATH", ""), ("LD_LIBRARY_PATH", "lib"),
                                 ("PKG_CONFIG_PATH", "lib/pkgconfig"), ("PYTHONPATH", "lib/python3/dist-packages")):
                self.assertEqual(variables[name].split(":")[0], str(self.prefix / folder), setup)
            self.assertFalse(str(ROOT) in process.stdout, process.stdout)

    def test_is_found(self):
        share = self.prefix / "share/disparity_refinement"
        self.assertEqual(self.run_command("rospack find disparity_refinement").strip(), str(share))
        plugins = self.run_command("rospack plugins --attrib=plugin nodelet").splitlines()
        self.assertIn("disparity_refinement %s/nodelets.xml" % share, plugins)
        self.assertTrue((share / "nodelets.xml").is_file())
        # Not by pkg-config: some of Debian's ROS packages have no such file.
        pkg_config = (self.prefix / "lib/pkgconfig/disparity_refinement.pc").read_text()
        self.assertEqual(pkg_config.splitlines()[0], "prefix=%s" % self.prefix)

    def test_python_modules(self):
        self.run_command("""/usr/bin/python3 -c '
import disparity_refinement.msg, disparity_refinement.cfg
from disparity_refinement.msg import Plane, Planes
from disparity_refinement.cfg import DisparityConfig, PlaneRefinementConfig, SegmentationConfig, VisualizationConfig
Planes(planes=[Plane()])
assert SegmentationConfig.defaults["lambda"] > 0
for module in (disparity_refinement.msg, disparity_refinement.cfg):
    assert module.__file__.startswith("%s/"), module.__file__
'""" % self.prefix)

    def test_launch_files(self):
        self.run_command("rosrun disparity_refinement render_street any.bag --frames 1")
        for name in ("stereo_refinement", "kitti"):
            path = self.prefix / ("share/disparity_refinement/launch/%s.launch" % name)
            self.assertTrue(path.is_file(), path)
            self.run_command("rosrun roslaunch roslaunch-check %s bag:=%s/any.bag" % (path, self.folder))

    def test_tools(self):
        for tool in TOOLS:
            self.run_command("rosrun disparity_refinement %s --help" % tool)
        self.run_command("rosrun disparity_refinement render_street street --frames 1")
        left, right = ("street/image_%d/000000_10.png" % camera for camera in (0, 1))
        self.run_command("rosrun disparity_refinement refine %s %s --output refined.png --disparity_range 64 "
                         "--params %s/share/disparity_refinement/params/kitti_quality.yaml" %
                         (left, right, self.prefix))
        self.assertGreater((self.folder / "refined.png").stat().st_size, 0)

    def test_rig(self):
        process = self.launch("stereo_refinement.launch")
        deadline = time.monotonic() + TIMEOUT
        loaded = ""
        while not all("/stereo/" + name in loaded for name in NODELETS):
            log = self.launch_log()
            self.assertTrue(process.poll() is None and "process has died" not in log, log)
            self.assertLess(time.monotonic(), deadline, "loaded: %s\n%s" % (loaded, log))
            time.sleep(0.5)
            loaded = self.run_command("rosservice call /stereo/refinement_manager/list 2>&1 || true")
        pid = self.run_command("rosnode info /stereo/refinement_manager | sed -n 's/^Pid: *//p'").strip()
        maps = pathlib.Path("/proc", pid, "maps").read_text()
        for library in ("disparity_refinement", "disparity_refinement_nodelets"):
            self.assertIn("%s/lib/lib%s.so\n" % (self.prefix, library), maps)
        self.assertFalse(str(ROOT) in maps, maps)

    def test_bag(self):
        frames = 5
        self.run_command("rosrun disparity_refinement render_street street.bag --frames %d" % frames)
        process = self.launch("kitti.launch bag:=%s/street.bag report:=%s/report disparity_range:=64" %
                              (self.folder, self.folder))
        process.wait(TIMEOUT)
        report = self.folder / "report/report.txt"
        self.assertTrue(report.is_file(), self.launch_log())
        text = report.read_text()
        for row in ("frames in", "frames refined"):
            self.assertRegex(text, r"(?m)^%s +%d$" % (row, frames), self.launch_log())

    def test_downstream_package(self):
        build = self.folder / "downstream"
        self.run_command("cmake -S '%s/test/downstream' -B '%s' -DPYTHON_EXECUTABLE=/usr/bin/python3 && "
                         "cmake --build '%s'" % (ROOT, build, build))
        program = build / "devel/lib/downstream/refine_street"
        self.run_command(str(program))
        self.assertIn("=> %s/lib/libdisparity_refinement.so " % self.prefix, self.run_command("ldd %s" % program))


if __name__ == "__main__":
    unittest.main(verbosity=2)
