// The chosen moment on a plot: a line over time, or a dot in a plane, that stays where it is when the plot is zoomed.

import { element } from './tables.js';

const kRounding = 1; // px: the run's ends are in sight

export class Moment {
  constructor(plot, className) {
    this.plot = plot;
    this.mark = element('div', null, className);
    plot.over.append(this.mark);
    (plot.hooks.setScale ??= []).push(() => this.place());
  }

  /** `y`: null for a line. */
  show(x, y = null) {
    this.x = x;
    this.y = y;
    this.place();
  }

  place() {
    const left = this.x == null ? NaN : this.plot.valToPos(this.x, 'x');
    const top = this.y == null ? 0 : this.plot.valToPos(this.y, 'y');
    const within = (at, size) => at >= -kRounding && at <= size + kRounding;
    const inside = within(left, this.plot.over.clientWidth) && within(top, this.plot.over.clientHeight);
    this.mark.style.display = inside ? 'block' : 'none';
    if (inside) this.mark.style.transform = `translate(${left}px, ${top}px)`;
  }
}
