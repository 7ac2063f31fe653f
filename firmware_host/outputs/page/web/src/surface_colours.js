// What surfaces and clouds are coloured by.

import { Color } from 'three';
import * as colours from './colours.js';

export const kUnlabelled = [0.62, 0.62, 0.62];

export const labelColours = (labels) => labels.map((label) => {
  const c = new Color(label.colour);
  return [c.r, c.g, c.b];
});

/** Colours are given as they are to be seen; three.js computes in linear light. */
export function linear(rgb) {
  const c = new Color().setRGB(rgb[0] / 255, rgb[1] / 255, rgb[2] / 255, 'srgb');
  return [c.r, c.g, c.b];
}

const greys = Array.from({ length: 256 }, (_, value) => linear([value, value, value]));
export const grey = (value) => greys[value];

const kSteps = 64;
let ramp;
/** Of a share from 0 to 1, in steps. */
export function share(value) {
  ramp ??= Array.from({ length: kSteps + 1 }, (_, i) => linear(colours.ramp(i / kSteps)));
  return ramp[Math.round(Math.min(Math.max(Number.isFinite(value) ? value : 1, 0), 1) * kSteps)];
}

export const height = ([low, high]) => (z) => share((z - low) / (high - low || 1));
