"""The program in the package."""

import shutil
import subprocess
import sys

import surfel


def run(*words):
    return subprocess.run([sys.executable, "-m", "surfel", *map(str, words)], capture_output=True, text=True)


def test_the_program_has_the_version_of_the_package():
    assert run("--version").stdout == f"surfel {surfel.__version__}\n"


def test_wrong_use_has_exit_code_2():
    program = run("paint")
    assert program.returncode == 2 and "unrecognized subcommand" in program.stderr


def test_failure_has_exit_code_1(tmp_path):
    assert run("info", tmp_path / "nowhere.laz").returncode == 1


def test_the_script_is_installed(hill):
    script = shutil.which("surfel", path=sys.exec_prefix + "/bin") or shutil.which("surfel")
    program = subprocess.run([script, "info", hill], capture_output=True, text=True)
    assert program.returncode == 0 and "2500" in program.stdout


def test_import_is_quick_and_leaves_numpy_out():
    code = "import sys, surfel; print('numpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout == "False\n"
