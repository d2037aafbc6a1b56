// Copyright 2026 dm_ros developers
// SPDX-License-Identifier: Apache-2.0

// The parts of a differential: what they are made of, and where they are when it has turned.
//
// x points along the axle to the second output, y forward, z up. A wheel that rolls forward turns
// about -x. All follows from the angles of the carrier and of a satellite against it by the whole
// tooth numbers that are drawn, so that teeth mesh at every moment.

import {bar, gear, ring} from './solids.js';

const SHAFT = 0.19, CASE = 0.42, PLATE = 0.055, PITCH = 0.115, PINION_LENGTH = 1.15;
const X = [1, 0, 0], Y = [0, 1, 0], Z = [0, 0, 1];

const sum = (p, q, k = 1) => p.map((x, i) => x + k * q[i]);
const times = (k, p) => p.map(x => k * x);
const unit = (a, r) => [a / Math.hypot(a, r), r / Math.hypot(a, r)];

// A frame about x, from y to z, turned by an angle; the carrier's are turned by -angle.
const about = angle => {
  const c = Math.cos(angle), s = Math.sin(angle);
  return {origin: [0, 0, 0], axes: [X, [0, c, s], [0, -s, c]]};
};
// A frame whose axis points from the axle outwards at an angle, turned by a spin about it.
const outwards = (angle, spin, distance = 0) => {
  const radial = [0, Math.cos(angle), Math.sin(angle)];
  const back = [0, Math.sin(angle), -Math.cos(angle)];
  const c = Math.cos(spin), s = Math.sin(spin);
  return {origin: times(distance, radial),
    axes: [radial, sum(times(c, X), back, s), sum(times(-s, X), back, c)]};
};
const alongY = spin => {
  const c = Math.cos(spin), s = Math.sin(spin);
  return {origin: [0, 0, 0], axes: [Y, [c, 0, -s], [-s, 0, -c]]};
};
const besideAxle = (angle, distance) => ({...about(angle),
  origin: [0, distance * Math.cos(angle), distance * Math.sin(angle)]});

export class Mechanism {
  // gears: as the server describes them; shafts: all names, the carrier and the outputs first
  constructor({crowns, satellite, count, drive, plates, plate_radii: radii, bevel}, scene) {
    const module = 2 / Math.max(...crowns);   // the larger crown gear has the radius 1
    this.numbers = {crowns, satellite, drive};
    this.crowns = crowns.map(n => n * module / 2);
    this.satellite = satellite * module / 2;
    this.azimuths = Array.from({length: count}, (_, i) => Math.PI / 2 + 2 * Math.PI * i / count);
    this.shafts = scene.shafts;
    this.meshes = Object.keys(scene.meshes);
    this.clutches = Object.keys(scene.clutches);
    this.case = 1 + CASE;
    this.parts = [];      // {solid, shaft, meshes, clutch, frame: function of the angles}
    this.paths = [];      // {shaft, from, to}: along which power comes in
    this.anchors = {};    // {shaft: point} to which its label leads
    this.side = drive ? drive.side : 1;
    this.ends = [0, 1].map(k => this.satellite + 0.4 + PITCH * plates[k]);
    // radii of ring gear and pinion
    if (drive) this.drive = {radius: 2, pinion: 2 * drive.pinion / drive.ring};
    const [, first, second] = this.shafts;
    this.phase = (this.azimuths[0] * (crowns[0] + crowns[1]) - Math.PI * satellite) / crowns[0];
    [first, second].forEach((shaft, k) => this.#output(shaft, k, plates[k], radii[k], bevel));
    this.#satellites(bevel);
    this.#carrier(plates, radii);
    if (drive) this.#pinion();
  }

  // The angles of all parts when carrier and satellite have turned so far, rad.
  angles(carrier, satellite) {
    const {crowns, satellite: teeth, drive} = this.numbers;
    const relative = crowns.map((n, k) => (k ? 1 : -1) * satellite * teeth / n);
    return {carrier, satellite, outputs: relative.map(angle => carrier + angle),
      pinion: drive ? drive.side * carrier * drive.ring / drive.pinion : 0};
  }

  // Where the teeth of a mesh touch, by the name of the mesh.
  contacts(angles) {
    const result = {};
    const touching = this.meshes.slice(-2);
    touching.forEach((mesh, k) => {
      result[mesh] = this.azimuths.map(azimuth => {
        const {axes: [radial]} = outwards(azimuth - angles.carrier, 0);
        return sum(times(this.crowns[k], radial), X, (k ? 1 : -1) * this.satellite);
      });
    });
    if (this.drive) result[this.meshes[0]] = [
      [this.side * this.drive.pinion, this.drive.radius, 0]];
    return result;
  }

  #add(solid, shaft, frame, {meshes = [], clutch = null} = {}) {
    this.parts.push({solid, shaft, frame, meshes, clutch});
  }

