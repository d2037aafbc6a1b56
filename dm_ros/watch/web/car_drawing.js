// Copyright 2026 dm_ros developers
// SPDX-License-Identifier: Apache-2.0

// The drawing of a car from above, nose up: the ground goes by below it, forces are where they act.
//
// In the car x points forward and y to the left, m; on the canvas that is up and left.

import {blend, Colours} from './colours.js';
import {chevron, scaleFor} from './drawing.js';
import {fixed} from './words.js';

const LAG = 0.07;               // s, of each of two lags that make steps even
const MEMORY = 8;               // s for which the drawing stays as slow
const LEAP = 20;                // m that no car goes between two events: it was put there
const FASTER = 2;               // than the gears of a differential are drawn
const GRID = 2;                 // m, of the ground
const NOSE = 0.8, TAIL = 0.75;  // m before the front axle and behind the rear one
const TYRE = 0.23;              // m, its width
const TREADS = 0.16;            // m from bar to bar
const HALF = 0.75;              // m, which a quarter of the weight is as a force
const TOP = 66, BOTTOM = 34;    // px above and below the car
const BESIDE = 131;             // px that labels need on either side
const SMALL = 55;               // px of a metre, below which numbers have no room in the car
const CASE = 0.14;              // m, radius of a differential
const BETWEEN = 28;             // px from one arrow of power to the next
const FAINT = 0.01;             // share of the most below which no power is drawn

export class CarDrawing {
  constructor(canvas) {
    this.canvas = canvas;
    this.context = canvas.getContext('2d');
    this.onResize = () => {};
    this.scene = null;
    this.#colour();
    new ResizeObserver(() => this.#resize()).observe(canvas);
    matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => this.#colour());
  }

  #colour() {
    this.colours = new Colours();
    const style = getComputedStyle(document.documentElement);
    this.force = style.getPropertyValue('--force').trim();
    this.changed = true;
  }

  // Draw the car of another node, or none.
  show(scene) {
    this.scene = scene;
    this.now = this.before = null;
    // what is drawn of place and yaw on the ground and of the turning of wheels, and what is to come
    this.shown = [0, 0, 0, 0, 0, 0, 0];
    this.pending = [0, 1].map(() => this.shown.map(() => 0));
    this.speeds = [];   // [s, rad/s], the fastest
    this.scale = scene ? 1 : null;
    this.flow = 0;
    if (scene) this.#lay(scene);
    this.#resize();
  }

  // Take a tick; most: power, W, that is expected.
  turn(now, most, seconds) {
    const {before} = this, last = now.pose.concat(now.travel);
    this.speeds = this.speeds.filter(([time]) => time > seconds - MEMORY);
    this.speeds.push([seconds, Math.max(...now.velocity.map(Math.abs))]);
    this.scale = scaleFor(Math.max(...this.speeds.map(([, fastest]) => fastest)) / FASTER);
    if (!before) this.shown[2] = now.pose[2];
    else if (Math.hypot(last[0] - before[0], last[1] - before[1]) < LEAP) {
      last.forEach((value, i) => {   // the way on the ground is slower, its direction is true
        const more = value - before[i];
        this.pending[0][i] += i === 2 ? more - 2 * Math.PI * Math.round(more / (2 * Math.PI))
          : more * this.scale;
      });
    }
    this.before = last;
    this.now = now;
    this.most = most;
    this.changed = true;
  }

  // Draw, dt s after the last time, where there is anything new.
  frame(dt) {
    if (!this.scene || !this.width) return;
    const share = 1 - Math.exp(-dt / LAG);
    let turned = 0;
    this.shown.forEach((_, i) => {
      const first = this.pending[0][i] * share, second = this.pending[1][i] * share;
      this.pending[0][i] -= first;
      this.pending[1][i] += first - second;
      this.shown[i] += second;
      turned += Math.abs(second);
    });
    if (turned < 1e-6 && !this.changed) return;
    this.flow += Math.min(dt, 0.1) * (turned > 1e-6 ? 1 : 0);
    this.changed = false;
    this.#paint();
  }

