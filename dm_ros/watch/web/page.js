// Copyright 2026 dm_ros developers
// SPDX-License-Identifier: Apache-2.0

// The page: takes the events of the server and lets each part show them.

import {CarView} from './car.js';
import {Control} from './control.js';
import {DifferentialView} from './differential.js';
import {Diagnostics} from './panels.js';
import {Strips} from './strips.js';

const AGAIN = 2000;      // ms until the server is asked again
const STRIPS = 0.06;     // s from one drawing of the strips to the next
const LATE = 0.025;      // s from one frame to the next that are too long
const SPARING = 30;      // s for which fewer frames are drawn after too many were late
const SILENT = 1;        // s without a tick, or some ticks of a slow node
const $ = id => document.getElementById(id);

const views = {differential: new DifferentialView(), driveline: new CarView()};   // by kind of node
let view = views.differential;
const strips = new Strips($('strips'), view.colours);
const diagnostics = new Diagnostics($('diagnostics'), $('alarm'));
const control = new Control($('control'));
let scene = null, shown = null, newest = null;   // of the node, of the last one, its last tick
let heard = null, connected = false, paused = false;

const seconds = () => performance.now() / 1000;

// the page knows of its own pause at once; of those of others /diagnostics tells
let held = null;   // s, when this page paused the node, which has not gone on
control.onDone = work => {
  if (work === 'pause') held = seconds();
  if (work === 'continue') held = null;
};

function show(description) {
  const same = scene && description.kind === scene.kind
    && JSON.stringify(scene.strips) === JSON.stringify(description.strips);
  scene = description.kind ? description : null;
  heard = held = null;
  paused = false;
  document.title = `${description.node} \u2013 watch`;
  $('node').textContent = description.node;
  // what was seen of a node stays when it goes, until the next one comes
  if (scene || description.refusal) shown = scene;
  $('waiting').hidden = Boolean(scene);
  document.querySelector('main').classList.toggle('waiting', !shown);
  document.querySelector('.node').textContent = description.node;
  $('refusal').hidden = !description.refusal;
  $('refusal').textContent = `It is there, but cannot be shown: ${description.refusal}`;
  $('how').textContent = how(description.node);
  control.show(scene);
  if (shown && !scene) return;
  newest = null;
  view = views[scene?.kind] ?? view;
  for (const other of Object.values(views)) other.show(other === view ? scene : null);
  $('kind').textContent = scene ? view.title(scene) : '';
  $('loss').textContent = '';
  if (!same) {
    strips.show(scene);
    diagnostics.tell([]);
  }
  $('scale').textContent = '';
  $('note').textContent = scene ? view.note(scene) : '';
}

// The commands that start a node of this name, and a load.
function how(node) {
  const [, space, name] = node.match(/^(.*)\/([^/]+)$/);
  const inSpace = space ? ` -r __ns:=${space}` : '';
  if (name.includes('driveline')) {
    const other = name === 'driveline' ? '' : ` -r __node:=${name}`;
    return `ros2 run dm_ros driveline --ros-args -p planar:=true${inSpace}${other}\n`
      + `ros2 topic pub -r 50 ${node}/commands sensor_msgs/msg/JointState `
      + "'{name: [input], effort: [200.0]}'";
  }
  const renamed = name === 'differential' ? '' : ` -r __node:=${name}`;
  return `ros2 run dm_ros differential --ros-args -p variant:=lsd_ode${inSpace}${renamed}\n`
    + `ros2 run dm_ros play_torques --variant lsd_ode${renamed && ` --node ${name}`}`
    + `${inSpace && ` --ros-args${inSpace}`}`;
}

function ticks({emptied, rows, now}) {
  if (!scene) return;   // of a node that has gone the strips stay
  strips.add(rows, emptied);
  if (!now) return;
  heard = seconds();
  paused = false;
  newest = now;
  view.tell(now, heard);
  strips.tell(view.numbers(now));
  if (view.scale) {
    const slower = Math.round(1 / view.scale);
    $('scale').textContent = slower > 1 ? `drawn at 1/${slower} speed` : 'drawn at true speed';
  }
  if (now.lost) $('loss').textContent = `${now.lost} tick${now.lost > 1 ? 's' : ''} not heard whole`;
}

function told(statuses) {
  if (!scene) return;
  diagnostics.tell(statuses);
  paused = statuses.some(({name, message}) => name === 'loop' && message === 'paused');
  if (!paused && seconds() - held > SILENT) held = null;   // somebody else let it go on
}

// What the node is doing, in words, and how good that is.
function state() {
  if (!connected) return ['no connection to watch', 'error'];
  if (!scene) return shown ? ['node gone', 'error'] : ['waiting for the node', 'warn'];
  if (held !== null) return ['paused', 'warn'];
  const quiet = heard === null ? Infinity : seconds() - heard;
  if (quiet < Math.max(SILENT, 5 / scene.rate)) return ['running', 'ok'];
  if (paused) return ['paused', 'warn'];
  if (scene.mode === 'lockstep') return [`waits for messages on ~/${scene.grouped}`, ''];
  return [heard === null ? 'no tick yet' : `no tick for ${Math.round(quiet)} s`, 'warn'];
}

function tellState() {
  const [words, level] = state();
  $('state').textContent = words;
  $('state').className = `badge ${level}`;
}

function connect() {
  const source = new EventSource('events');
  const on = (name, take) => source.addEventListener(
    name, ({data}) => take(JSON.parse(data)));
  on('viewer', name => {
    control.viewer = name;
    connected = true;
  });
  on('scene', show);
  on('ticks', ticks);
  on('diagnostics', told);
  on('commands', values => control.tell(values));
  source.addEventListener('error', () => {
    connected = false;
    source.close();
    setTimeout(connect, AGAIN);
  });
}

let before = seconds(), turned = before, drawn = 0;
let frames = 0, late = 0, sparingUntil = 0;
function frame() {
  const now = seconds();
  frames += 1;
  late += now - before > LATE;
  before = now;
  if (frames === 120) {   // where no hardware helps, as in a virtual machine, half as many will do
    if (late > 40) sparingUntil = now + SPARING;
    frames = late = 0;
  }
  const sparing = now < sparingUntil;
  if (!sparing || now - turned > LATE) {
    view.frame(now - turned);
    turned = now;
  }
  if (now - drawn > (sparing ? 2 : 1) * STRIPS) {
    drawn = now;
    strips.draw();
  }
  requestAnimationFrame(frame);
}

matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => {
  for (const other of Object.values(views)) other.recolour();
  strips.recolour(view.colours);
  if (newest) strips.tell(view.numbers(newest));
});
setInterval(tellState, 200);
connect();
requestAnimationFrame(frame);
