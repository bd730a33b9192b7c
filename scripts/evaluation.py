"""What scripts/table1 and scripts/sweeps share: they run evaluate with variants and print a table."""
import json
import pathlib
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
EVALUATE = ROOT / "build/devel/lib/disparity_refinement/evaluate"
OWN_OPTIONS = ("--variant", "--maps", "--name", "--json")


def evaluate(training, options, variants):
    """The figures that evaluate writes as JSON: those of the first variant's matcher alone, and of every variant."""
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder) / "figures.json"
        command = [str(EVALUATE), training, "--json", str(file)] + options
        for variant in variants:
            command += ["--variant", variant]
        process = subprocess.run(command, stdout=subprocess.PIPE, universal_newlines=True)
        if process.returncode != 0:
            sys.exit(process.returncode)
        left_out = process.stdout.find("Left out")
        if left_out >= 0:
            sys.stderr.write(process.stdout[left_out:])
        methods = json.loads(file.read_text())
    refined = [method for method in methods if method["segments"] is not None]
    assert len(refined) == len(variants)
    return methods[0], refined


def run(documentation, main):
    """Builds evaluate and calls main with TRAINING_DIR and the further options of the command line."""
    arguments = sys.argv[1:]
    if "-h" in arguments or "--help" in arguments:
        print(documentation)
        return
    if not arguments or arguments[0].startswith("-"):
        sys.exit(documentation)
    for argument in arguments[1:]:
        if argument.split("=")[0] in OWN_OPTIONS:
            sys.exit(f"{pathlib.Path(sys.argv[0]).name}: {argument} is set by this script, expected other options")
    try:
        build = subprocess.run([str(ROOT / "scripts/build"), "evaluate"], stdout=sys.stderr)
        if build.returncode != 0:
            sys.exit(build.returncode)
        main(arguments[0], arguments[1:])
    except KeyboardInterrupt:
        sys.exit(130)
