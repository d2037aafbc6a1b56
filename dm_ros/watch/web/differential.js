// Copyright 2026 dm_ros developers
// SPDX-License-Identifier: Apache-2.0

// A node differential as the page shows it: its gears, the labels of its shafts, its powers.

import {Drawing} from './drawing.js';
import {Labels, Legend, Most, numbersOf, powersOf} from './panels.js';

const $ = id => document.getElementById(id);

export class DifferentialView {
  constructor() {
    this.drawing = new Drawing($('drawing'));
    this.labels = new Labels($('labels'));
    this.legend = new Legend($('legend'));
    this.drawing.onResize = () => {
      this.drawing.labels = this.labels.boxes($('drawing').getBoundingClientRect());
    };
    this.scene = null;
  }

  get colours() { return this.drawing.colours; }

  // Show a node, or none.
  show(scene) {
    this.scene = scene;
    this.newest = null;   // what was told, and its powers
    this.most = {power: new Most(), heat: new Most()};
    $('drawing').hidden = !scene;
    this.drawing.show(scene);
    this.labels.show(scene, this.colours);
    this.drawing.onResize();
    this.legend.show(scene, this.colours);
  }

  title({variant, rate, mode, law}) { return `${variant}, ${rate} Hz, ${mode}, ${law} law of losses`; }

  note({gears, 'not drawn': refusal}) {
    return !gears ? `not drawn: ${refusal}`
      : gears.exact ? '' : 'ratios and numbers of gears are drawn near the true ones';
  }

  // The numbers of all series of the strips, in their order.
  numbers(now) { return numbersOf(this.scene, now); }

  // Take the newest tick.
  tell(now, seconds) {
    const {scene, most} = this, powers = powersOf(scene, now);
    this.labels.tell(now);
    this.drawing.turn(now.travel, Math.max(...now.velocity.map(Math.abs)), seconds);
    const {meshes, clutches, shafts} = powers;
    powers.most = {
      power: most.power.of(Object.values(meshes).concat(Object.values(shafts)), seconds),
      heat: most.heat.of(Object.values(clutches), seconds)};
    this.newest = {now, powers};
    this.drawing.colour(powers);
    this.legend.tell(powers);
  }

  // By how much slower than true it turns, where it is drawn.
  get scale() { return this.scene?.gears ? this.drawing.scale : null; }

  frame(dt) { this.drawing.frame(dt); }

  recolour() {
    this.labels.show(this.scene, this.colours);
    this.legend.show(this.scene, this.colours);
    if (!this.newest) return;
    this.labels.tell(this.newest.now);
    this.legend.tell(this.newest.powers);
  }
}
