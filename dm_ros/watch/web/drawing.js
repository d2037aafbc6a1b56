// Copyright 2026 dm_ros developers
// SPDX-License-Identifier: Apache-2.0

// The drawing: a mechanism seen from behind and above, faces painted from far to near.

import {blend, Colours, role} from './colours.js';
import {Mechanism} from './mechanism.js';

const YAW = 0.72, PITCH = 0.44;           // rad, of the eye
const LIGHT = [-0.35, 0.75, 0.56];        // towards it, as the eye sees
const SHADES = 24;
const GLOW = 0.55;                        // how far from where teeth touch a mesh has its colour
const LAG = 0.07;                         // s, of each of two lags that make steps even
const FASTEST = 2.5;                      // rad/s, of the fastest shaft in the drawing
const SCALES = [1, 0.5, 0.2, 0.1];        // and these by powers of ten
const MEMORY = 8;                         // s for which the drawing stays as slow
const CHEVRONS = 3;
const FAINT = 0.05;                       // share of the most below which a colour fades

// The largest of 1, 1/2, 1/5, 1/10, ... at which a speed in rad/s is calm.
export function scaleFor(speed) {
  const wanted = Math.min(1, FASTEST / Math.max(speed, 1e-9));
  const decade = 10 ** Math.floor(Math.log10(wanted) + 1);
  return SCALES.map(s => s * decade).find(s => s <= wanted * 1.0001);
}

// One of the chevrons that go along a way, at a share of it; in the colours of the context.
export function chevron(context, [x0, y0], [x1, y1], along, size) {
  context.save();
  context.translate(x0 + along * (x1 - x0), y0 + along * (y1 - y0));
  context.rotate(Math.atan2(y1 - y0, x1 - x0));
  context.globalAlpha = Math.min(1, 5 * Math.min(along, 1 - along));
  context.lineWidth = 1.5;
  context.beginPath();
  context.moveTo(size, 0);
  context.lineTo(-0.7 * size, 0.85 * size);
  context.lineTo(-0.25 * size, 0);
  context.lineTo(-0.7 * size, -0.85 * size);
  context.closePath();
  context.stroke();
  context.fill();
  context.restore();
}

export class Drawing {
  constructor(canvas) {
    this.canvas = canvas;
    this.context = canvas.getContext('2d');
    this.colours = new Colours();
    this.mechanism = null;
    this.labels = {};          // {shaft: [left, top, right, bottom]} of its label
    this.onResize = () => {};
    new ResizeObserver(() => this.#resize()).observe(canvas);
    matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => {
      this.colours = new Colours();
      this.changed = true;
    });
  }

  // Draw another mechanism, or none; scene: as the server describes it.
  show(scene) {
    this.mechanism = scene && scene.gears ? new Mechanism(scene.gears, scene) : null;
    this.shown = [0, 0];                         // angles of carrier and satellite, rad
    this.pending = [[0, 0], [0, 0]];             // what is still to be turned, in two lags
    this.travel = null;
    this.speeds = [];                            // [s, rad/s], the fastest
    this.scale = 1;
    this.powers = {meshes: {}, clutches: {}, shafts: {}, most: {power: 1, heat: 1}};
    this.flow = 0;
    this.changed = true;
    this.#resize();
  }

  // Turn on to where the shafts are now; travel: rad, of all shafts; speed: of the fastest, rad/s.
  turn(travel, speed, seconds) {
    this.speeds = this.speeds.filter(([time]) => time > seconds - MEMORY);
    this.speeds.push([seconds, speed]);
    this.scale = scaleFor(Math.max(...this.speeds.map(([, fastest]) => fastest)));
    const now = [travel[0], travel.at(-1)];
    if (this.travel) now.forEach((angle, i) => {
      this.pending[0][i] += (angle - this.travel[i]) * this.scale;
    });
    this.travel = now;
  }

  // Powers in W: of meshes, clutches and shafts by name, and the most of each that is expected.
  colour(powers) {
    this.powers = powers;
    this.changed = true;
  }