  #output(shaft, k, plates, radius, bevel) {
    const way = k ? 1 : -1, face = this.satellite, r = this.crowns[k];
    const frame = angles => about((k ? 0 : this.phase) - angles.outputs[k]);
    const wheel = bevel
      ? {outer: [way * face, r], inner: [way * 0.58 * face, 0.58 * r],
        tip: unit(-way * r, face), rim: [way * (face + 0.2), 0.95 * r],
        hub: [way * (face + 0.3), SHAFT], core: [way * 0.62 * face, SHAFT]}
      : {outer: [way * face, r + 0.15], inner: [way * face, r - 0.15], tip: [-way, 0],
        rim: [way * (face + 0.22), r + 0.15], hub: [way * (face + 0.22), SHAFT],
        core: [way * (face + 0.16), SHAFT]};
    const mesh = this.meshes.slice(-2)[k];
    this.#add(gear(this.numbers.crowns[k], wheel), shaft, frame, {meshes: [mesh]});
    const reach = this.drive ? Math.max(...this.ends, this.drive.pinion + 0.3) : this.ends[k];
    const end = reach + 0.95;
    this.#add(bar(SHAFT, way * (face + 0.2), way * end, {pieces: 10}), shaft, frame);
    this.#add(ring(SHAFT, 0.5, way * end, way * (end + 0.12), {marks: 1}), shaft, frame);
    const size = Math.min(1.15, Math.max(0.6, radius));
    for (let n = 0; n < plates; n += 2) {
      const a = way * (face + 0.34 + PITCH * n);
      this.#add(ring(SHAFT, size, a, a + way * PLATE), shaft, frame, {clutch: this.clutches[k]});
    }
    this.paths.push({shaft, from: [way * (end + 0.05), 0, 0], to: [way * (reach + 0.05), 0, 0]});
    this.anchors[shaft] = [way * (end + 0.12), 0, -0.5];
  }

  #satellites(bevel) {
    const {crowns: [, teeth], satellite} = this.numbers, r = this.satellite;
    const low = Math.min(...this.crowns) - 0.16, high = Math.max(...this.crowns) + 0.16;
    const wheel = bevel
      ? {outer: [1, r], inner: [0.58, 0.58 * r], tip: unit(-r, 1), rim: [1.14, 0.9 * r],
        hub: [1.18, 0.08], core: [0.6, 0.08]}
      : {outer: [high, r], inner: [low, r], tip: [0, 1], rim: [high, 0.5 * r],
        hub: [high, 0.08], core: [low, 0.08]};
    const shaft = this.shafts.at(-1), solid = gear(satellite, wheel);
    for (const azimuth of this.azimuths) {
      const phase = (azimuth * teeth - Math.PI) / satellite;
      this.#add(solid, shaft,
        angles => outwards(azimuth - angles.carrier, angles.satellite + phase),
        {meshes: this.meshes.slice(-2)});
    }
    const middle = (this.crowns[0] + this.crowns[1]) / 2;
    this.anchors[shaft] = [0, 0, middle + 0.1];
  }

  #carrier(plates, radii) {
    const carrier = this.shafts[0], frame = angles => about(-angles.carrier);
    const pin = bar(0.1, 0.1, this.case, {sides: 8, pieces: 3, stripe: false});
    for (const azimuth of this.azimuths) {
      this.#add(pin, carrier, angles => outwards(azimuth - angles.carrier, 0));
    }
    const reach = [0, 1].map(k => plates[k] ? this.ends[k] : 0.1);
    if (this.drive) {
      this.#add(ring(this.case, this.case + 0.1, -0.07, 0.07, {sectors: 36}), carrier, frame);
    } else {   // a wheel by which it is driven
      this.#add(gear(52, {outer: [0.12, this.case + 0.22], inner: [-0.12, this.case + 0.22],
        tip: [0, 1], rim: [0.12, this.case + 0.05], hub: [0.12, this.case + 0.05],
        core: [-0.12, this.case + 0.05]}), carrier, frame);
      const [far, near] = [1.1, 0.35].map(beyond => this.#onRim(this.case + beyond));
      this.paths.push({shaft: carrier, from: far, to: near});
    }
    [0, 1].forEach(k => {
      const way = k ? 1 : -1, size = Math.min(1.15, Math.max(0.6, radii[k])) + 0.14;
      for (let n = 1; n < plates[k]; n += 2) {
        const a = way * (this.satellite + 0.34 + PITCH * n);
        this.#add(ring(0.3, size, a, a + way * PLATE), carrier, frame,
          {clutch: this.clutches[k]});
      }
      if (plates[k]) this.#add(ring(this.case - 0.16, this.case + 0.06, way * this.ends[k],
        way * (this.ends[k] + 0.08), {sectors: 36}), carrier, frame);
    });
    const side = this.side;
    if (this.drive) {
      const k = side > 0 ? 1 : 0;
      reach[k] = Math.max(reach[k], this.drive.pinion + 0.2);
    }
    const bars = bar(0.065, -reach[0], reach[1], {sides: 6, pieces: 8, stripe: false});
    const spokes = this.drive && bar(0.075, this.case - 0.08, this.drive.radius - 0.25,
      {sides: 6, stripe: false});
    for (let n = 0; n < 4; n++) {
      const azimuth = this.azimuths[0] + Math.PI / 4 + n * Math.PI / 2;
      this.#add(bars, carrier, angles => besideAxle(azimuth - angles.carrier, this.case));
      if (spokes) this.#add(spokes, carrier, angles => {
        const at = outwards(azimuth - angles.carrier, 0);
        return {...at, origin: [side * (this.drive.pinion + 0.2), 0, 0]};
      });
    }
    this.anchors[carrier] = this.drive
      ? [side * this.drive.pinion, 0, this.drive.radius + 0.1] : this.#onRim(this.case + 0.3);
  }

  // A point beside the wheel that drives the carrier, above and behind.
  #onRim(radius) {
    return [0, radius * Math.cos(1.0), radius * Math.sin(1.0)];
  }

  #pinion() {
    const {radius, pinion} = this.drive, side = this.side;
    const numbers = this.numbers.drive, inner = 0.8;
    this.#add(gear(numbers.ring, {
      outer: [side * pinion, radius], inner: [side * inner * pinion, inner * radius],
      tip: unit(-side * radius, pinion), rim: [side * (pinion + 0.16), radius],
      hub: [side * (pinion + 0.16), inner * radius - 0.06],
      core: [side * (pinion + 0.1), inner * radius - 0.06]}),
    this.shafts[0], angles => {
      const contact = side > 0 ? -Math.PI / numbers.ring
        : Math.PI * (1 - numbers.pinion) / numbers.ring;
      return about(contact - angles.carrier);
    }, {meshes: [this.meshes[0]]});
    const shaft = this.shafts[3], frame = angles => alongY(angles.pinion);
    this.#add(gear(numbers.pinion, {
      outer: [radius, pinion], inner: [inner * radius, inner * pinion],
      tip: unit(-pinion, radius), rim: [radius + 0.12, 0.9 * pinion],
      hub: [radius + 0.16, SHAFT], core: [inner * radius + 0.05, 0.1]}),
    shaft, frame, {meshes: [this.meshes[0]]});
    const end = radius + PINION_LENGTH;
    this.#add(bar(SHAFT, radius + 0.1, end, {pieces: 6}), shaft, frame);
    this.#add(ring(SHAFT, 0.42, end, end + 0.12, {marks: 1}), shaft, frame);
    this.paths.push({shaft, from: [0, end, 0], to: [0, radius + 0.25, 0]});
    this.anchors[shaft] = [0, end + 0.1, 0.42];
  }
}
