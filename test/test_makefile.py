# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""What make says before it does what takes long, or cannot work."""

from pathlib import Path
import shutil
import subprocess
import sys

import pytest

ROOT = Path(__file__).parents[1]
PYTHON = """\
#!/bin/sh
case "$*" in
  *_base_executable*) echo "$0" ;;
  *'import rclpy'*) exit 1 ;;
  *version_info*) exec {python} -c "import sys; sys.version_info = {version}; $2" ;;
  *) echo "did $*"; mkdir -p .venv/bin; ln -sf /bin/true .venv/bin/pip ;;
esac
"""


@pytest.fixture
def made(tmp_path):
    """Return a function that makes a .venv with a Python of a version; returns the process."""
    for name in ('Makefile', 'package.xml', 'setup.cfg', 'setup.py'):
        shutil.copy(ROOT / name, tmp_path)
    python = tmp_path / 'python'

    def make(*version):
        python.write_text(PYTHON.format(python=sys.executable, version=version))
        python.chmod(0o755)
        return subprocess.run(['make', '-C', str(tmp_path), 'setup', f'PYTHON={python}'],
                              capture_output=True, text=True)
    return make


def test_a_python_that_is_too_old_is_told_before_anything_is_made(made, tmp_path):
    process = made(3, 10, 12)
    assert process.returncode == 2
    assert process.stderr.startswith('make: dm_ros needs Python 3.11 or newer, ')
    assert 'python is 3.10: make PYTHON=' in process.stderr
    assert not (tmp_path / '.venv').exists()


def test_it_says_that_packages_are_fetched_before_it_fetches_them(made):
    process = made(3, 11, 0)
    assert process.returncode == 0, process.stderr
    words, *_ = [line for line in process.stdout.splitlines() if not line.startswith('make')]
    assert words == 'making .venv, once: packages are fetched, which takes about a minute'
