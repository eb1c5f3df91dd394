// The tools that measure and annotate: the figures that clicks make.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { MeasureTool } from '../page/measure-tool.js';
import { signal } from '../page/signal.js';

function tool() {
  const viewer = { tool: 'navigate', toolChanged: signal() };
  const shown = [];
  const measureTool = new MeasureTool(viewer, { redraw() {} }, (i) => shown.push(i));
  const click = (kind, ...points) => {
    viewer.tool = kind;
    points.forEach((point) => measureTool.add(point));
  };
  return { measureTool, click, shown };
}

test('a click pins an annotation to a point, and its text is no number of other figures', () => {
  const { measureTool, click } = tool();
  click('annotation', [1, 2, 3]);
  const [annotation] = measureTool.figures;
  assert.deepEqual(annotation, { kind: 'annotation', name: 'annotation 1', points: [[1, 2, 3]] });
  measureTool.replace(annotation, { ...annotation, name: 'built in 1850' });
  click('distance', [0, 0, 0], [3, 4, 0]);
  click('annotation', [5, 5, 5]);
  assert.deepEqual(measureTool.figures.map(({ name }) => name), ['built in 1850', 'distance 1', 'annotation 2']);
});

test('nothing is loaded before there is a figure or its first point', () => {
  const { measureTool, click, shown } = tool();
  measureTool.figures = [];
  assert.deepEqual(shown, []);
  click('polyline', [0, 0, 0]);
  assert.equal(shown.length, 1);
  click('polyline', [1, 0, 0]);
  assert.equal(shown.length, 1);
  measureTool.finish();
  assert.deepEqual([shown.length, measureTool.figures.length], [2, 1]);
  measureTool.figures = [];
  assert.equal(shown.length, 3);
});
