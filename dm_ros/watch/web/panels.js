// Copyright 2026 dm_ros developers
// SPDX-License-Identifier: Apache-2.0

// What stands around the drawing: labels of the shafts, the legend of powers, /diagnostics.

import {role} from './colours.js';
import {make, number, power, words} from './words.js';

// Where the label of each shaft has its place around the drawing.
const PLACES = {first: 'bottom left', second: 'bottom right', satellite: 'top centre'};
const DRIVEN = {carrier: 'top right', pinion: 'top left'}, BARE = {carrier: 'top left'};
const NICE = [1, 2, 5, 10], NOTHING = '\u2013';
const MEMORY = 10;   // s for which the most of a power is remembered

// The least of 1, 2, 5, 10, 20, ... that is not below a value.
function nice(value) {
  const decade = 10 ** Math.floor(Math.log10(Math.max(value, 1)));
  return decade * NICE.find(n => n * decade >= value * 0.999);
}

// What a node says of powers, W: through meshes, in clutches, into shafts from outside.
export function powersOf(scene, now) {
  const by = (names, values) => Object.fromEntries(names.map((name, i) => [name, values[i]]));
  const speed = by(scene.shafts, now.velocity), torque = by(scene.shafts, now.torque);
  const moment = by(scene.moments, now.moment), carrier = speed[scene.shafts[0]];
  const meshes = {}, clutches = {}, shafts = {};
  for (const [mesh, shaft] of Object.entries(scene.meshes)) meshes[mesh] = moment[mesh] * speed[shaft];
  for (const [clutch, shaft] of Object.entries(scene.clutches)) {
    clutches[clutch] = moment[clutch] * (speed[shaft] - carrier);
  }
  for (const shaft of scene.inputs) shafts[shaft] = torque[shaft] * speed[shaft];
  return {meshes, clutches, shafts};
}

// The numbers of all series of the strips, in their order.
export function numbersOf(scene, now) {
  const at = names => names.map(name => scene.shafts.indexOf(name));
  return [...now.velocity, ...at(scene.outputs).map(i => now.velocity[i] - now.velocity[0]),
    ...now.moment, ...at(scene.inputs).map(i => now.torque[i]), ...now.force, now.flow];
}

// The most of the last while, as a nice number.
export class Most {
  constructor() { this.seen = []; }

  of(values, seconds) {
    this.seen = this.seen.filter(([time]) => time > seconds - MEMORY);
    this.seen.push([seconds, Math.max(0, ...values.map(Math.abs))]);
    return nice(Math.max(10, ...this.seen.map(([, value]) => value)));
  }
}

export class Labels {
  constructor(element) { this.element = element; }

  show(scene, colours) {
    this.element.replaceChildren();
    this.scene = scene;
    if (!scene) return;
    const places = {...PLACES, ...(scene.gears?.drive ? DRIVEN : BARE)};
    this.values = scene.shafts.map(shaft => {
      const index = role(scene.shafts, shaft), place = places[colours.names[index]];
      const label = make('div', `label ${place}`);
      label.style.borderColor = colours.lines[index];
      const [speed, torque] = [0, 1].map(() => make('span', 'number', NOTHING));
      speed.dataset.speed = torque.dataset.torque = shaft;
      label.append(make('b', '', shaft), speed);
      if (scene.inputs.includes(shaft)) label.append(torque);
      this.element.append(label);
      return {shaft, label, speed, torque};
    });
  }

  // Where the labels are, [left, top, right, bottom], in a canvas with this corner.
  boxes({left, top}) {
    return Object.fromEntries((this.values || []).map(({shaft, label}) => {
      const box = label.getBoundingClientRect();
      return [shaft, [box.left - left, box.top - top, box.right - left, box.bottom - top]];
    }));
  }

  tell(now) {
    this.values.forEach(({speed, torque}, i) => {
      speed.textContent = `${number(now.velocity[i])} rad/s`;
      torque.textContent = `${number(now.torque[i])} N m`;
    });
  }
}

export class Legend {
  constructor(element) { this.element = element; }

  show(scene, colours) {
    this.element.replaceChildren();
    this.values = {};
    this.colours = colours;
    this.element.hidden = !scene;
    if (!scene) return;
    const heats = Object.keys(scene.clutches);
    this.#part('power', 'Power through each mesh, by magnitude', Object.keys(scene.meshes));
    if (heats.length) this.#part('heat', 'Heat in each clutch, by magnitude', heats);
  }

  #part(ramp, title, names) {
    const part = make('div'), scale = make('div', 'scale'), bar = make('canvas');
    bar.width = 200;
    bar.height = 1;
    const context = bar.getContext('2d');
    for (let x = 0; x < 200; x++) {
      context.fillStyle = this.colours.css(this.colours[ramp](x / 199));
      context.fillRect(x, 0, 1, 1);
    }
    this[ramp] = make('span', 'number', NOTHING);
    scale.append(make('span', '', '0'), bar, this[ramp]);
    const list = make('dl');
    for (const name of names) {
      const row = make('div'), chip = make('span', 'chip'), value = make('dd', 'number', NOTHING);
      value.dataset.power = name;
      row.append(chip, make('dt', '', words(name).replace(/ (mesh|clutch)$/, '')), value);
      list.append(row);
      this.values[name] = {value, chip, ramp};
    }
    part.append(make('h2', '', title), scale, list);
    this.element.append(part);
  }

  tell({meshes, clutches, most}) {
    for (const [name, {value, chip, ramp}] of Object.entries(this.values)) {
      const watts = meshes[name] ?? clutches[name];
      value.textContent = power(watts);
      chip.style.background = this.colours.css(
        this.colours[ramp](Math.abs(watts) / most[ramp]));
    }
    this.power.textContent = power(most.power);
    if (this.heat) this.heat.textContent = power(most.heat);
  }
}

export class Diagnostics {
  constructor(element, alarm) {
    this.element = element;
    this.alarm = alarm;
    this.rows = new Map();
    this.list = make('ul');
    this.none = make('p', 'none', 'Nothing on /diagnostics from this node yet.');
    element.append(make('h2', '', 'Diagnostics'), this.none, this.list);
  }

  tell(statuses) {
    this.none.hidden = statuses.length > 0;
    const names = new Set(statuses.map(status => status.name));
    for (const [name, row] of this.rows) {
      if (names.has(name)) continue;
      row.item.remove();
      this.rows.delete(name);
    }
    for (const status of statuses) this.#row(status);
    const bad = statuses.filter(status => status.level !== 'ok');
    this.alarm.hidden = !bad.length;
    this.alarm.className = `badge ${bad.some(status => status.level === 'error') ? 'error' : 'warn'}`;
    this.alarm.textContent = bad.map(({name, message}) => `${name}: ${message}`).join(' · ') || '\u00a0';
    this.alarm.title = this.alarm.textContent;   // whole, where there is no room for it
  }

  #row({name, level, message, values}) {
    let row = this.rows.get(name);
    if (!row) {
      row = {item: make('li'), badge: make('span'), message: make('span', 'message'),
        table: make('table')};
      const details = make('details'), summary = make('summary');
      summary.append(row.badge, make('b', '', name), row.message);
      details.append(summary, row.table);
      row.item.append(details);
      this.list.append(row.item);
      this.rows.set(name, row);
    }
    row.badge.className = `badge ${level}`;
    row.badge.textContent = level;
    row.message.textContent = message;
    row.table.replaceChildren(...values.map(([key, value]) => {
      const line = make('tr');
      line.append(make('td', '', key), make('td', 'number', value));
      return line;
    }));
  }
}
