// Copyright 2026 dm_ros developers
// SPDX-License-Identifier: Apache-2.0

// Numbers and names as one reads them.

const MINUS = '\u2212';

// Four digits, as many of them before the point as there are.
export function number(value) {
  if (value == null || !Number.isFinite(value)) return '\u2013';
  const size = Math.abs(value);
  const text = size >= 1e6 ? value.toExponential(2)
    : size >= 1000 ? Math.round(value).toString()
      : value.toFixed(size >= 100 ? 1 : size >= 10 ? 2 : 3);
  const short = Number.isInteger(value) && size < 1e6 ? value.toString() : text;
  return (/^-0(\.0*)?$/.test(short) ? short.slice(1) : short).replace('-', MINUS);
}

// A number with so many digits behind the point; what rounds to zero has no sign.
export function fixed(value, digits) {
  return value.toFixed(digits).replace(/^-(0(\.0*)?)$/, '$1').replace('-', MINUS);
}

// A power in W or kW.
export function power(value) {
  const size = Math.abs(value);
  if (size >= 1e6) return `${(value / 1e6).toFixed(2)} MW`.replace('-', MINUS);
  if (size >= 1000) return `${(value / 1000).toFixed(size >= 1e5 ? 0 : 2)} kW`.replace('-', MINUS);
  return `${(Math.round(value * 10) / 10 || 0).toFixed(size >= 100 ? 0 : 1)} W`.replace('-', MINUS);
}

export const words = name => name.replaceAll('_', ' ');

// A new element of a kind with a class and text.
export function make(kind, className = '', text = '') {
  const element = document.createElement(kind);
  if (className) element.className = className;
  element.textContent = text;
  return element;
}
