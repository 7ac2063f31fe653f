// Columns of the document as typed arrays: base64 of little-endian numbers, or plain arrays.

function bytesOf(text) {
  const binary = atob(text);
  const bytes = new Uint8Array(binary.length);
  for (let i = 0; i < binary.length; ++i) bytes[i] = binary.charCodeAt(i);
  return bytes;
}

const little = new Uint8Array(new Uint16Array([1]).buffer)[0] === 1;

function numbers(column, Type, read) {
  if (column == null) return new Type(0);
  if (typeof column !== 'string') return Type.from(column, (v) => (v == null ? NaN : v));
  const bytes = bytesOf(column);
  if (little) return new Type(bytes.buffer, 0, Math.floor(bytes.length / Type.BYTES_PER_ELEMENT));
  const view = new DataView(bytes.buffer);
  const step = Type.BYTES_PER_ELEMENT;
  return Type.from({ length: Math.floor(bytes.length / step) }, (_, i) => read(view, i * step));
}

export const floats = (column) => numbers(column, Float32Array, (v, at) => v.getFloat32(at, true));
export const shorts = (column) => numbers(column, Uint16Array, (v, at) => v.getUint16(at, true));
export const bytes = (column) => numbers(column, Uint8Array, (v, at) => v.getUint8(at));

export function joined(a, b) {
  const all = new a.constructor(a.length + b.length);
  all.set(a, 0);
  all.set(b, a.length);
  return all;
}

const kMost = 20000;

/**
 * `old` and what came after it, or in place of it; `width` numbers a point. Where that is too much every second of the
 * old points goes.
 */
export function grown(old, next, replace, width = 1) {
  if (replace) return next;
  const much = old.length + next.length > kMost * width;
  const kept = much ? old.filter((_, i) => Math.floor(i / width) % 2 === 0) : old;
  return joined(kept, next);
}

/** The bounds of a plot that stands in several runs, so that all of them get one scale. */
export function sharedBounds(plots) {
  const x = [];
  const y = [];
  for (const series of plots.flatMap((plot) => plot.series)) {
    x.push(floats(series.x));
    const values = floats(series.y);
    y.push(values);
    if (series.style === 'band') y.push(values.map((v) => -v));
  }
  return { x: bounds(x), y: bounds(y) };
}

export function bounds(columns) {
  let low = Infinity;
  let high = -Infinity;
  for (const column of columns) {
    for (const value of column) {
      if (value < low) low = value;
      if (value > high) high = value;
    }
  }
  return low <= high ? [low, high] : [0, 1];
}
