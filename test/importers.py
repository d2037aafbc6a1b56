# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""FMUs as they are exported, and the importers that run them in tests."""

import atexit
from functools import cache
import os
from pathlib import Path
import shutil
import sys
from tempfile import mkdtemp

from dm_ros.tools.export_fmu import main

FOLDER = Path(mkdtemp(prefix='fmu-'))
atexit.register(shutil.rmtree, FOLDER, ignore_errors=True)


@cache
def exported(variant, version='2.0', parameters='', *options):
    """
    Return the path of an FMU.

    :param parameters: lines of a parameter file below its parameters.
    """
    path = FOLDER / f'{len(list(FOLDER.iterdir()))}.fmu'
    words = ['--variant', variant, '--fmi', version, '--out', str(path), *options]
    if parameters:
        file = path.with_suffix('.yaml')
        file.write_text('/**:\n  ros__parameters:\n' + ''.join(
            f'    {line}\n' for line in parameters.splitlines()))
        words += ['--params', str(file)]
    assert main(words) == 0
    return path


@cache
def extracted(path):
    """Return the folder with what is in an FMU."""
    import fmpy
    return str(fmpy.extract(str(path), unzipdir=str(path.with_suffix(''))))


class Instance:
    """An instance of an FMU by FMPy, with names for both versions of the standard."""

    words = []   # of all: FMPy hands those of FMI 2.0 to the instance that was made last

    def __init__(self, path, version='2.0', folder=None, **times):
        """
        Instantiate it; ``times``: of ``enter``, which is done where there are any.

        :param folder: what is in the FMU, if that is elsewhere.
        """
        import fmpy
        self.folder = folder or extracted(path)
        description = fmpy.read_model_description(self.folder)
        self.variables = {v.name: v for v in description.modelVariables}
        self._is_2 = version == '2.0'
        self.fmu = fmpy.instantiate_fmu(self.folder, description, 'CoSimulation',
                                        logger=self._hear)

    def _hear(self, *message):
        self.words.append(message[-1].decode())

    def heard(self):
        """Return what was told since the last time."""
        words = ' '.join(self.words)
        self.words.clear()
        return words

    def start(self, start=0.0, stop=None, **values):
        """Go through the initialization mode with values by name."""
        self.enter(start, stop)
        self.set(values)
        self.fmu.exitInitializationMode()
        return self

    def enter(self, start=0.0, stop=None):
        """Enter the initialization mode."""
        if self._is_2:
            self.fmu.setupExperiment(startTime=start, stopTime=stop)
            self.fmu.enterInitializationMode()
        else:
            self.fmu.enterInitializationMode(startTime=start, stopTime=stop)

    def set(self, values):
        """Set values by name, all reals in one call."""
        for kind, names in self._by_type(values):
            getattr(self.fmu, f'set{kind}')([self.variables[n].valueReference for n in names],
                                            [values[n] for n in names])

    def get(self, *names):
        """Return values by name."""
        found = {}
        for kind, some in self._by_type(names):
            values = getattr(self.fmu, f'get{kind}')([self.variables[n].valueReference
                                                      for n in some])
            found.update(zip(some, values))
        return [found[name] for name in names]

    def _by_type(self, names):
        kinds = {}
        for name in names:
            kinds.setdefault(self.variables[name].type, []).append(name)
        return kinds.items()

    def step(self, at, length):
        """Do a step."""
        self.fmu.doStep(currentCommunicationPoint=at, communicationStepSize=length)


def build(folder):
    """Compile the sources of an FMU in a folder by FMPy."""
    from fmpy.build import build_platform_binary
    path = os.environ['PATH']
    os.environ['PATH'] = f'{Path(sys.executable).parent}{os.pathsep}{path}'   # where cmake is
    try:
        build_platform_binary(folder)
    finally:
        os.environ['PATH'] = path
