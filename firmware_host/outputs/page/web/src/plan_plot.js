// Trajectories in a plane, both axes with one scale, coloured by a value along the way.

import uPlot from 'uplot';
import * as colours from './colours.js';
import { bounds, floats, grown } from './columns.js';
import { Moment } from './moment.js';

export class PlanPlot {
  constructor(plot, host, width, height) {
    this.columns = plot.series.map((s) => ({
      name: s.name, style: s.style, x: floats(s.x), y: floats(s.y), value: floats(s.value),
    }));
    this.legend = document.createElement('div');
    this.label = plot.value_label ?? '';
    this.axes = [plot.x_label, plot.y_label].map((label) => 'xyz'.indexOf(label[0])); // "x [m]"
    const font = { font: '11px system-ui', labelFont: '11px system-ui', labelSize: 18 };
    this.plot = new uPlot(
      {
        mode: 2,
        width,
        height,
        legend: { show: false },
        scales: { x: { time: false }, y: {} },
        axes: [{ label: plot.x_label, size: 34, ...font }, { label: plot.y_label, size: 58, ...font }],
        series: [
          {},
          ...this.columns.map((_, i) => ({
            facets: [{ scale: 'x', auto: true }, { scale: 'y', auto: true }],
            paths: (u) => this.draw(u, i),
          })),
        ],
        cursor: {
          points: { show: false },
          drag: { x: true, y: true, setScale: false },
          bind: { dblclick: () => () => this.showAll() },
        },
        hooks: { setSelect: [(u) => this.zoom(u)] },
      },
      this.data(),
      host,
    );
    host.append(this.legend);
    this.scale();
    this.showAll();
  }

  data() {
    return [null, ...this.columns.map((c) => [c.x, c.y])];
  }

  scale() {
    this.range = bounds(this.columns.map((c) => c.value));
    this.legend.replaceChildren();
    if (this.columns.some((c) => c.value.length)) {
      this.legend.append(colours.scaleLegend(this.label, ...this.range));
    }
  }

  /** The scales that show the box, widened to one scale for both axes. */
  show(x, y) {
    const { width, height } = this.plot.bbox;
    const per = Math.max((x[1] - x[0]) / width, (y[1] - y[0]) / height, 1e-6);
    const around = (range, size) => {
      const middle = (range[0] + range[1]) / 2;
      return { min: middle - (per * size) / 2, max: middle + (per * size) / 2 };
    };
    this.plot.batch(() => {
      this.plot.setScale('x', around(x, width));
      this.plot.setScale('y', around(y, height));
    });
  }

  showAll() {
    this.zoomed = false;
    const wide = ([low, high]) => [low - 0.05 * (high - low) - 0.01, high + 0.05 * (high - low) + 0.01];
    this.show(wide(bounds(this.columns.map((c) => c.x))), wide(bounds(this.columns.map((c) => c.y))));
  }

  zoom(u) {
    const { left, top, width, height } = u.select;
    if (width < 5 || height < 5) return;
    const x = [u.posToVal(left, 'x'), u.posToVal(left + width, 'x')];
    const y = [u.posToVal(top + height, 'y'), u.posToVal(top, 'y')];
    u.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
    this.zoomed = true;
    this.show(x, y);
  }

  draw(u, index) {
    const column = this.columns[index];
    const { ctx } = u;
    const ratio = devicePixelRatio;
    ctx.save();
    ctx.beginPath();
    ctx.rect(u.bbox.left, u.bbox.top, u.bbox.width, u.bbox.height);
    ctx.clip();
    ctx.lineCap = 'round';
    ctx.lineWidth = (column.style === 'truth' ? 4 : 2) * ratio;
    const [low, high] = this.range;
    const px = (i) => u.valToPos(column.x[i], 'x', true);
    const py = (i) => u.valToPos(column.y[i], 'y', true);
    const plain = column.style === 'truth' ? '#cfcfcf' : colours.lines[index % colours.lines.length];
    if (column.style === 'points') {
      ctx.fillStyle = colours.lines[3];
      for (let i = 0; i < column.x.length; ++i) {
        ctx.fillRect(px(i) - 1.5 * ratio, py(i) - 1.5 * ratio, 3 * ratio, 3 * ratio);
      }
    } else {
      // One stroke for each run of pieces of one colour.
      let colour = '';
      for (let i = 1; i < column.x.length; ++i) {
        const share = Math.round(((column.value[i] - low) / (high - low || 1)) * 32) / 32;
        const next = column.value.length ? colours.css(colours.ramp(share)) : plain;
        if (next !== colour) {
          if (colour) ctx.stroke();
          ctx.beginPath();
          ctx.strokeStyle = next;
          ctx.moveTo(px(i - 1), py(i - 1));
          colour = next;
        }
        ctx.lineTo(px(i), py(i));
      }
      if (colour) ctx.stroke();
    }
    ctx.restore();
    return null;
  }

  /** A dot where the vehicle is. */
  moment(_, pose) {
    const [across, up] = this.axes;
    (this.mark ??= new Moment(this.plot, 'moment-dot')).show(pose?.[across], pose?.[up]);
  }

  count() {
    return this.columns.reduce((sum, c) => sum + c.x.length, 0);
  }

  append(series, replace) {
    for (const one of series) {
      const column = this.columns.find((c) => c.name === one.name);
      if (!column) continue;
      for (const key of ['x', 'y', 'value']) column[key] = grown(column[key], floats(one[key]), replace);
    }
  }

  /** Shows what was appended, all of it unless somebody looks at a part. */
  refresh() {
    this.scale();
    this.plot.setData(this.data(), false);
    if (this.zoomed) this.plot.redraw(true);
    else this.showAll();
  }

  dispose() {
    this.plot.destroy();
  }

  resize(width, height) {
    this.plot.setSize({ width, height });
    this.showAll();
  }
}
