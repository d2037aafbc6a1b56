// Copyright 2026 dm_ros developers
// SPDX-License-Identifier: Apache-2.0

// Solids made of flat faces, in coordinates of their own: along their axis, and around it.

// A point is (a, r, t): place along the axis, radius, angle.
const xyz = ([a, r, t]) => [a, r * Math.cos(t), r * Math.sin(t)];
const minus = (p, q) => p.map((x, i) => x - q[i]);
const dot = (p, q) => p[0] * q[0] + p[1] * q[1] + p[2] * q[2];
const cross = (p, q) => [
  p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]];
const mean = points => [0, 1, 2].map(
  i => points.reduce((sum, p) => sum + p[i], 0) / points.length);

export class Solid {
  constructor() {
    this.points = [];   // [x, y, z]
    this.faces = [];    // {corners: indices, normal, centre, part}
  }

  point(...place) {
    return this.points.push(xyz(place)) - 1;
  }

  // inside: a point (a, r, t) behind the face, which tells where its outside is
  face(part, inside, corners) {
    const points = corners.map(i => this.points[i]);
    const centre = mean(points);
    let normal = [0, 0, 0];   // Newell's, so that corners may coincide
    points.forEach((p, i) => {
      const q = cross(p, points[(i + 1) % points.length]);
      normal = normal.map((x, k) => x + q[k]);
    });
    const length = Math.hypot(...normal);
    if (length < 1e-12) return;
    const way = dot(normal, minus(centre, xyz(inside))) < 0 ? -1 : 1;
    this.faces.push({corners, centre, part, normal: normal.map(x => way * x / length)});
  }
}

// A toothed wheel. Pitch surface from `outer` to `inner`, each (a, r); `tip`: unit vector (a, r) in
// which the teeth point; `rim` and `hub`: (a, r) to which the body goes behind the outer end;
// `core`: (a, r) to which it goes behind the inner one.
export function gear(teeth, {outer, inner, tip, rim, hub, core}) {
  const solid = new Solid();
  solid.teeth = teeth;
  const step = 2 * Math.PI / teeth, module = 2 * outer[1] / teeth;
  const shrunk = Math.min(1, inner[1] / outer[1]);
  const at = ([a, r], height) => [a + height * tip[0], r + height * tip[1]];
  const low = -0.55 * module, high = 0.45 * module;
  const ends = [[outer, 1], [inner, tip[1] === 0 ? 1 : shrunk]];
  const profile = [[-0.33, low], [-0.15, high], [0.15, high], [0.33, low]];
  const rows = ends.map(([end, size]) => Array.from({length: teeth}, (_, j) => profile.map(
    ([share, height]) => solid.point(...at(end, height * size), (j + share) * step))));
  const circle = place => Array.from(
    {length: teeth}, (_, j) => solid.point(...place, (j - 0.33) * step));
  const [rims, hubs, cores] = [rim, hub, core].map(circle);
  const deep = mean([[...at(outer, 1.6 * low), 0], [...at(inner, 1.6 * low), 0]]);
  for (let j = 0; j < teeth; j++) {
    const next = (j + 1) % teeth, inside = [deep[0], deep[1], j * step];
    const [o, i] = [rows[0][j], rows[1][j]];
    for (let k = 0; k < 3; k++) solid.face('tooth', inside, [o[k], o[k + 1], i[k + 1], i[k]]);
    const p = rows[0][next][0], q = rows[1][next][0];
    solid.face('root', inside, [o[3], p, q, i[3]]);
    const part = j === 0 ? 'mark' : 'side';
    solid.face(part, inside, [...o, p, rims[next], rims[j]]);
    solid.face('side', inside, [rims[j], rims[next], hubs[next], hubs[j]]);
    solid.face('side', inside, [...i, q, cores[next], cores[j]]);
  }
  return solid;
}

// A round bar from a0 to a1, in pieces, so that what is before and what is behind it is seen so.
export function bar(radius, a0, a1, {sides = 12, pieces = 1, stripe = true} = {}) {
  const solid = new Solid(), step = 2 * Math.PI / sides;
  const rings = Array.from({length: pieces + 1}, (_, k) => Array.from({length: sides}, (_, j) =>
    solid.point(a0 + (a1 - a0) * k / pieces, radius, j * step)));
  for (let k = 0; k < pieces; k++) {
    const middle = [a0 + (a1 - a0) * (k + 0.5) / pieces, 0, 0];
    for (let j = 0; j < sides; j++) {
      const next = (j + 1) % sides;
      solid.face(stripe && j === 0 ? 'mark' : 'side', middle,
        [rings[k][j], rings[k][next], rings[k + 1][next], rings[k + 1][j]]);
    }
    if (k === 0) solid.face('side', middle, rings[0]);
    if (k === pieces - 1) solid.face('side', middle, rings[pieces]);
  }
  return solid;
}

// A flat ring from a0 to a1; the mark is the first of its sectors.
export function ring(inner, outer, a0, a1, {sectors = 24, marks = 1} = {}) {
  const solid = new Solid(), step = 2 * Math.PI / sectors;
  const circle = (a, r) => Array.from({length: sectors}, (_, j) => solid.point(a, r, j * step));
  const [i0, o0, i1, o1] = [
    circle(a0, inner), circle(a0, outer), circle(a1, inner), circle(a1, outer)];
  for (let j = 0; j < sectors; j++) {
    const next = (j + 1) % sectors;
    const inside = [(a0 + a1) / 2, (inner + outer) / 2, (j + 0.5) * step];
    const part = marks && j % (sectors / marks) === 0 ? 'mark' : 'side';
    solid.face(part, inside, [i0[j], i0[next], o0[next], o0[j]]);
    solid.face(part, inside, [i1[j], i1[next], o1[next], o1[j]]);
    solid.face(part, inside, [o0[j], o0[next], o1[next], o1[j]]);
    solid.face(part, inside, [i0[j], i0[next], i1[next], i1[j]]);
  }
  return solid;
}
