# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

from glob import glob
from xml.etree import ElementTree

from setuptools import Extension, find_packages, setup

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
    packages=find_packages(include=[NAME, f'{NAME}.*']),
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{NAME}']),
        (f'share/{NAME}', ['package.xml']),
        (f'share/{NAME}/config', glob('config/*.yaml') + glob('config/*.xml')),
        (f'share/{NAME}/config/layouts', glob('config/layouts/*')),
        (f'share/{NAME}/config/presets', glob('config/presets/*.yaml')),
        (f'share/{NAME}/config/ros2_control', glob('config/ros2_control/*')),
        (f'share/{NAME}/launch', glob('launch/*.launch.py')),
    ],
    package_data={NAME: ['ros/*.xml', 'sources/**/*', 'watch/web/*', 'watch/web/uplot/*']},
    ext_modules=[Extension(   # never required: without a compiler Python does it all
        f'{NAME}._core', sorted(glob('core/*.c') + glob('core/ensemble/*.c')),
        depends=glob('core/**/*.h', recursive=True), optional=True, py_limited_api=True,
        extra_compile_args=[   # equal bits: no fused multiply-add
            '-std=c99', '-O3', '-ffp-contract=off', '-fno-math-errno', '-fno-trapping-math',
            '-fvisibility=hidden'])],
    zip_safe=False,   # Fast DDS reads localhost.xml itself
    python_requires='>=3.11',
    install_requires=['numpy>=1.26', 'scipy>=1.11', 'PyYAML', 'tqdm'],
    extras_require={
        'bag': ['rosbags>=0.11.9'],
        'browser': ['selenium>=4.11'],
        'cluster': ['distributed>=2024.1'],
        'fmu': ['fmpy>=0.3.32', 'libcosimpy', 'ziglang'],
        'gym': ['gymnasium>=1.1'],
        'mcap': ['mcap-ros2-support'],
        'parquet': ['pyarrow>=14'],
        'physics': ['mujoco>=4', 'rumoca==0.10.2'],
        'plot': [MATPLOTLIB],
        'ros': ['ros-jazzy-rclpy[fastrtps]', 'ros-jazzy-common-interfaces'],
        'test': ['hypothesis', 'pytest', 'pytest-xdist', MATPLOTLIB],
        'urdf': ['yourdfpy>=0.0.56'],
    },
    entry_points={
        'console_scripts': [
            'bias = dm_ros.commands:bias',
            'compare_variants = dm_ros.commands:compare_variants',
            'demo = dm_ros.commands:demo',
            'differential = dm_ros.commands:differential',
            'driveline = dm_ros.commands:driveline',
            'export_fmu = dm_ros.commands:export_fmu',
            'identify = dm_ros.commands:identify',
            'play_torques = dm_ros.commands:play_torques',
            'simulate = dm_ros.commands:simulate',
            'sweep = dm_ros.commands:sweep',
            'urdf = dm_ros.commands:urdf',
            'watch = dm_ros.commands:watch',
        ],
        'pytest11': ['dm_ros = dm_ros.testing.pytest_plugin'],
    },
)
