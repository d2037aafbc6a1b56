# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The shared library of an FMU: by the compiler of this machine, or by ziglang for others."""

from importlib.util import find_spec
import os
from pathlib import Path
import platform
import shlex
import shutil
import subprocess
import sys
from tempfile import TemporaryDirectory
from typing import NamedTuple

from dm_ros.files.output import replacing
from dm_ros.fmu.sources import compiled, OPTIONS

COMPILERS = 'cc', 'gcc', 'clang'
SYSTEMS = {'Linux': 'linux', 'Darwin': 'darwin', 'Windows': 'windows'}
MACHINES = {'AMD64': 'x86_64', 'arm64': 'aarch64'}   # where the standard has another name
SUFFIXES = {'linux': '.so', 'darwin': '.dylib', 'windows': '.dll'}


class Target(NamedTuple):
    """A platform, by its name in FMI 3.0."""

    zig: str       # what ziglang calls it
    fmi_2: str     # its folder in FMI 2.0, which has no name for some


# glibc 2.17 is that of 2012: what is made for it loads on all that came later
TARGETS = {
    'x86_64-linux': Target('x86_64-linux-gnu.2.17', 'linux64'),
    'aarch64-linux': Target('aarch64-linux-gnu.2.17', 'aarch64-linux'),
    'x86_64-windows': Target('x86_64-windows-gnu', 'win64'),
    'aarch64-windows': Target('aarch64-windows-gnu', 'aarch64-windows'),
    'x86_64-darwin': Target('x86_64-macos', 'darwin64'),
    'aarch64-darwin': Target('aarch64-macos', 'aarch64-darwin'),
}


def this_platform():
    """Return the name of the platform of this machine."""
    machine, system = platform.machine(), platform.system()
    return f'{MACHINES.get(machine, machine)}-{SYSTEMS.get(system, system.lower())}'


def compiler():
    """
    Return the command of the C compiler of this machine, None where there is none.

    :raises ValueError: for an environment variable CC that is no command.
    """
    if chosen := shlex.split(os.environ.get('CC', '')):
        if not shutil.which(chosen[0]):
            raise ValueError(f'CC: there is no command {chosen[0]}')
        return chosen
    return next(([name] for name in COMPILERS if shutil.which(name)), None)


def compiler_for(target):
    """
    Return the command of a compiler for a platform of ``TARGETS``.

    :raises ValueError: where ziglang is not installed.
    """
    if not find_spec('ziglang'):
        raise ValueError(f'--target: {target} needs the package ziglang: pip install ziglang')
    return [sys.executable, '-m', 'ziglang', 'cc', '-target', TARGETS[target].zig, '-s']


def place(version, target, identifier):
    """Return where the library for a platform is in an FMU."""
    known = TARGETS.get(target)
    folder = known.fmi_2 if known and version == '2.0' else target
    suffix = SUFFIXES.get(target.rpartition('-')[2], '.so')
    return f'binaries/{folder}/{identifier}{suffix}'


def library(command, files, target):
    """
    Return the bytes of the shared library that a compiler makes of sources.

    :param command: as ``compiler`` returns it; files: ``{name: bytes}``; target: the platform.
    :raises ValueError: what the compiler said, where it fails.
    """
    with TemporaryDirectory() as folder:
        for name, content in files.items():
            path = Path(folder, name)
            path.parent.mkdir(exist_ok=True)
            with replacing(path, 'wb') as file:
                file.write(content)
        made = Path(folder, f'made{SUFFIXES.get(target.rpartition("-")[2], ".so")}')
        is_windows = target.endswith('windows')
        options = [*OPTIONS, '-shared', '-fvisibility=hidden', '-Iheaders',
                   *([] if is_windows else ['-fPIC', '-lm'])]
        words = [*command, *compiled(files), '-o', made.name, *options]
        try:
            subprocess.run(words, cwd=folder, check=True, capture_output=True, text=True,
                           stdin=subprocess.DEVNULL)
        except subprocess.CalledProcessError as error:
            raise ValueError(f'{shlex.join(command)} failed for {target}: {error.stderr.strip()}'
                             ) from None
        return made.read_bytes()
