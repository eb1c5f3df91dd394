// Test data: a small town scanned in national-grid coordinates, a house as a mesh, and animated scenes.

import { mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';

const ORIGIN = [562316.125, 4183187.5, 148];
const SIDE = 142;
const SPACING = 0.25;
/** Resolution of the coordinates in the files. */
export const RESOLUTION = 0.001;

const roundTo = (decimals, value) => Number(value.toFixed(decimals));

/** A generator of reproducible numbers from 0 to 1 (Mulberry32, by T. Ettinger). */
function randomNumbers(seed) {
  return () => {
    seed = (seed + 0x6d2b79f5) | 0;
    let t = Math.imul(seed ^ (seed >>> 15), 1 | seed);
    t = (t + Math.imul(t ^ (t >>> 7), 61 | t)) ^ t;
    return ((t ^ (t >>> 14)) >>> 0) / 2 ** 32;
  };
}

/** About 20,000 points, each as an object with the columns of the file. */
function townPoints() {
  const random = randomNumbers(7);
  return Array.from({ length: SIDE * SIDE }, (_, i) => {
    const [east, north] = [i % SIDE, Math.floor(i / SIDE)].map((step) => SPACING * (step + 0.4 * (random() - 0.5)));
    const isRoof = 8 < east && east < 14 && 12 < north && north < 20;
    const height = isRoof ? 6 : 2 * Math.sin(east / 5) * Math.cos(north / 7);
    return {
      x: roundTo(3, ORIGIN[0] + east), y: roundTo(3, ORIGIN[1] + north), z: roundTo(3, ORIGIN[2] + height),
      red: isRoof ? 190 : Math.floor(60 + 4 * east), green: isRoof ? 80 : Math.floor(200 - 2 * north), blue: Math.floor(256 * random()),
      intensity: Math.floor(65536 * random()), classification: isRoof ? 6 : 2, gps_time: roundTo(4, 318000 + i / 1000),
    };
  });
}

const COLUMNS = {
  x: 'double', y: 'double', z: 'double', red: 'uchar', green: 'uchar', blue: 'uchar',
  intensity: 'ushort', classification: 'uchar', gps_time: 'double',
};

function ply(points) {
  const properties = Object.entries(COLUMNS).map(([name, type]) => `property ${type} ${name}`);
  const header = ['ply', 'format ascii 1.0', `element vertex ${points.length}`, ...properties, 'end_header'];
  const rows = points.map((point) => Object.keys(COLUMNS).map((name) => point[name]).join(' '));
  return [...header, ...rows, ''].join('\n');
}

/** A box without a floor next to the roof; its faces point outward. */
function houseObj() {
  const [x, y, z] = ORIGIN;
  const corners = [[20, 6, -3], [26, 6, -3], [26, 12, -3], [20, 12, -3], [20, 6, 5], [26, 6, 5], [26, 12, 5], [20, 12, 5]];
  const faces = ['5 6 7 8', '1 2 6 5', '2 3 7 6', '3 4 8 7', '4 1 5 8'];
  return [...corners.map(([a, b, c]) => `v ${x + a} ${y + b} ${z + c}`), ...faces.map((face) => `f ${face}`), ''].join('\n');
}

/** The places of the scanners in the room. */
export const STATIONS = [[2, 2, 1.5], [8, 3, 1.5]];

/** A room of 10 x 5 x 3, scanned from both stations. */
function roomPtx() {
  const [columns, rows] = [90, 45];
  const size = [10, 5, 3];
  const scan = (station) => {
    const cells = Array.from({ length: columns * rows }, (_, i) => {
      const azimuth = (2 * Math.PI * Math.floor(i / rows)) / columns;
      const elevation = Math.PI * ((i % rows + 0.5) / rows - 0.5);
      const direction = [Math.cos(azimuth) * Math.cos(elevation), Math.sin(azimuth) * Math.cos(elevation), Math.sin(elevation)];
      const toWall = direction.map((part, axis) => ((0 < part ? size[axis] : 0) - station[axis]) / part);
      const range = Math.min(...toWall.filter((length) => 0 < length));
      return `${direction.map((part) => (range * part).toFixed(4)).join(' ')} 0.5`;
    });
    const [x, y, z] = station;
    return [columns, rows, `${x} ${y} ${z}`, '1 0 0', '0 1 0', '0 0 1', '1 0 0 0', '0 1 0 0', '0 0 1 0', `${x} ${y} ${z} 1`, ...cells].join('\n');
  };
  return `${STATIONS.map(scan).join('\n')}\n`;
}

const MOVING_TOML = `
color = "rgb"

[[object]]
name = "town"
file = "town.ply"

[[object]]
name = "house"
file = "house.obj"
material = { kind = "plastic", color = "#c04020" }

[[animation]]
object = "house"
times = [0, 2]
translate = [[0, 0, 0], [-9, 9, 3]]
`;

const ORBIT_TOML = `
color = "rgb"

[[object]]
file = "town.ply"

[[animation]]
object = "camera"
kind = "orbit"
seconds = 4
`;

/** The town rises by 20 within two seconds. */
const RISING_TOML = `
[[object]]
name = "town"
file = "town.ply"

[[animation]]
object = "town"
times = [0, 2]
translate = [[0, 0, 0], [0, 0, 20]]
`;

/** A triangle, and a camera that passes it: its distance goes from 6 to 4 within two seconds. */
function pastGltf() {
  const floats = [-1, 0, 0, 1, 0, 0, 0, 2, 0, /* times */ 0, 2, /* positions */ 0, 1, 6, 3, 1, 4];
  const uri = `data:;base64,${Buffer.from(new Float32Array(floats).buffer).toString('base64')}`;
  const view = (byteOffset, byteLength) => ({ buffer: 0, byteOffset, byteLength });
  const accessor = (bufferView, count, type, min, max) => ({ bufferView, componentType: 5126, count, type, min, max });
  return JSON.stringify({
    asset: { version: '2.0' }, scene: 0, scenes: [{ nodes: [0, 1] }],
    nodes: [{ mesh: 0 }, { name: 'past', camera: 0, translation: [0, 1, 6] }],
    meshes: [{ primitives: [{ attributes: { POSITION: 0 } }] }],
    cameras: [{ type: 'perspective', perspective: { yfov: 0.7, znear: 0.1 } }],
    animations: [{ channels: [{ sampler: 0, target: { node: 1, path: 'translation' } }], samplers: [{ input: 1, output: 2 }] }],
    accessors: [accessor(0, 3, 'VEC3', [-1, 0, 0], [1, 2, 0]), accessor(1, 2, 'SCALAR', [0], [2]), accessor(2, 2, 'VEC3')],
    bufferViews: [view(0, 36), view(36, 8), view(44, 24)], buffers: [{ byteLength: 68, uri }],
  });
}

/** Writes all files into a new folder. */
export function makeData() {
  const folder = mkdtempSync(join(tmpdir(), 'surfel-browser-'));
  const points = townPoints();
  const files = {
    'town.ply': ply(points), 'house.obj': houseObj(), 'moving.toml': MOVING_TOML, 'orbit.toml': ORBIT_TOML, 'rising.toml': RISING_TOML, 'past.gltf': pastGltf(), 'room.ptx': roomPtx(),
  };
  for (const [name, text] of Object.entries(files)) writeFileSync(join(folder, name), text);
  return { folder, points, remove: () => rmSync(folder, { recursive: true, force: true }) };
}
