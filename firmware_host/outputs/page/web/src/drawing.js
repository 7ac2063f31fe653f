// A picture that the program has drawn itself, as SVG: fields over an image, logarithmic axes.

import { element } from './tables.js';

export class Drawing {
  constructor(plot, host, width) {
    this.holder = element('div', null, 'drawing');
    // The program's own markup; text in it is escaped there.
    this.holder.innerHTML = plot.svg;
    this.holder.style.width = `${Math.min(width, 720)}px`;
    host.append(this.holder);
  }

  count() {
    return this.holder.querySelectorAll('svg path, svg rect, svg circle').length;
  }

  /** A drawing takes nothing more. */
  append() {}
  refresh() {}
  dispose() {}
}
