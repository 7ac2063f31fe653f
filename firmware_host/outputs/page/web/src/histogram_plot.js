// Counts in columns on a logarithmic axis of time, with the budgets as lines across.

import uPlot from 'uplot';
import * as colours from './colours.js';
import { bounds, floats } from './columns.js';

const kStep = 10 ** (1 / 20); // summary.json has 20 columns a decade

/** 1, 2 or 5 times a power of ten. */
function isRound(value) {
  const mantissa = value / 10 ** Math.floor(Math.log10(value) + 1e-9);
  return [1, 2, 5].some((round) => Math.abs(mantissa - round) < 1e-6);
}

export class HistogramPlot {
  constructor(plot, host, width, height, key, shared) {
    this.shared = shared;
    this.markers = plot.markers ?? [];
    this.take(plot.series);
    const font = { font: '11px system-ui', labelFont: '11px system-ui', labelSize: 18 };
    const count = { value: (_, v) => (v == null ? '' : v) };
    this.plot = new uPlot(
      {
        width,
        height,
        scales: {
          x: { time: false, distr: 3, range: () => this.xRange() },
          // From half a duration on, so that a single late one is seen.
          y: { distr: 3, range: () => [0.5, 1.5 * Math.max(2, this.most)] },
        },
        axes: [
          {
            label: plot.x_label,
            size: 34,
            ...font,
            filter: (_, splits) => splits,
            values: (_, splits) => splits.map((v) => (isRound(v) ? String(Number(v.toPrecision(1))) : '')),
          },
          { label: plot.y_label, size: 58, ...font, values: (_, splits) => splits.map((v) => (v >= 1 && Number.isInteger(Math.log10(v)) ? String(v) : '')) },
        ],
        series: [
          { label: 'from', value: (_, v) => (v == null ? '' : `${v.toPrecision(3)} ms`) },
          ...this.columns.map((c, i) => ({
            label: c.name, stroke: colours.lines[i], fill: `${colours.lines[i]}66`, paths: () => null,
            points: { show: false }, ...count,
          })),
        ],
        hooks: { draw: [(u) => this.draw(u)] },
        cursor: { drag: { x: false, y: false } },
      },
      this.data(),
      host,
    );
  }

  take(series) {
    this.columns = series.map((s) => ({ name: s.name, x: floats(s.x), y: floats(s.y) }));
    this.most = bounds(this.columns.map((c) => c.y))[1];
  }

  data() {
    return uPlot.join(this.columns.map((c) => [Array.from(c.x), Array.from(c.y)]));
  }

  xRange() {
    const [low, high] = bounds([
      ...this.columns.map((c) => c.x), this.markers.map((m) => m.x), this.shared?.x ?? [],
    ]);
    return [low / kStep ** 2, high * kStep ** 3];
  }

  draw(u) {
    const { ctx, bbox } = u;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    const bottom = bbox.top + bbox.height;
    this.columns.forEach((column, i) => {
      ctx.fillStyle = `${colours.lines[i]}99`;
      for (let k = 0; k < column.x.length; ++k) {
        const left = u.valToPos(column.x[k], 'x', true);
        const right = u.valToPos(column.x[k] * kStep, 'x', true);
        const top = u.valToPos(column.y[k], 'y', true);
        ctx.fillRect(left, top, Math.max(right - left - 1, 1), bottom - top);
      }
    });
    ctx.strokeStyle = ctx.fillStyle = '#b03a3a';
    ctx.font = `${10 * devicePixelRatio}px system-ui`;
    ctx.setLineDash([4, 4]);
    this.markers.forEach((marker, i) => {
      const x = u.valToPos(marker.x, 'x', true);
      ctx.beginPath();
      ctx.moveTo(x, bbox.top);
      ctx.lineTo(x, bottom);
      ctx.stroke();
      ctx.textAlign = x > bbox.left + bbox.width - 60 * devicePixelRatio ? 'right' : 'left';
      ctx.fillText(marker.text.replace('budget ', ''), x + (ctx.textAlign === 'left' ? 3 : -3), bbox.top + (11 + 11 * i) * devicePixelRatio);
    });
    ctx.restore();
  }

  count() {
    return this.columns.reduce((sum, c) => sum + c.x.length, 0);
  }

  /** Counts replace what was there. */
  append(series) {
    this.take(series);
  }

  refresh() {
    this.plot.setData(this.data());
  }

  dispose() {
    this.plot.destroy();
  }

  resize(width, height) {
    this.plot.setSize({ width, height });
  }
}