  // Where the middle of a wheel is from the top of the canvas, px.
  heightOf(wheel) { return this.width ? this.#at(...this.scene.places[wheel])[1] : 0; }

  #resize() {
    const {clientWidth: width, clientHeight: height} = this.canvas;
    if (!width || !this.scene) return;
    const dense = Math.min(window.devicePixelRatio || 1, 2), {front, rear, track} = this.scene;
    this.canvas.width = width * dense;
    this.canvas.height = height * dense;
    [this.width, this.height, this.dense] = [width, height, dense];
    const long = front + rear + NOSE + TAIL, room = height - TOP - BOTTOM;
    this.size = Math.min(room / long, (width - 2 * BESIDE) / (track + TYRE));   // px of a metre
    this.middle = [width / 2, TOP + (room - long * this.size) / 2 + (front + NOSE) * this.size];
    this.onResize();
    this.changed = true;
  }

  #at(x, y) { return [this.middle[0] - y * this.size, this.middle[1] - x * this.size]; }

  // Lay out what carries power: {from, to, of: [differential, number of its power]}.
  #lay({differentials, places, front, rear}) {
    const names = differentials.map(({name}) => name), [{name: first}] = differentials;
    const at = {centre: [0, 0], front: [front, 0], rear: [-rear, 0]};
    this.cases = names.map(name => at[name]);
    const way = first === 'front' ? 1 : -1;   // from the gearbox of a car with one driven axle
    this.gearbox = first === 'centre' ? [0, 0.56] : [at[first][0] - way * 0.95, 0];
    const [x, y] = at[first], [u, v] = this.gearbox;
    this.ways = [{from: [u, v - Math.sign(v) * 0.1], of: [0, 0],
      to: v ? [x, CASE] : [x - way * CASE, y]}];
    names.forEach((name, d) => {
      if (name === 'centre') {
        for (const [k, axle] of [[1, 'front'], [2, 'rear']]) {
          const side = k === 1 ? 1 : -1;
          this.ways.push({from: [side * CASE, 0], to: [at[axle][0] - side * CASE, 0], of: [d, k]});
        }
      } else {
        for (const [k, n] of [[1, name === 'front' ? 0 : 2], [2, name === 'front' ? 1 : 3]]) {
          const side = Math.sign(places[n][1]), [a, b] = places[n];
          this.ways.push({from: [a, side * CASE], to: [a, b - side * TYRE / 2], of: [d, k]});
        }
      }
    });
  }

  #paint() {
    const {context} = this;
    context.setTransform(this.dense, 0, 0, this.dense, 0, 0);
    context.clearRect(0, 0, this.width, this.height);
    context.lineJoin = 'round';
    this.#ground();
    this.#body();
    for (const way of this.ways) this.#way(way);
    this.#boxes();
    this.scene.places.forEach((_, i) => this.#wheel(i));
    if (!this.now) return;
    this.scene.places.forEach((_, i) => this.#circle(i));
    this.scene.places.forEach((_, i) => this.#force(i));
    if (this.size > SMALL) for (const way of this.ways) this.#watts(way);
    if (this.scene.planar) this.#compass();
  }

  #line(...points) {
    const {context} = this;
    context.beginPath();
    points.forEach(([x, y], i) => (i ? context.lineTo(x, y) : context.moveTo(x, y)));
    context.stroke();
  }

  // The grid of the ground, which goes by and turns.
  #ground() {
    const {context, shown: [x, y, yaw], size} = this;
    const [c, s] = [Math.cos(yaw), Math.sin(yaw)];
    const reach = Math.hypot(this.width, this.height) / size;
    // a point of the ground on the canvas
    const seen = (u, v) => this.#at(c * (u - x) + s * (v - y), -s * (u - x) + c * (v - y));
    context.strokeStyle = this.colours.grid;
    context.lineWidth = 1;
    for (let u = GRID * Math.ceil((x - reach) / GRID); u < x + reach; u += GRID) {
      this.#line(seen(u, y - reach), seen(u, y + reach));
    }
    for (let v = GRID * Math.ceil((y - reach) / GRID); v < y + reach; v += GRID) {
      this.#line(seen(x - reach, v), seen(x + reach, v));
    }
  }

  #body() {
    const {context, colours} = this, {front, rear, track} = this.scene;
    const half = track / 2 + 0.06, [left, top] = this.#at(front + NOSE, half);
    const [right, bottom] = this.#at(-rear - TAIL, -half), round = 0.42 * this.size;
    context.fillStyle = colours.css(blend(colours.plain, colours.paper, 0.72));
    context.strokeStyle = colours.css(blend(colours.plain, colours.dark, 0.15));
    context.lineWidth = 1.5;
    context.beginPath();
    context.roundRect(left, top, right - left, bottom - top, [round, round, 0.6 * round, 0.6 * round]);
    context.fill();
    context.stroke();
    context.lineWidth = 1;
    const glass = (x, wide, narrow, depth) => {   // a window across
      const corners = [this.#at(x, wide), this.#at(x, -wide), this.#at(x - depth, -narrow),
        this.#at(x - depth, narrow)];
      context.fillStyle = colours.css(blend(colours.plain, colours.paper, 0.45));
      context.beginPath();
      corners.forEach(([u, v], i) => (i ? context.lineTo(u, v) : context.moveTo(u, v)));
      context.closePath();
      context.fill();
    };
    glass(0.42 * front + 0.12, 0.82 * half, 0.68 * half, 0.36);
    glass(-0.62 * rear - 0.2, 0.82 * half, 0.68 * half, -0.26);
  }

  #power({of: [d, k]}) { return this.now ? this.now.power[d][k] : 0; }

  // A shaft, as wide and coloured as its power, with arrows in the direction in which this goes.
  #way(way) {
    const {context, colours} = this, watts = this.#power(way);
    const share = Math.min(1, Math.abs(watts) / (this.most || 1));
    const ends = [this.#at(...way.from), this.#at(...way.to)];
    const [[x0, y0], [x1, y1]] = watts < 0 ? ends.reverse() : ends;
    const shines = share > FAINT;
    context.lineWidth = 4 + 5 * Math.sqrt(shines ? share : 0);
    context.strokeStyle = colours.css(shines ? blend(colours.plain, colours.power(share), 0.55)
      : blend(colours.plain, colours.dark, 0.25));
    this.#line([x0, y0], [x1, y1]);
    if (!shines) return;
    const size = 4.5 + 4 * Math.sqrt(share);
    context.fillStyle = colours.css(colours.power(share));
    context.strokeStyle = colours.css(colours.paper);
    const long = Math.hypot(x1 - x0, y1 - y0), count = Math.max(1, Math.round(long / BETWEEN));
    for (let n = 0; n < count; n++) {
      chevron(context, [x0, y0], [x1, y1], (n + 1.6 * this.flow) / count % 1, size);
    }
  }

  // The number of a power beside its shaft.
  #watts(way) {
    const [x0, y0] = this.#at(...way.from), [x1, y1] = this.#at(...way.to);
    const across = Math.abs(x1 - x0) > Math.abs(y1 - y0), [x, y] = [(x0 + x1) / 2, (y0 + y1) / 2];
    this.#text(`${fixed(Math.abs(this.#power(way)) / 1000, 1)} kW`, across ? x : x + 9,
      across ? y - 13 : y, across ? 'center' : 'left');
  }

  #text(text, x, y, align, font = '11px', colour = this.colours.ink) {
    const {context, colours} = this;
    context.font = `${font} system-ui, "DejaVu Sans", sans-serif`;
    context.textAlign = align;
    context.textBaseline = 'middle';
    context.lineWidth = 3;
    context.strokeStyle = colours.css(colours.paper);
    context.fillStyle = colours.css(colour);
    context.strokeText(text, x, y);
    context.fillText(text, x, y);
  }

  // The gearbox and the differentials, with their index.
  #boxes() {
    const {context, colours} = this, [x, y] = this.#at(...this.gearbox), side = 0.13 * this.size;
    context.lineWidth = 1.5;
    context.strokeStyle = colours.css(colours.dark);
    context.fillStyle = colours.css(colours.plain);
    context.beginPath();
    context.roundRect(x - side, y - side, 2 * side, 2 * side, 3);
    context.fill();
    context.stroke();
    this.#text('input', x, y + side + 9, 'center');
    this.cases.forEach((place, i) => {
      const [u, v] = this.#at(...place), index = this.now?.flow[i];
      context.lineWidth = 1.5;
      context.strokeStyle = colours.css(colours.dark);
      context.fillStyle = colours.css(colours.plain);
      context.beginPath();
      context.arc(u, v, CASE * this.size, 0, 2 * Math.PI);
      context.fill();
      context.stroke();
      if (!index) return;
      context.fillStyle = colours.css(colours.mark);
      context.font = 'bold 10px system-ui, "DejaVu Sans", sans-serif';
      context.textAlign = 'center';
      context.textBaseline = 'middle';
      context.fillText(index > 0 ? '+1' : '\u22121', u, v);
    });
  }

  // Go to the middle of a wheel, turned as it is; x of the context is then to the right.
  #atWheel(i, draw) {
    const {context} = this;
    context.save();
    context.translate(...this.#at(...this.scene.places[i]));
    context.rotate(-(this.now?.steer[i] ?? 0));
    draw(context);
    context.restore();
  }

  // A tyre, the redder the more of its grip it uses, and its tread, which goes forward below.
  #wheel(i) {
    const {colours, size} = this, R = this.scene.radius;
    const used = this.now?.used[i] ?? 0, wide = TYRE * size, long = 2 * R * size;
    this.#atWheel(i, context => {
      context.fillStyle = colours.css(blend(
        colours.dark, colours.heat(1), Math.min(1, Math.max(0, (used - 0.5) / 0.5))));
      context.beginPath();
      context.roundRect(-wide / 2, -long / 2, wide, long, 0.06 * size);
      context.fill();
      context.clip();
      context.strokeStyle = colours.css(blend(colours.dark, colours.plain, 0.6));
      context.lineWidth = 1.5;
      // what is seen from above of a wheel that rolls forward goes forward, up the canvas
      const along = -(this.shown[3 + i] * R) % TREADS;
      for (let x = -R - 2 * TREADS; x < R + 2 * TREADS; x += TREADS) {
        context.beginPath();
        context.moveTo(-wide / 2, (x + along) * size);
        context.lineTo(wide / 2, (x + along) * size);
        context.stroke();
      }
    });
  }

  // px of a newton
  get #newton() { return HALF * this.size / (this.scene.weight / 4); }

  // How far a force can go: what load and grip allow, or the load where the grip is not known.
  #circle(i) {
    const {context, colours} = this, grip = this.now.grip[i];
    context.strokeStyle = colours.css(blend(colours.ink, colours.plain, 0.35));
    context.lineWidth = 1;
    context.setLineDash(grip === null ? [1, 4] : [4, 3]);
    context.beginPath();
    context.arc(...this.#at(...this.scene.places[i]),
      (grip ?? 1) * this.now.load[i] * this.#newton, 0, 2 * Math.PI);
    context.stroke();
    context.setLineDash([]);
  }

  // The force of the road on a wheel, from where it acts.
  #force(i) {
    const [F_x, F_y] = this.now.force[i], long = Math.hypot(F_x, F_y) * this.#newton;
    if (long < 2) return;
    this.#atWheel(i, context => {
      context.rotate(Math.atan2(-F_x, -F_y));
      const head = Math.min(10, 0.6 * long), wide = 0.5 * head;
      context.beginPath();
      context.moveTo(0, -1.6);
      context.lineTo(long - head, -1.6);
      context.lineTo(long - head, -wide);
      context.lineTo(long, 0);
      context.lineTo(long - head, wide);
      context.lineTo(long - head, 1.6);
      context.lineTo(0, 1.6);
      context.closePath();
      context.strokeStyle = this.colours.css(this.colours.paper);
      context.lineWidth = 2.5;
      context.stroke();
      context.fillStyle = this.force;
      context.fill();
    });
  }

  // Where x of the ground points as seen from the car: yaw turns it the other way.
  #compass() {
    const {context, colours} = this, [x, y, r] = [42, 40, 24], yaw = this.shown[2];
    context.strokeStyle = context.fillStyle = this.colours.text;
    context.lineWidth = 1;
    context.beginPath();
    context.arc(x, y, r, 0, 2 * Math.PI);
    context.stroke();
    this.#line([x, y - r - 4], [x, y - r + 4]);   // the nose
    context.save();
    context.translate(x, y);
    context.rotate(yaw);
    context.beginPath();
    context.moveTo(0, -r + 3);
    context.lineTo(5, 8);
    context.lineTo(0, 4);
    context.lineTo(-5, 8);
    context.closePath();
    context.fill();
    context.restore();
    this.#text('x', x + (r + 9) * Math.sin(yaw), y - (r + 9) * Math.cos(yaw), 'center', '10px',
      colours.ink);
  }
}
