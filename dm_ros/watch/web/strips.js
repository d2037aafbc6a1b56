// Copyright 2026 dm_ros developers
// SPDX-License-Identifier: Apache-2.0

// The strips: lines of the last 30 s, which uPlot draws.

import {role} from './colours.js';
import {number, words} from './words.js';

const SPAN = 30;            // s
const LEAST = 1e-3;         // of a unit, that an axis spans at least: less is rounding
const LAST = 24;            // px of the axis of time, below the last strip
const TITLES = {speeds: 'Speeds', slip: 'Ahead of the carrier', moments: 'Internal moments',
  torques: 'Torques', forces: 'Clutch forces', index: 'Power flow', wheels: 'Wheels',
  body: 'Body', yaw: 'Yaw', halves: 'Half-shafts', shafts: 'Shafts'};

const SYNC = uPlot.sync('strips');

// What a number of a series is called, which colour it has, and whether its line is dashed.
function drawn(scene, name) {
  if (scene.colours) return {colour: scene.colours[name], dashed: false};
  const shaft = scene.meshes[name] || scene.clutches[name] || name;
  return {colour: name === 'power_flow' ? 0 : role(scene.shafts, shaft),
    dashed: name in scene.clutches};
}

// Which numbers of a series have no neighbour to which a line could go, as after a single step.
function alone(plot, series) {
  const values = plot.data[series];
  return [...values.keys()].filter(
    i => values[i] != null && values[i - 1] == null && values[i + 1] == null);
}

export class Strips {
  constructor(element, colours) {
    this.element = element;
    this.colours = colours;
    this.plots = [];
    this.columns = null;        // of numbers: the times, then all series
    this.newest = [];
    this.stale = false;
    new ResizeObserver(() => this.#resize()).observe(element);
  }

  // Show the strips of another node, or none.
  show(scene) {
    for (const {plot} of this.plots) plot.destroy();
    this.element.replaceChildren();
    this.plots = [];
    this.scene = scene;
    this.newest = [];
    this.columns = null;
    if (!scene) return;
    let first = 1;
    scene.strips.forEach((strip, i) => {
      this.#strip(strip, first, i === scene.strips.length - 1);
      first += strip.series.length;
    });
    this.columns = Array.from({length: first}, () => []);
    this.#resize();
  }

  // Take rows as the server sends them.
  add(rows, emptied) {
    if (!this.columns) return;
    const [time] = this.columns;
    if (emptied) this.columns.forEach(column => { column.length = 0; });
    for (const row of rows) {
      if (row) this.columns.forEach((column, i) => column.push(row[i]));
      else if (time.length) {   // no line goes across
        this.columns.forEach((column, i) => column.push(i ? null : time.at(-1) + 1e-6));
      }
    }
    const old = time.findIndex(t => t >= time.at(-1) - SPAN - 1);
    if (old > 300) this.columns.forEach(column => column.splice(0, old));
    this.stale = true;
  }

  // Take the newest numbers of all columns, which are told where the cursor is nowhere.
  tell(newest) {
    this.newest = newest;
    this.#values();
  }

  // Draw what has come since the last time.
  draw() {
    if (!this.stale || !this.columns) return;
    this.stale = false;
    for (const {plot, first, count} of this.plots) {
      plot.setData([this.columns[0], ...this.columns.slice(first, first + count)]);
    }
  }

  recolour(colours) {
    this.colours = colours;
    const {columns, scene} = this;
    if (!scene) return;
    this.show(scene);
    this.columns = columns;
    this.stale = true;
  }

  #resize() {
    const width = this.element.clientWidth - 22;
    if (width < 50 || !this.plots.length) return;
    const narrow = this.element.clientWidth > window.innerWidth * 0.7;
    const room = narrow ? 130 : (window.innerHeight - 74) / this.plots.length - 42;
    for (const {plot, strip, last} of this.plots) {
      const height = strip.name === 'index' ? 46 : Math.min(190, Math.max(84, room));
      plot.setSize({width, height: height + (last ? LAST : 0)});
    }
  }

  #strip(strip, first, last) {
    const box = document.createElement('div'), header = document.createElement('header');
    box.className = 'strip';
    const title = document.createElement('h2');
    title.textContent = `${TITLES[strip.name]} `;
    const unit = document.createElement('span');
    unit.className = 'unit';
    unit.textContent = strip.unit || '+1 direct, \u22121 reverse';
    title.append(unit);
    header.append(title);
    const {lines, grid, text} = this.colours, keys = [];
    const series = strip.series.map(name => {
      const {colour, dashed} = drawn(this.scene, name);
      const key = document.createElement('span'), dash = document.createElement('i');
      const value = document.createElement('span');
      key.className = 'key';
      dash.style.borderColor = lines[colour];
      if (dashed) dash.className = 'dashed';
      value.className = 'number';
      value.dataset.series = `${strip.name}.${name}`;
      key.append(dash, strip.name === 'index' ? '' : this.scene.short?.[name] ?? words(name), value);
      header.append(key);
      keys.push(value);
      return {label: name, stroke: lines[colour], width: 1.4, dash: dashed ? [5, 3] : undefined,
        points: {show: true, filter: alone, size: 4, fill: lines[colour]}, paths: strip.name === 'index' ? uPlot.paths.stepped({align: 1}) : undefined};
    });
    box.append(header);
    this.element.append(box);
    const isIndex = strip.name === 'index';
    const axis = {stroke: text, font: '11px system-ui, sans-serif', ticks: {show: false},
      grid: {stroke: grid, width: 1}};
    const plot = new uPlot({
      width: 300, height: 100, legend: {show: false}, padding: [6, 14, last ? 0 : 4, 0],
      cursor: {sync: {key: SYNC.key}, drag: {x: false, y: false}, points: {size: 5}},
      scales: {
        x: {time: false, range: ({data}) => {   // uPlot would give a single time a range of its own
          const end = data?.[0].at(-1) ?? SPAN;
          return [end - SPAN, end];
        }},
        y: {range: isIndex ? [-1.5, 1.5] : (_, low, high) => this.#range(low, high)}},
      axes: [
        {...axis, show: true, size: last ? LAST : 0, gap: 3,
          splits: (_u, _a, low, high) => [-30, -20, -10, 0].map(t => high + t),
          values: (u, splits) => splits.map(t => last
            ? (t === u.scales.x.max ? 'now' : `${Math.round(t - u.scales.x.max)} s`) : '')},
        {...axis, size: 48, gap: 4, space: 17,
          ...(isIndex ? {splits: () => [-1, 1], values: () => ['\u22121', '+1']} : {
            values: (_, splits) => splits.map(v => String(+v.toPrecision(6)).replace('-', '\u2212'))})}],
      series: [{}, ...series],
      hooks: {setCursor: [() => this.#values()], setData: [() => this.#values()]},
    }, [[], ...series.map(() => [])], box);
    this.plots.push({plot, strip, first, count: series.length, keys, last});
  }

  #range(low, high) {
    if (low == null) return [-1, 1];
    const least = Math.min(low, 0), most = Math.max(high, 0), span = most - least;
    if (!span) return [-1, 1];
    if (span < LEAST) return [-LEAST, LEAST];
    return [least - 0.06 * span, most + 0.06 * span];
  }

  // Tell the numbers under the cursor, or the newest.
  #values() {
    if (!this.columns) return;
    for (const {plot, first, keys} of this.plots) {
      const index = plot.cursor.idx;
      keys.forEach((key, i) => {
        key.textContent = number(index == null ? this.newest[first + i - 1]
          : this.columns[first + i][index]);
      });
    }
  }
}
