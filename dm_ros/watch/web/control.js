// Copyright 2026 dm_ros developers
// SPDX-License-Identifier: Apache-2.0

// The sliders and buttons by which a node is commanded, where the server allows it.

import {make, words} from './words.js';

const TICKS = [1, 10, 100];
const QUIET = 40;   // ms from one message of a slider that moves to the next

export class Control {
  constructor(element) {
    this.element = element;
    this.token = document.querySelector('meta[name=token]')?.content;
    this.viewer = null;
    this.rows = new Map();
    this.waiting = null;   // values that a slider has and the server has not
    this.told = {};        // values that the server has
  }

  show(scene) {
    this.element.replaceChildren();
    this.rows.clear();
    this.waiting = null;
    this.element.hidden = !scene || !this.token;
    if (this.element.hidden) return;
    const lockstep = scene.mode === 'lockstep', rows = make('div', 'rows');
    for (const port of scene.ports) rows.append(this.#row(port));
    const buttons = make('div', 'buttons');
    const button = (text, request, title, strong = false) => {
      const made = make('button', strong ? 'strong' : '', text);
      made.type = 'button';
      made.title = title;
      made.addEventListener('click', () => this.#ask(request));
      buttons.append(made);
    };
    button('Zero all', {do: 'zero'}, 'command zero on every shaft and clutch', true);
    button('Let go', {do: 'release'}, 'command nothing any more');
    if (lockstep) {
      for (const count of TICKS) {
        button(`${count} tick${count > 1 ? 's' : ''}`, {do: 'ticks', count},
          'send so many messages on ~/torques with what the sliders have');
      }
    }
    button('Pause', {do: 'pause'}, 'stop the ticks');
    button('Continue', {do: 'continue'}, 'go on');
    button('Step', {do: 'step'}, 'one tick while paused');
    button('Reset', {do: 'reset'}, 'speeds and angles back to the start');
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
          + 'go or leave. What you did not move is left to others.'));
  }

  // Show what all viewers command now.
  tell(values) {
    this.told = values;
    for (const [name, row] of this.rows) {
      const touched = name in values;
      row.label.classList.toggle('untouched', !touched);
      if (this.waiting && name in this.waiting || row.held || row.typing) continue;
      this.#put(row, values[name] ?? 0);
    }
  }

  #put({slider, field}, value) {
    if (value > Number(slider.max)) slider.max = value;
    if (value < Number(slider.min)) slider.min = value;
    slider.value = value;
    field.value = String(Number(value.toPrecision(6)));
  }

  #row(port) {
    const label = make('label', 'untouched'), slider = make('input'), field = make('input');
    slider.type = 'range';
    [slider.min, slider.max, slider.step] = [port.from, port.to, (port.to - port.from) / 600];
    field.type = 'number';
    [field.min, field.max, field.step] = [port.low, port.high, 'any'];
    slider.value = 0;
    field.value = '0';
    slider.setAttribute('aria-label', `${port.name} ${port.kind}`);
    field.setAttribute('aria-label', `${port.name} in ${port.unit}`);
    slider.name = field.name = port.name;
    const row = {label, slider, field, held: false, typing: false};
    slider.addEventListener('pointerdown', () => { row.held = true; });
    for (const end of ['pointerup', 'pointercancel', 'blur']) {
      slider.addEventListener(end, () => { row.held = false; });
    }
    slider.addEventListener('input', () => {
      // the middle of a slider is hard to hit
      const near = Math.abs(slider.value) < (port.to - port.from) / 150 ? 0 : Number(slider.value);
      field.value = String(Number(near.toPrecision(4)));
      this.#set(port.name, near);
    });
    field.addEventListener('input', () => { row.typing = true; });
    field.addEventListener('blur', () => { row.typing = false; });
    field.addEventListener('change', () => {
      row.typing = false;
      const value = field.valueAsNumber;
      if (Number.isFinite(value)) {
        this.#put(row, value);
        this.#set(port.name, value);
      } else this.#say(`${port.name}: a number is expected`, true);
    });
    label.append(make('span', '', words(port.name)), slider, field, make('span', 'none', port.unit));
    this.rows.set(port.name, row);
    return label;
  }

  // Send a value soon, together with others that change meanwhile.
  #set(name, value) {
    if (this.waiting) {
      this.waiting[name] = value;
      return;
    }
    this.waiting = {[name]: value};
    setTimeout(() => {
      const values = this.waiting;
      this.waiting = null;
      if (values) this.#ask({do: 'set', values});
    }, QUIET);
  }

  async #ask(request) {
    if (request.do !== 'set') this.waiting = null;
    try {
      const response = await fetch('control', {
        method: 'POST', body: JSON.stringify({...request, viewer: this.viewer}),
        headers: {'Content-Type': 'application/json', 'X-Watch-Token': this.token}});
      if (!response.ok) {
        this.#say((await response.text()).trim(), true);
        this.tell(this.told);
      } else {
        const {success, message} = await response.json();
        this.#say(request.do === 'set' ? '' : `${request.do}: ${message || 'done'}`, !success);
      }
    } catch {
      this.#say('watch does not answer', true);
    }
  }

  #say(text, bad) {
    this.answer.textContent = text;
    this.answer.className = bad ? 'bad' : '';
  }
}
