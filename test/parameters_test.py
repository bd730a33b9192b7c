#!/usr/bin/env python3
"""Every parameter of the .cfg files is a launch argument and stands in the README with its default."""

import pathlib
import re
import unittest

ROOT = pathlib.Path(__file__).resolve().parent.parent


def parameters():
    """(nodelet, name, default) of every parameter."""
    nodelets = {"Disparity": "disparity", "Segmentation": "segmentation", "PlaneRefinement": "plane_refinement",
                "Visualization": "visualization"}
    for cfg, nodelet in nodelets.items():
        text = (ROOT / "cfg" / (cfg + ".cfg")).read_text()
        for match in re.finditer(r'gen\.add\("(\w+)", \w+, 0,\s*"[^"]*",\s*([^,)]+)', text):
            yield nodelet, match.group(1), match.group(2).lower()


class Parameters(unittest.TestCase):

    def test_there_are_some(self):
        self.assertGreater(len(list(parameters())), 30)

    def test_each_is_a_launch_argument(self):
        launch = (ROOT / "launch" / "stereo_refinement.launch").read_text()
        for nodelet, name, _ in parameters():
            self.assertIn('<arg name="%s" default=""/>' % name, launch)
            self.assertIn('name="%s/%s" value="$(arg %s)"' % (nodelet, name, name), launch)

    def test_launch_file_for_bags_passes_on_what_the_readme_says(self):
        rig, bag = ((ROOT / "launch" / (name + ".launch")).read_text() for name in ("stereo_refinement", "kitti"))
        readme = (ROOT / "README.md").read_text()
        but = re.search(r"all of stereo_refinement.launch but (.*?)\. It sets", readme, re.DOTALL).group(1)
        exceptions = re.findall(r"`(\w+)(…?)`", but)
        self.assertGreater(len(exceptions), 3)
        names = set(re.findall(r'<arg name="(\w+)" default=', rig))
        excepted = {name for name in names for word, more in exceptions
                    if name == word or (more and name.startswith(word))}
        passed_on = set(re.findall(r'<arg name="(\w+)" value="\$\(arg \1\)"/>', bag))
        self.assertEqual(passed_on, names - excepted)

    def test_those_of_the_readme_are_launch_arguments(self):
        readme = (ROOT / "README.md").read_text()
        launch = (ROOT / "launch" / "stereo_refinement.launch").read_text()
        rows = re.findall(r"^\| `(\w+)` \|.*\| (?:yes|no) \|", readme.split("\n## Parameters\n")[1].split("\n## ")[0], re.MULTILINE)
        self.assertGreater(len(rows), 50)
        for name in rows:
            self.assertIn('<arg name="%s" default=""' % name, launch)

    def test_each_is_in_the_readme_with_its_default(self):
        readme = (ROOT / "README.md").read_text()
        for nodelet, name, default in parameters():
            section = readme.split("### " + nodelet + "\n")[1].split("\n### ")[0]
            rows = [line.split("|") for line in section.splitlines() if line.startswith("| `%s` |" % name)]
            self.assertEqual(len(rows), 1, name)
            self.assertEqual(rows[0][3].strip().replace("\u2212", "-"), default, name)


if __name__ == "__main__":
    unittest.main()
