"""The virtual environment of `make run` and `make test`: made where there is none that will do, or refused."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

pytestmark = pytest.mark.skipif(shutil.which("make") is None, reason="no make here")

STAND_IN = """#!/bin/sh
case "$1 $2" in
  "-c import pip") exit {pip} ;;
  "-c "*) exec {python} -c "$2" ;;
  "-m venv") mkdir -p "$4/bin"; touch "$4/made"; printf '#!/bin/sh\n' > "$4/bin/pip"; chmod +x "$4/bin/pip" ;;
esac
"""


def python(path, *, version=None, pip=0):
    """A program that stands in for Python: it tells its version, has pip or not, and makes an empty environment."""
    path.parent.mkdir(parents=True, exist_ok=True)
    told = sys.executable if version is None else f"{sys.executable} -c 'import sys; sys.exit(1)'"
    path.write_text(STAND_IN.format(python=told, pip=pip))
    path.chmod(0o755)
    return path


def made(folder, interpreter):
    """What `make` answers where the environment is to be in `folder`."""
    stamp = folder / ".run"
    # The tests are run by make themselves: what it hands down to another make would be told of.
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("MAKE", "MFLAGS"))}
    return subprocess.run(
        ["make", f"PYTHON={interpreter}", f"VENV={folder}", str(stamp)],
        cwd=ROOT, env=environment, capture_output=True, text=True, check=False,
    )  # fmt: skip


def test_environment_is_made_where_there_is_none(tmp_path):
    answer = made(tmp_path / "env", python(tmp_path / "python"))
    assert answer.returncode == 0, answer.stderr
    assert (tmp_path / "env" / "made").exists()


@pytest.mark.parametrize("left", [{"pip": 1}, {"version": "old"}], ids=["without pip", "of an old Python"])
def test_environment_that_will_not_do_is_made_anew(tmp_path, left):
    python(tmp_path / "env" / "bin" / "python", **left)
    assert made(tmp_path / "env", python(tmp_path / "python")).returncode == 0
    assert (tmp_path / "env" / "made").exists()


def test_environment_that_will_do_is_kept(tmp_path):
    python(tmp_path / "env" / "bin" / "python")
    python(tmp_path / "env" / "bin" / "pip")
    assert made(tmp_path / "env", "nothing").returncode == 0
    assert not (tmp_path / "env" / "made").exists()


def test_old_python_is_refused_in_one_sentence(tmp_path):
    for interpreter in (python(tmp_path / "python", version="old"), tmp_path / "nothing"):
        answer = made(tmp_path / "env", interpreter)
        assert answer.returncode == 2
        told = f"{interpreter} is not there or older than Python 3.11; name a newer one: make PYTHON=python3.12"
        assert answer.stderr.splitlines()[0] == told
        assert not (tmp_path / "env").exists()
