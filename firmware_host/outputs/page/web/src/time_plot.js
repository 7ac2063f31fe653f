// Lines over time; all plots over time of a run share cursor and zoom.

import uPlot from 'uplot';
import * as colours from './colours.js';
import { floats, grown } from './columns.js';
import { Moment } from './moment.js';

const following = new Map(); // sync key -> plots

/** Zooms the others to what one was zoomed to. */
export function follow(key, plot) {
  if (!following.has(key)) following.set(key, new Set());
  following.get(key).add(plot);
}

export function unfollow(key, plot) {
  following.get(key)?.delete(plot);
}

// Of a run that goes on: what its plots show where nobody has zoomed, [s].
const ranges = new Map(); // sync key -> [from, to]
const ends = new Map();
const zoomed = new Set(); // sync keys
let seconds = 0;

/** The last so many seconds; 0: all. */
export function setWindow(wanted) {
  seconds = wanted;
  zoomed.clear();
  for (const [key, end] of ends) setEnd(key, end);
}

/** The run goes on until `end`. */
export function setEnd(key, end) {
  ends.set(key, end);
  ranges.set(key, [seconds > 0 ? Math.max(0, end - seconds) : 0, Math.max(end, 1e-3)]);
}

export function forget(key) {
  for (const one of [ranges, ends, zoomed, following]) one.delete(key);
}

/** New data in a plot over time: it shows the run's range, or stays where it was zoomed to. */
export function setDataOf(plot, key, data) {
  const range = ranges.get(key);
  if (!range) {
    plot.setData(data);
    return;
  }
  plot.batch(() => {
    plot.setData(data, false);
    const { min, max } = plot.scales.x;
    plot.setScale('x', zoomed.has(key) ? { min, max } : { min: range[0], max: range[1] });
  });
}

let spreading = false;
export function spreadZoom(key) {
  return (plot, scale) => {
    if (scale !== 'x' || spreading) return;
    const { min, max } = plot.scales.x;
    const range = ranges.get(key);
    if (range) {
      // Plots that wait to be seen follow later: only what a user did is spread.
      if (!plot.zoomedBy) return;
      plot.zoomedBy = false;
      const times = plot.data[0];
      const all = min <= times[0] && max >= times[times.length - 1];
      if (all) zoomed.delete(key);
      else zoomed.add(key);
    }
    spreading = true;
    for (const other of following.get(key) ?? []) {
      if (other !== plot && (other.scales.x.min !== min || other.scales.x.max !== max)) {
        other.setScale('x', { min, max });
      }
    }
    spreading = false;
  };
}

/** Says of a plot that its next range is a user's: at the end of a drag, and at a double click. */
export function zoomBy() {
  const by = (u, _, handler) => (event) => {
    u.zoomedBy = true;
    handler(event);
    // A click that zoomed nothing.
    setTimeout(() => { u.zoomedBy = false; }, 100);
  };
  return { mouseup: by, dblclick: by };
}

const shown = (value) => (value == null ? '' : Number(value).toPrecision(4));

const kClick = 3; // px that the pointer may move in a click

/** Drags that zoom in time. */
export const kZoomDrag = { x: true, y: false, dist: kClick + 1 };

/**
 * Calls take(t) where somebody clicks. uPlot swallows the event `click` if the page moved under the pointer, as it does
 * when the legends get their first values.
 */
export function takeClicks(plot, take) {
  let from = null;
  plot.over.addEventListener('mousedown', (event) => { from = event.button === 0 ? event.clientX : null; });
  plot.over.addEventListener('mouseup', (event) => {
    const isZoom = from === null || Math.abs(event.clientX - from) > kClick;
    from = null;
    if (isZoom) return;
    take(plot.posToVal(event.clientX - plot.over.getBoundingClientRect().left, 'x'));
  });
}

