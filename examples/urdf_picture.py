# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Draw the URDF of both mechanisms, posed by a run, as in doc/looking.png: needs yourdfpy."""

import argparse
import io

import numpy as np
from PIL import Image
import yourdfpy

from dm_ros import Simulation
from dm_ros.files.urdf import urdf

RUNS = {'symmetric_ode': ((-0.45, -0.75, -0.45), (30.0, -20.0, -60.0)),
        'lsd_ode': ((-0.60, -0.70, -0.45), (60.0, -20.0, -70.0))}   # from where; torques in N m
TICKS = 60
LIGHT = np.array((0.45, 0.10, 0.89))   # where it comes from, of length 1
FINER = 3   # rays across a pixel


def scene(variant, torques):
    """Return the parts of a mechanism after some ticks, as one mesh."""
    simulation = Simulation(variant, dt=0.005)
    for _ in range(TICKS):
        snapshot = simulation.step(torques)
    text = urdf(simulation.mechanism, simulation.parameters)
    robot = yourdfpy.URDF.load(io.BytesIO(text.encode()))
    robot.update_cfg(dict(zip(simulation.shafts, snapshot.position, strict=True)))
    return robot.scene.to_mesh()


def picture(mesh, sight, width, height):
    """Return an image, (height, width, 3), of a mesh that is looked at along a direction."""
    sight = np.asarray(sight) / np.linalg.norm(sight)
    right = np.cross(sight, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    up = np.cross(right, sight)
    seen = mesh.vertices @ np.column_stack((right, up))
    low, high = seen.min(axis=0), seen.max(axis=0)
    pixel = 1.04 * max((high - low) / (width, height))
    x, y = np.meshgrid((np.arange(width) - width / 2 + 0.5) * pixel,
                       (height / 2 - np.arange(height) - 0.5) * pixel)
    middle = (low + high) / 2
    far = 4.0 * mesh.scale
    origins = ((x.ravel() + middle[0])[:, None] * right + (y.ravel() + middle[1])[:, None] * up
               - far * sight)
    hit = mesh.ray.intersects_first(origins, np.broadcast_to(sight, origins.shape))
    image = np.full((width * height, 3), 255.0)
    facing = mesh.face_normals @ LIGHT
    shade = 0.66 + 0.34 * facing
    colours = mesh.visual.face_colors[:, :3] * shade[:, None]
    image[hit >= 0] = colours[hit[hit >= 0]]
    return image.reshape(height, width, 3)


def main():
    """Draw one mechanism beside the other."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--out', metavar='OUT.png', default='looking.png')
    parser.add_argument('--width', type=int, default=900, help='pixels')
    arguments = parser.parse_args()
    width, height = arguments.width // 2 * FINER, arguments.width * 4 // 9 * FINER
    image = np.hstack([picture(scene(variant, torques), sight, width, height)
                       for variant, (sight, torques) in RUNS.items()])
    image = Image.fromarray(image.clip(0, 255).astype('uint8'))
    image = image.reduce(FINER).quantize(128, method=Image.Quantize.MEDIANCUT)
    image.save(arguments.out, optimize=True)


if __name__ == '__main__':
    main()
