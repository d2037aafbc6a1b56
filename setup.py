# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

from glob import glob
from xml.etree import ElementTree

from setuptools import setup

PACKAGE = ElementTree.parse('package.xml').getroot()
NAME = PACKAGE.findtext('name')
MATPLOTLIB = 'matplotlib>=3.6'

setup(
    name=NAME,
    version=PACKAGE.findtext('version'),
    description=PACKAGE.findtext('description'),
    maintainer=PACKAGE.findtext('maintainer'),
    maintainer_email=PACKAGE.find('maintainer').get('email'),
    license=PACKAGE.findtext('license'),
    packages=[NAME, f'{NAME}.comparison'],
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{NAME}']),
        (f'share/{NAME}', ['package.xml']),
        (f'share/{NAME}/config', glob('config/*.yaml') + glob('config/*.xml')),
    ],
    zip_safe=True,
    python_requires='>=3.11',
    install_requires=['numpy>=1.26', 'scipy>=1.11', 'PyYAML', 'tqdm'],
    extras_require={
        'physics': ['mujoco>=4'],
        'plot': [MATPLOTLIB],
        'ros': ['ros-jazzy-rclpy[fastrtps]', 'ros-jazzy-common-interfaces'],
        'test': ['hypothesis', 'pytest', 'pytest-xdist', MATPLOTLIB],
    },
    entry_points={
        'console_scripts': [
            'bias = dm_ros.bias:main',
            'compare_variants = dm_ros.compare_variants:main',
            'demo = dm_ros.demo:main',
            'differential = dm_ros.differential:main',
            'play_torques = dm_ros.play_torques:main',
            'simulate = dm_ros.simulate:main',
        ],
        'pytest11': ['dm_ros = dm_ros.pytest_plugin'],
    },
)