/** Around what there is; what differs by less than a thousandth of itself is a straight line. */
function range(_, low, high) {
  if (low == null) return [0, 1];
  const size = Math.max(Math.abs(low), Math.abs(high));
  if (high - low >= 1e-3 * size && high > low) return uPlot.rangeNum(low, high, 0.1, true);
  return [low - 0.05 * (size || 1), high + 0.05 * (size || 1)];
}

export class TimePlot {
  constructor(plot, host, width, height, key, shared) {
    const wide = shared && 0.05 * (shared.y[1] - shared.y[0] || 1);
    this.columns = plot.series.map((s) => ({ name: s.name, style: s.style, x: floats(s.x), y: floats(s.y) }));
    const series = [{ label: 't', value: (_, v) => (v == null ? '' : `${v.toFixed(3)} s`) }];
    const bands = [];
    let line = 0;
    for (const column of this.columns) {
      if (column.style === 'band') {
        bands.push({ series: [series.length, series.length + 1], fill: colours.band });
        const edge = { stroke: 'rgba(31,111,180,0.35)', width: 1, points: { show: false } };
        series.push({ label: column.name, value: (_, v) => shown(v), ...edge });
        series.push({ label: `-${column.name}`, value: (_, v) => shown(v), ...edge });
        continue;
      }
      // The truth of each axis lies beside the line of that axis, lighter.
      const truth = column.style === 'truth';
      const stroke = truth ? `${colours.lines[line++ % 3]}88` : colours.lines[this.strokeOf(column)];
      series.push({
        label: column.name,
        stroke,
        width: truth ? 3 : 1.5,
        dash: truth ? [4, 3] : undefined,
        value: (_, v) => shown(v),
        paths: column.style === 'points' ? () => null : undefined,
        points: column.style === 'points' ? { show: true, size: 5, fill: stroke } : { show: () => this.sparse(column) },
      });
    }
    this.plot = new uPlot(
      {
        width,
        height,
        series,
        bands,
        scales: {
          x: { time: false },
          y: { range: shared ? [shared.y[0] - wide, shared.y[1] + wide] : range },
        },
        axes: [
          { label: plot.x_label, labelSize: 18, size: 34, font: '11px system-ui', labelFont: '11px system-ui' },
          { label: plot.y_label, labelSize: 18, size: 58, font: '11px system-ui', labelFont: '11px system-ui' },
        ],
        cursor: { sync: { key }, drag: kZoomDrag, bind: zoomBy() },
        hooks: { setScale: [spreadZoom(key)] },
      },
      this.data(),
      host,
    );
    this.key = key;
    follow(key, this.plot);
  }

  strokeOf(column) {
    const own = this.columns.filter((c) => c.style !== 'truth' && c.style !== 'band');
    return own.indexOf(column) % colours.lines.length;
  }

  sparse(column) {
    return column.x.length < 60;
  }

  data() {
    const tables = this.columns.map((c) =>
      c.style === 'band' ? [c.x, c.y, c.y.map((y) => -y)] : [c.x, c.y]);
    const same = tables.every((t) => t[0].length === tables[0][0].length && t[0].every((x, i) => x === tables[0][0][i]));
    if (same && tables.length) return [tables[0][0], ...tables.flatMap((t) => t.slice(1))];
    return uPlot.join(tables.map((t) => t.map((column) => Array.from(column))));
  }

  count() {
    return this.columns.reduce((sum, c) => sum + c.x.length, 0);
  }

  append(series, replace) {
    for (const one of series) {
      const column = this.columns.find((c) => c.name === one.name);
      if (!column) continue;
      column.x = grown(column.x, floats(one.x), replace);
      column.y = grown(column.y, floats(one.y), replace);
    }
  }

  /** Shows what was appended. */
  refresh() {
    setDataOf(this.plot, this.key, this.data());
  }

  moment(t) {
    (this.mark ??= new Moment(this.plot, 'moment-line')).show(t);
  }

  atClick(take) {
    takeClicks(this.plot, take);
  }

  dispose() {
    unfollow(this.key, this.plot);
    this.plot.destroy();
  }

  resize(width, height) {
    this.plot.setSize({ width, height });
  }
}
