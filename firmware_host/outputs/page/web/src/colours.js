// The colours of lines, healths and scales.

export const lines = ['#1f6fb4', '#d1721a', '#2d8a42', '#8552a8', '#b03a3a', '#4a5560'];
export const truth = '#9a9a9a';
export const band = 'rgba(31,111,180,0.18)';
export const health = {
  initializing: '#b9c2cb',
  good: '#57a86b',
  degraded: '#e8b23a',
  failed: '#cf4646',
};

// From what is right to what went wrong.
const stops = [
  [33, 102, 172],
  [103, 169, 207],
  [253, 219, 120],
  [239, 138, 98],
  [178, 24, 43],
];

/** Red, green, blue (0 to 255) of a share from 0 to 1. */
export function ramp(share) {
  const at = Math.min(Math.max(Number.isFinite(share) ? share : 1, 0), 1) * (stops.length - 1);
  const i = Math.min(Math.floor(at), stops.length - 2);
  return stops[i].map((c, k) => Math.round(c + (stops[i + 1][k] - c) * (at - i)));
}

export const css = ([r, g, b]) => `rgb(${r},${g},${b})`;
export const rampCss = `linear-gradient(90deg,${stops.map(css).join(',')})`;

/** A scale beside its label: an element. */
export function scaleLegend(label, low, high) {
  const element = document.createElement('div');
  element.className = 'scale';
  const bar = document.createElement('i');
  bar.style.background = rampCss;
  element.append(`${label} ${low.toPrecision(2)}`, bar, high.toPrecision(2));
  return element;
}
