# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""An FMU as a file: description, sources, binaries and a page, equal bytes from equal input."""

from hashlib import sha256
from html import escape
from importlib.metadata import version as version_of
from io import BytesIO
from uuid import UUID
import zipfile

from dm_ros.fmu.binary import library, place
from dm_ros.fmu.description import LICENCE, model_description
from dm_ros.fmu.sources import compiled, source_files, sources
from dm_ros.fmu.variables import variables

EARLIEST = 1980, 1, 1, 0, 0, 0   # of a zip
PAGE = """\
<!DOCTYPE html>
<html lang="en">
<head><meta charset="utf-8"><title>{variant}</title></head>
<body>
<h1>{variant}</h1>
<p>The {title} of {package}, variant {variant}, under the loss law {loss_law}. Within it time goes
on in ticks of {dt} s; a communication step is a whole multiple of that. In a step the inputs are
held. Inputs: {inputs}. A moment is positive when the mechanism drives the shaft.</p>
<p>What is refused, such as a value out of range or a step that is no whole multiple, gets an error
and words through the logger; the instance stays as it was.</p>
<p>Licence: {licence}. See <a href="licenses/license.txt">licenses/license.txt</a>.</p>
<table>
<tr><th>variable</th><th>causality</th><th>unit</th><th>meaning</th></tr>
{rows}
</table>
</body>
</html>
"""
LICENCES = """\
This FMU comes from dm_ros, Copyright 2026 dm_ros developers, SPDX-License-Identifier: {licence}.
The headers of the standard in sources/headers have a licence of their own, see the LICENSE there.
"""


def page(simulation, all_variables, package):
    """Return the page that tells what an FMU is, as bytes."""
    rows = [f'<tr><td>{v.name}</td><td>{v.causality}</td><td>{v.unit}</td>'
            f'<td>{escape(v.description)}</td></tr>' for v in all_variables]
    inputs = ', '.join(f'{v.name} ({v.unit})' for v in all_variables if v.causality == 'input')
    return PAGE.format(
        variant=simulation.variant, title=simulation.mechanism.title, package=package,
        loss_law=simulation.loss_law, dt=repr(simulation.dt), inputs=inputs, licence=LICENCE,
        rows='\n'.join(rows)).encode()


def fmu(simulation, version, compilers):
    """
    Return an FMU as bytes.

    :param simulation: a ``Simulation`` on torques; version: of FMI, '2.0' or '3.0'.
    :param compilers: ``{platform: command}``, see ``dm_ros.fmu.binary``.
    :raises ValueError: what a compiler said, where it fails.
    """
    identifier = f'dm_ros_{simulation.variant}'
    package = f'dm_ros {version_of("dm_ros")}'
    all_variables, files = variables(simulation), source_files(version)

    def described(token):
        description = model_description(simulation, version, all_variables, identifier, token,
                                        package, compiled(files))
        return description, sources(simulation, version, all_variables, identifier, token, files)

    without_token = described('')
    content = without_token[0] + b''.join(
        name.encode() + text for name, text in sorted(without_token[1].items()))
    token = f'{{{UUID(bytes=sha256(content).digest()[:16], version=5)}}}'
    description, all_sources = described(token)
    members = {'modelDescription.xml': description,
               'documentation/index.html': page(simulation, all_variables, package),
               'documentation/licenses/license.txt': LICENCES.format(licence=LICENCE).encode(),
               **{f'sources/{name}': text for name, text in sorted(all_sources.items())}}
    for target, command in sorted(compilers.items()):
        members[place(version, target, identifier)] = library(command, all_sources, target)
    archive = BytesIO()
    with zipfile.ZipFile(archive, 'w', zipfile.ZIP_DEFLATED) as file:
        for name, text in members.items():
            entry = zipfile.ZipInfo(name, EARLIEST)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = 0o644 << 16
            file.writestr(entry, text)
    return archive.getvalue()
