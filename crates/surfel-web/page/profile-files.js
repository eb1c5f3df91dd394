// Height profiles as files: their points as CSV, their chart as SVG.

import { rounded } from './format.js';
import { MARGIN } from './profile.js';

/** The points of a profile as comma-separated values, with a line of names. Coordinates and heights are those of the files. */
export function csvOf({ distances, offsets, heights, positions, colors }) {
  const rows = distances.map((distance, i) => [distance, offsets[i], heights[i], ...positions[i], ...colors[i]].join(','));
  return `distance,offset,height,x,y,z,red,green,blue\n${rows.join('\n')}\n`;
}

/** The chart of a profile as the text of an SVG file. */
export function svgOf(profile, chart, unit) {
  const { width, height, x, y } = chart;
  const short = (value) => value.toFixed(1);
  const text = (label, at, anchor) => `<text x="${short(at.x)}" y="${short(at.y)}" text-anchor="${anchor}">${label}</text>`;
  const line = (from, to) => `<path d="M${short(from.x)} ${short(from.y)}L${short(to.x)} ${short(to.y)}"/>`;
  const [left, right, bottom] = [MARGIN.left, width - MARGIN.right, height - MARGIN.bottom];
  const grid = [
    ...chart.xTicks.map((tick) => line({ x: x(tick), y: MARGIN.top }, { x: x(tick), y: bottom })),
    ...chart.yTicks.map((tick) => line({ x: left, y: y(tick) }, { x: right, y: y(tick) })),
  ];
  const labels = [
    ...chart.xTicks.map((tick) => text(rounded(tick), { x: x(tick), y: bottom + 16 }, 'middle')),
    ...chart.yTicks.map((tick) => text(rounded(tick, chart.digits), { x: left - 6, y: y(tick) + 4 }, 'end')),
    text(unit ?? '', { x: right, y: bottom + 26 }, 'end'),
  ];
  const dots = profile.distances.map((distance, i) =>
    `<circle cx="${short(x(distance))}" cy="${short(y(profile.heights[i]))}" r="0.9" fill="rgb(${profile.colors[i].join(' ')})"/>`);
  return `<svg xmlns="http://www.w3.org/2000/svg" width="${width}" height="${height}" font-family="sans-serif" font-size="11">
<rect width="100%" height="100%" fill="#fff"/>
<g stroke="#ddd" fill="none">${grid.join('')}</g>
${dots.join('\n')}
<g fill="#333">${labels.join('')}</g>
</svg>
`;
}
