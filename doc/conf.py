# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
What rosdoc2 is to know of these pages.

It runs this from a ``conf.py`` of its own, in a folder to which it has copied the pages. Version
0.2.1 copies them to other places than they have in the package, where the README finds no page
and no picture; here they get their places back, as later versions do by themselves.
"""

from pathlib import Path
import re
import shutil
import sys

copyright = 'dm_ros developers'
exclude_patterns = []
highlight_language = 'none'   # most blocks are for a shell, or equations
html_static_path = ['doc/pages.css']
html_css_files = ['pages.css']

if Path('user_docs').is_dir():
    this = re.search(r'exec\(open\("(.+?)"', Path('conf.py').read_text()).group(1)
    sys.path.insert(0, str(Path(this).parents[1]))   # where dm_ros is
    shutil.copytree('user_docs', 'doc', dirs_exist_ok=True)
    shutil.copytree('standard_docs/original', '.', dirs_exist_ok=True)
    pages = Path('index.rst').read_text()
    Path('index.rst').write_text(
        '.. include:: README.md\n   :parser: myst_parser.sphinx_\n\n'
        + pages[pages.index('.. toctree::'):].replace(':maxdepth: 1', ':hidden:')
        + '\n.. toctree::\n   :hidden:\n   :caption: The code\n\n'
        '   Python API <modules>\n   standards\n')
    exclude_patterns += [   # what is there twice
        '*.md', 'CHANGELOG.rst', '__readme_include.rst', 'doc/index.rst', 'user_docs*',
        'standard_docs/README.rst', 'standard_docs/original']
