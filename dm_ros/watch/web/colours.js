// Copyright 2026 dm_ros developers
// SPDX-License-Identifier: Apache-2.0

// The colours of the page, which page.css has for light and dark, as numbers.

const cache = new Map();

export const blend = (one, other, share) => one.map((x, i) => x + share * (other[i] - x));

// Which of the colours of shafts one has: of carrier, outputs, pinion, satellite.
export function role(shafts, name) {
  const index = shafts.indexOf(name);
  return index === shafts.length - 1 ? 4 : index;
}

export class Colours {
  constructor() {
    cache.clear();
    const style = getComputedStyle(document.documentElement);
    const read = name => {
      const text = style.getPropertyValue(name).trim();
      return [1, 3, 5].map(i => parseInt(text.slice(i, i + 2), 16));
    };
    this.names = ['carrier', 'first', 'second', 'pinion', 'satellite'];
    // a shaft of the page has its colour in lines, and a calmer one in the drawing
    this.lines = this.names.map(name => style.getPropertyValue(`--${name}`).trim());
    this.plain = read('--metal');
    this.shafts = this.names.map(name => blend(this.plain, read(`--${name}`), 0.3));
    [this.dark, this.mark, this.paper, this.ink] = ['--shadow', '--mark', '--panel', '--ink'].map(read);
    this.grid = style.getPropertyValue('--grid').trim();
    this.text = style.getPropertyValue('--soft').trim();
    this.ramps = Object.fromEntries(['power', 'heat'].map(
      name => [name, [0, 1, 2].map(i => read(`--${name}-${i}`))]));
  }

  // The colour of a share of the most, 0 to 1.
  power(share) { return this.#on('power', share); }

  heat(share) { return this.#on('heat', share); }

  #on(name, share) {
    const at = Math.min(1, Math.max(0, share || 0)) * 2, ramp = this.ramps[name];
    return at < 1 ? blend(ramp[0], ramp[1], at) : blend(ramp[1], ramp[2], at - 1);
  }

  css(colour) { return `rgb(${colour.map(Math.round).join(' ')})`; }

  // A face of a colour in some light, and its edge.
  lit(colour, shade) {
    const key = colour.map(x => x >> 2).join() + shade;
    let found = cache.get(key);
    if (!found) {
      const lit = shade < 0.75 ? colour.map(x => x * (0.32 + 0.9 * shade))
        : blend(colour, [255, 255, 255], (shade - 0.75) * 0.9);
      found = {colour: this.css(lit), edge: this.css(lit.map(x => 0.97 * x))};
      if (cache.size > 5000) cache.clear();
      cache.set(key, found);
    }
    return found;
  }
}
