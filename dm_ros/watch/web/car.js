// Copyright 2026 dm_ros developers
// SPDX-License-Identifier: Apache-2.0

// A node driveline as the page shows it: the car from above, what each wheel does, its powers.

import {CarDrawing} from './car_drawing.js';
import {Most} from './panels.js';
import {fixed, make, number, power, words} from './words.js';

const $ = id => document.getElementById(id), NOTHING = '\u2013';
const INDEX = {1: '+1', [-1]: '\u22121'};
const DEGREES = 180 / Math.PI;

// What stands for the names of wheels where there is little room: FL, FR, RL, RR.
function shortOf({wheels}) {
  const letters = wheel => wheel.split('_').map(word => word[0].toUpperCase()).join('');
  return Object.fromEntries(wheels.flatMap(
    wheel => [[wheel, letters(wheel)], [`${wheel}_half`, letters(wheel)]]));
}

// Which of the colours of the page each line of the strips has.
function coloursOf({wheels}) {
  const result = {forward: 1, sideways: 4, yaw_rate: 3, input: 0};
  wheels.forEach((wheel, i) => {
    result[wheel] = [1, 2, 4, 3][i];
    result[`${wheel}_half`] = result[wheel];
  });
  return {...result, front_propeller: 1, rear_propeller: 4};
}

export class CarView {
  constructor() {
    this.drawing = new CarDrawing($('car'));
    this.drawing.onResize = () => this.#place();
    this.scene = null;
  }

  get colours() { return this.drawing.colours; }

  // Show a node, or none.
  show(scene) {
    this.scene = scene;
    this.newest = null;
    this.most = new Most();
    if (scene) Object.assign(scene, {colours: coloursOf(scene), short: shortOf(scene)});
    for (const id of ['car', 'wheels', 'flows']) $(id).hidden = !scene;
    this.drawing.show(scene);
    this.#labels();
    this.#flows();
  }

  title({layout, planar, rate, mode}) {
    return `${layout}${planar ? ' planar' : ''}, ${rate} Hz, ${mode}`;
  }

  note() { return ''; }

  // The numbers of all series of the strips, in their order.
  numbers(now) {
    const {scene} = this, [v_x, v_y, r] = now.twist;
    const by = {forward: v_x, sideways: v_y, yaw_rate: r};
    scene.connections.forEach((name, i) => { by[name] = now.torque[i]; });
    scene.wheels.forEach((name, i) => { by[name] = now.velocity[i]; });
    return scene.strips.flatMap(({series}) => series.map(name => by[name]));
  }

  // Take the newest tick.
  tell(now, seconds) {
    const most = this.most.of(now.power.flat(), seconds);
    this.newest = {now, most};
    this.drawing.turn(now, most, seconds);
    this.#tell();
  }

  get scale() { return this.drawing.scale; }

  frame(dt) { this.drawing.frame(dt); }

  recolour() {
    this.#labels();
    this.#flows();
    if (this.newest) this.#tell();
  }

  // The labels of the wheels, each beside its own, and of the body.
  #labels() {
    const {scene} = this;
    $('wheels').replaceChildren();
    this.wheels = [];
    if (!scene) return;
    this.wheels = scene.wheels.map((wheel, i) => {
      const label = make('div', `label ${scene.places[i][1] > 0 ? 'left' : 'right'}`);
      label.style.borderColor = this.colours.lines[scene.colours[wheel]];
      const [speed, force, used, slip] = ['speed', 'force', 'used', 'slip'].map(kind => {
        const made = make('span', 'number', NOTHING);
        made.dataset[kind] = wheel;
        return made;
      });
      force.title = 'force of the road, of the load of the wheel';
      label.append(make('b', '', words(wheel)), speed, force, used, slip);
      $('wheels').append(label);
      return {label, speed, force, used, slip};
    });
    const body = make('div', 'label centre body');
    this.speed = make('b', '', NOTHING);
    this.speed.dataset.speed = 'body';
    this.yaw = make('span', 'number', NOTHING);
    this.yaw.dataset.yaw = 'body';
    body.append(this.speed, this.yaw);
    $('wheels').append(body);
    this.#place();
  }

  #place() {
    (this.wheels || []).forEach(({label}, i) => {
      label.style.top = `${this.drawing.heightOf(i)}px`;
    });
  }

  // The table of powers.
  #flows() {
    const {scene} = this, box = $('flows');
    box.replaceChildren();
    if (!scene) return;
    const scale = make('div', 'scale'), bar = make('canvas'), table = make('table');
    bar.width = 200;
    bar.height = 1;
    const context = bar.getContext('2d');
    for (let x = 0; x < 200; x++) {
      context.fillStyle = this.colours.css(this.colours.power(x / 199));
      context.fillRect(x, 0, 1, 1);
    }
    this.greatest = make('span', 'number', NOTHING);
    scale.append(make('span', '', '0'), bar, this.greatest,
      make('span', 'meaning', '+1: driven by its input, \u22121: by its outputs'));
    this.rows = scene.differentials.map(({name, outputs}) => {
      const row = make('tr');
      const index = make('td', 'number', NOTHING);
      index.dataset.index = name;
      row.append(make('th', '', name), index);
      const cell = (what, kind) => {
        const made = make('td'), value = make('span', 'number', NOTHING);
        value.dataset[kind] = `${name}.${what}`;
        made.append(make('span', '', what), value);
        row.append(made);
        return value;
      };
      // an output is told by its last word: left, right, front, rear
      const powers = ['in', ...outputs.map(output => output.split('_').at(-1))].map(
        what => cell(what, 'power'));
      table.append(row);
      return {powers, index};
    });
    box.append(make('h2', '', 'Power through each differential'), scale, table);
  }

  #tell() {
    const {now, most} = this.newest, [v_x, v_y, r] = now.twist;
    this.speed.textContent = `${fixed(v_x, 2)} m/s`;
    const turned = now.pose[2] * DEGREES;
    this.yaw.textContent = `${fixed(3.6 * v_x, 0)} km/h` + (this.scene.planar
      ? `, yaw ${fixed(turned, 1)}\u00b0, ${fixed(r, 3)} rad/s` : '');
    this.wheels.forEach(({speed, force, used, slip}, i) => {
      const grip = now.grip[i], share = Math.round(100 * now.used[i]);
      speed.textContent = `${number(now.velocity[i])} rad/s`;
      force.textContent = `${Math.round(Math.hypot(...now.force[i]))} of ${Math.round(now.load[i])} N`;
      used.textContent = grip === null ? `${share} % of the load` : `${share} % of grip ${grip.toFixed(2)}`;
      slip.textContent = `slip ${fixed(100 * now.slip[i][0], 1)} %`;
    });
    this.greatest.textContent = power(most);
    this.rows.forEach(({powers, index}, i) => {
      powers.forEach((value, k) => { value.textContent = power(now.power[i][k]); });
      index.textContent = INDEX[now.flow[i]] ?? NOTHING;
    });
  }
}
