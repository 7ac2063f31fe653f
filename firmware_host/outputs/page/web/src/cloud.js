// The map's surface as points, each of a colour of its own.

import { BufferAttribute, BufferGeometry, Points, PointsMaterial } from 'three';
import { bytes, shorts } from './columns.js';
import { grey, height, labelColours, kUnlabelled } from './surface_colours.js';

export class Cloud {
  constructor(data, labels) {
    this.data = data;
    this.labels = labelColours(labels);
    this.label = bytes(data.labels);
    this.grey = bytes(data.grey);
    const whole = shorts(data.points);
    const positions = new Float32Array(whole.length);
    for (let i = 0; i < whole.length; ++i) {
      positions[i] = data.low[i % 3] + (whole[i] / 65535) * data.size[i % 3];
    }
    this.geometry = new BufferGeometry();
    this.geometry.setAttribute('position', new BufferAttribute(positions, 3));
    this.geometry.setAttribute('color', new BufferAttribute(new Float32Array(positions.length), 3));
    this.object = new Points(this.geometry, new PointsMaterial({ vertexColors: true, size: 2.5, sizeAttenuation: false }));
  }

  ways() {
    return [...(this.label.length ? ['label'] : []), ...(this.grey.length ? ['as seen'] : []), 'height'];
  }

  colour(way, heights) {
    const positions = this.geometry.attributes.position.array;
    const target = this.geometry.attributes.color;
    const chosen = this.ways().includes(way) ? way : this.ways()[0];
    const ramp = height(heights);
    for (let i = 0; i < positions.length / 3; ++i) {
      let rgb;
      if (chosen === 'label') rgb = this.label[i] ? this.labels[this.label[i] - 1] ?? kUnlabelled : kUnlabelled;
      else if (chosen === 'height') rgb = ramp(positions[3 * i + 2]);
      else rgb = grey(this.grey[i]);
      target.array.set(rgb, 3 * i);
    }
    target.needsUpdate = true;
  }
}