  // Draw, dt s after the last time, where there is anything new.
  frame(dt) {
    if (!this.mechanism || !this.width) return;
    const share = 1 - Math.exp(-dt / LAG);
    let turned = 0;
    for (const i of [0, 1]) {
      const first = this.pending[0][i] * share, second = this.pending[1][i] * share;
      this.pending[0][i] -= first;
      this.pending[1][i] += first - second;
      this.shown[i] += second;
      turned += Math.abs(second);
    }
    if (turned < 1e-6 && !this.changed) return;
    this.flow += Math.min(dt, 0.1) * (turned > 1e-6 ? 1 : 0);
    this.changed = false;
    this.#paint();
  }

  #resize() {
    const {clientWidth: width, clientHeight: height} = this.canvas;
    if (!width) return;
    const dense = Math.min(window.devicePixelRatio || 1, 2);
    this.canvas.width = width * dense;
    this.canvas.height = height * dense;
    [this.width, this.height, this.dense] = [width, height, dense];
    if (this.mechanism) this.#look();
    this.onResize();
    this.changed = true;
  }

  // Place the eye such that the whole mechanism is in the picture.
  #look() {
    const yaw = YAW * this.mechanism.side, [c, s] = [Math.cos(yaw), Math.sin(yaw)];
    const [u, v] = [Math.cos(PITCH), Math.sin(PITCH)];
    // rows: what is right, up, and towards the eye
    this.eye = [[c, -s, 0], [s * v, c * v, u], [-s * u, -c * u, v]];
    this.scaleTo = 1;
    const low = [Infinity, Infinity], high = [-Infinity, -Infinity];
    const angles = this.mechanism.angles(0, 0);
    for (const {solid, frame} of this.mechanism.parts) {
      const place = this.#placed(frame(angles));
      for (const point of solid.points) {
        const seen = this.#seen(place, point);
        for (const i of [0, 1]) {
          low[i] = Math.min(low[i], seen[i]);
          high[i] = Math.max(high[i], seen[i]);
        }
      }
    }
    const margins = [24, this.height < 380 ? 34 : 46];
    this.scaleTo = Math.min((this.width - 2 * margins[0]) / (high[0] - low[0]),
      (this.height - 2 * margins[1]) / (high[1] - low[1]));
    this.middle = [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2];
  }

  // The frame of a part as the eye sees it: origin and axes.
  #placed({origin, axes}) {
    const see = p => this.eye.map(row => row[0] * p[0] + row[1] * p[1] + row[2] * p[2]);
    return {origin: see(origin), axes: axes.map(see)};
  }

  #seen({origin: o, axes: [a, b, c]}, p) {
    return [o[0] + a[0] * p[0] + b[0] * p[1] + c[0] * p[2],
      o[1] + a[1] * p[0] + b[1] * p[1] + c[1] * p[2],
      o[2] + a[2] * p[0] + b[2] * p[1] + c[2] * p[2]];
  }

  #x(seen) { return this.width / 2 + (seen[0] - this.middle[0]) * this.scaleTo; }

  #y(seen) { return this.height / 2 - (seen[1] - this.middle[1]) * this.scaleTo; }

  // A point of the world on the canvas.
  #onCanvas(point) {
    const seen = this.#placed({origin: point, axes: []}).origin;
    return [this.#x(seen), this.#y(seen)];
  }

  #paint() {
    const {context, mechanism, powers} = this;
    const angles = mechanism.angles(...this.shown);
    const contacts = Object.fromEntries(Object.entries(mechanism.contacts(angles)).map(
      ([mesh, points]) => [mesh, points.map(p => this.#placed({origin: p, axes: []}).origin)]));
    const faces = [];
    for (const part of mechanism.parts) this.#see(part, angles, contacts, faces);
    faces.sort((one, other) => one.depth - other.depth);
    context.setTransform(this.dense, 0, 0, this.dense, 0, 0);
    context.clearRect(0, 0, this.width, this.height);
    context.lineJoin = 'round';
    context.lineWidth = 0.7;
    for (const {points, colour, edge} of faces) {
      context.fillStyle = colour;
      context.strokeStyle = edge;
      context.beginPath();
      points.forEach((seen, i) => {
        if (i) context.lineTo(this.#x(seen), this.#y(seen));
        else context.moveTo(this.#x(seen), this.#y(seen));
      });
      context.closePath();
      context.fill();
      context.stroke();
    }
    for (const path of mechanism.paths) this.#arrows(path, powers);
    this.#lead();
  }

  // Add the faces of a part that the eye sees.
  #see({solid, shaft, meshes, clutch, frame}, angles, contacts, faces) {
    const place = this.#placed(frame(angles)), [a, b, c] = place.axes;
    const points = solid.points.map(p => this.#seen(place, p));
    const index = role(this.mechanism.shafts, shaft);
    for (const {corners, centre, normal, part} of solid.faces) {
      const n = [0, 1, 2].map(i => a[i] * normal[0] + b[i] * normal[1] + c[i] * normal[2]);
      if (n[2] <= 0.001) continue;
      const at = this.#seen(place, centre);
      const light = Math.max(0, n[0] * LIGHT[0] + n[1] * LIGHT[1] + n[2] * LIGHT[2]);
      const shade = Math.round((0.5 + 0.5 * light) * SHADES) / SHADES;
      const base = this.#base(index, part, clutch, meshes, at, contacts);
      faces.push({points: corners.map(i => points[i]), depth: at[2],
        ...this.colours.lit(base, shade)});
    }
  }

  // The colour of a face: of its shaft, of the heat of its clutch, of the power of its mesh.
  #base(index, part, clutch, meshes, at, contacts) {
    const {powers, colours} = this;
    let base = colours.shafts[index];
    if (part === 'mark') base = colours.mark;
    else if (part === 'root') base = blend(base, colours.dark, 0.25);
    if (clutch) {
      const share = Math.abs(powers.clutches[clutch] || 0) / powers.most.heat;
      return part === 'mark' ? base
        : blend(blend(base, colours.plain, 0.5), colours.heat(share), Math.min(1, share / FAINT));
    }
    for (const mesh of meshes) {
      const share = Math.abs(powers.meshes[mesh] || 0) / powers.most.power;
      if (share < 0.003) continue;
      let near = Infinity;
      for (const p of contacts[mesh]) {
        near = Math.min(near, (p[0] - at[0]) ** 2 + (p[1] - at[1]) ** 2 + (p[2] - at[2]) ** 2);
      }
      const weight = Math.exp(-near / GLOW ** 2 * 2);
      if (weight > 0.03) {
        base = blend(base, colours.power(share), Math.min(1, 1.4 * weight, share / FAINT));
      }
    }
    return base;
  }

  // Arrows along a path, in the direction in which power goes.
  #arrows({shaft, from, to}, {shafts, most}) {
    const power = shafts[shaft] || 0, share = Math.min(1, Math.abs(power) / most.power);
    if (share < 0.01) return;
    const ends = [from, to].map(p => this.#onCanvas(p));
    const [[x0, y0], [x1, y1]] = power > 0 ? ends : [ends[1], ends[0]];
    const size = 5 + 6 * Math.sqrt(share);
    const {context} = this;
    context.fillStyle = this.colours.css(this.colours.power(share));
    context.strokeStyle = this.colours.css(this.colours.paper);
    for (let n = 0; n < CHEVRONS; n++) {
      const along = (n / CHEVRONS + 0.9 * this.flow) % 1;
      chevron(context, [x0, y0], [x1, y1], along, size);
    }
  }

  // Thin lines from the labels to their shafts.
  #lead() {
    const {context} = this;
    context.lineWidth = 1;
    for (const [shaft, [left, top, right, bottom]] of Object.entries(this.labels)) {
      const [u, v] = this.#onCanvas(this.mechanism.anchors[shaft]);
      const x = Math.min(Math.max(u, left), right), y = Math.min(Math.max(v, top), bottom);
      context.strokeStyle = this.colours.lines[role(this.mechanism.shafts, shaft)];
      context.beginPath();
      context.moveTo(x, y);
      context.lineTo(u, v);
      context.stroke();
      context.beginPath();
      context.arc(u, v, 2.5, 0, 2 * Math.PI);
      context.fillStyle = context.strokeStyle;
      context.fill();
    }
  }
}
