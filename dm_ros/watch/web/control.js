// Copyright 2026 dm_ros developers
// SPDX-License-Identifier: Apache-2.0

// The sliders and buttons by which a node is commanded, where the server allows it.

import {make, words} from './words.js';

const TICKS = [1, 10, 100];
const QUIET = 40;   // ms from one message of a slider that moves to the next
const ENDS = ['zero', 'release', 'reset'];   // what ends all commands of the sliders
const DONE = {set: '', zero: 'all zero', release: 'let go'};

// The number that a text is, as JSON and no locale has it, or null.
function parsed(text) {
  const plain = text.trim().replace('\u2212', '-');
  const value = /^[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?$/i.test(plain) ? Number(plain) : NaN;
  return Number.isFinite(value) ? value : null;
}

// Why a port cannot have a value, in words, or null.
function refused({name, unit, low, high}, value, text) {
  if (value !== null) {
    return value < low || value > high
      ? `${name}: ${value} ${unit} is not allowed, it must be in [${low}, ${high}]` : null;
  }
  return text.includes(',') ? `${name}: ${text} is not taken, write a decimal point, as in 1.5`
    : `${name}: a number is expected, not "${text}"`;
}

export class Control {
  constructor(element) {
    this.element = element;
    this.token = document.querySelector('meta[name=token]')?.content;
    this.viewer = null;
    this.rows = new Map();
    this.onDone = () => {};   // is told what a button has done
    this.waiting = null;   // values that a slider has and the server has not
    this.told = {};        // values that the server has
    this.flushed = Promise.resolve();   // when the last values have been sent
    this.asked = 0;        // how many requests have been sent
  }

  show(scene) {
    this.element.replaceChildren();
    this.rows.clear();
    this.waiting = null;
    this.element.hidden = !scene || !this.token;
    if (this.element.hidden) return;
    const lockstep = scene.mode === 'lockstep';
    const rows = make('div', scene.ports.length > 8 ? 'rows long' : 'rows');
    for (const port of scene.ports) rows.append(this.#row(port));
    const buttons = make('div', 'buttons');
    const button = (text, request, title, strong = false) => {
      const made = make('button', strong ? 'strong' : '', text);
      made.type = 'button';
      made.title = title;
      made.addEventListener('click', () => this.#ask(request));
      buttons.append(made);
    };
    button('Zero all', {do: 'zero'}, scene.ports.some(({zero}) => zero)
      ? 'command zero on all of these, and whole grip and contact'
      : 'command zero on every shaft and clutch', true);
    button('Let go', {do: 'release'}, 'command nothing any more');
    if (lockstep) {
      for (const count of TICKS) {
        button(`${count} tick${count > 1 ? 's' : ''}`, {do: 'ticks', count},
          `send so many messages on ~/${scene.grouped} with what the sliders have`);
      }
    }
    button('Pause', {do: 'pause'}, 'stop the ticks');
    button('Continue', {do: 'continue'}, 'go on');
    button('Step', {do: 'step'}, 'one tick while paused');
    button('Reset', {do: 'reset'}, 'let go, and speeds and angles back to the start');
    this.answer = make('span');
    this.answer.id = 'answer';
    this.answer.setAttribute('role', 'status');
    buttons.append(this.answer);
    this.element.append(
      make('h2', '', 'Control'), rows, buttons,
      make('p', 'none', lockstep
        ? 'In lockstep each message is a tick: the sliders go out when you press a number of ticks. '
          + 'What was sent holds until another message or a reset.'
        : 'What you move is sent again and again while this page is open, and zero when you let '
          + 'go or leave'
          + (scene.kind === 'driveline' ? ' where it is a torque or a force; the rest stays. ' : '. ')
          + 'What you did not move is left to others.'));
    this.tell(this.told);
  }

  // Show what all viewers command now.
  tell(values) {
    this.told = values;
    for (const [name, row] of this.rows) {
      const touched = name in values;
      row.label.classList.toggle('untouched', !touched);
      if (this.waiting && name in this.waiting || row.held || row.typing) continue;
      this.#put(row, values[name] ?? row.zero);
    }
  }

  // Show the value that is in force; the range grows with it, and zero keeps its place.
  #put({slider, field}, value) {
    const reach = Math.max(slider.max, Math.abs(value));
    if (slider.min < 0) slider.min = -reach;
    slider.max = reach;
    slider.step = (slider.max - slider.min) / 600;
    slider.value = value;
    field.value = String(Number(value.toPrecision(6)));
  }

  #row(port) {
    const label = make('label', 'untouched'), slider = make('input'), field = make('input');
    slider.type = 'range';
    [slider.min, slider.max, slider.step] = [port.from, port.to, (port.to - port.from) / 600];
    field.type = 'text';   // of type number "1,5" would be 15 in some browsers
    field.inputMode = 'decimal';
    field.autocomplete = 'off';
    field.title = `${port.low} to ${port.high} ${port.unit}: Enter or Tab takes it, Esc gives it up`;
    slider.value = port.zero;
    field.value = String(port.zero);
    slider.setAttribute('aria-label', `${port.name} ${port.kind}`);
    field.setAttribute('aria-label', `${port.name} in ${port.unit}`);
    slider.name = field.name = port.name;
    const row = {label, slider, field, zero: port.zero, held: false, typing: false};
    slider.addEventListener('pointerdown', () => { row.held = true; });
    for (const end of ['pointerup', 'pointercancel', 'blur']) {
      slider.addEventListener(end, () => { row.held = false; });
    }
    slider.addEventListener('input', () => {
      // the middle of a slider is hard to hit
      const near = Math.max(port.low,
        Math.abs(slider.value) < (slider.max - slider.min) / 150 ? 0 : Number(slider.value));
      row.typing = false;
      field.value = String(Number(near.toPrecision(4)));
      this.#set(port.name, near);
    });
    const giveUp = () => {
      row.typing = false;
      this.#put(row, this.#inForce(port.name));
    };
    field.addEventListener('input', () => { row.typing = true; });
    // whoever clicks elsewhere, as on a button, has not said that the number is whole
    field.addEventListener('blur', () => { if (row.typing) giveUp(); });
    field.addEventListener('keydown', event => {
      if (event.key === 'Escape') giveUp();
      if (!row.typing || event.key !== 'Enter' && event.key !== 'Tab') return;
      const value = parsed(field.value), refusal = refused(port, value, field.value);
      if (refusal) {
        this.#say(refusal, true);
        giveUp();
      } else {
        row.typing = false;
        this.#set(port.name, value);
      }
    });
    label.append(make('span', '', words(port.name)), slider, field,
      make('span', 'none', port.unit === '1' ? '' : port.unit));
    this.rows.set(port.name, row);
    return label;
  }

  // The value that a port has, or has as soon as the server takes it.
  #inForce(name) { return this.waiting?.[name] ?? this.told[name] ?? this.rows.get(name).zero; }

  // Send a value soon, together with others that change meanwhile.
  #set(name, value) {
    if (this.waiting) {
      this.waiting[name] = value;
      return;
    }
    this.waiting = {[name]: value};
    setTimeout(() => this.#flush(), QUIET);
  }

  // Send what waits, one message after the other, so that the last one counts.
  #flush() {
    this.flushed = this.flushed.then(() => {
      const values = this.waiting;
      this.waiting = null;
      return values && this.#post({do: 'set', values});
    });
    return this.flushed;
  }

  // Ask for what a button says, after what the sliders have, or instead of it.
  async #ask(request) {
    if (ENDS.includes(request.do)) this.waiting = null;
    await this.#flush();
    await this.#post(request);
  }

  // Answers come in any order; the words that stay are those for what was asked last.
  async #post(request) {
    const number = ++this.asked;
    const say = (text, bad) => {
      if (number === this.asked) this.#say(text, bad);
    };
    try {
      const response = await fetch('control', {
        method: 'POST', body: JSON.stringify({...request, viewer: this.viewer}),
        headers: {'Content-Type': 'application/json', 'X-Watch-Token': this.token}});
      if (!response.ok) {
        say((await response.text()).trim(), true);
        this.tell(this.told);
      } else {
        const {success, message} = await response.json();
        say(DONE[request.do] ?? `${request.do}: ${message || 'done'}`, !success);
        this.#done(request);
        if (success) this.onDone(request.do);
      }
    } catch {
      say('watch does not answer', true);
      this.tell(this.told);
    }
  }

  // Show what a request has changed, also where the server had nothing new to tell.
  #done({do: work, values}) {
    if (work === 'set') this.tell({...this.told, ...values});
    if (!ENDS.includes(work)) return;
    for (const row of this.rows.values()) row.held = row.typing = false;
    this.tell(work === 'zero' ? Object.fromEntries([...this.rows].map(([name, {zero}]) => [name, zero])) : {});
  }

  #say(text, bad) {
    this.answer.textContent = text;
    this.answer.className = bad ? 'bad' : '';
  }
}
