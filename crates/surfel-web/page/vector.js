// Vectors as arrays of three numbers, and rotations between frames of three axes.

export const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
export const subtract = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const scale = (a, factor) => [a[0] * factor, a[1] * factor, a[2] * factor];
/** `a` and `factor` times `b`. */
export const addScaled = (a, b, factor) => add(a, scale(b, factor));
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const length = (a) => Math.hypot(a[0], a[1], a[2]);
export const distance = (a, b) => length(subtract(a, b));
export const mix = (a, b, t) => addScaled(scale(a, 1 - t), b, t);

export const cross = (a, b) => [
  a[1] * b[2] - a[2] * b[1],
  a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0],
];

/** `a` scaled to length 1; null if it is zero. */
export function normalize(a) {
  const size = length(a);
  return 1e-12 < size ? scale(a, 1 / size) : null;
}

/** A unit vector perpendicular to `a`. */
export function perpendicular(a) {
  const axis = Math.abs(a[0]) < 0.9 * length(a) ? [1, 0, 0] : [0, 1, 0];
  return normalize(cross(a, axis));
}

/** `a` rotated about the unit vector `axis`, counter-clockwise seen from its tip. */
export function rotate(a, axis, angle_rad) {
  const [cosine, sine] = [Math.cos(angle_rad), Math.sin(angle_rad)];
  const parallel = scale(axis, dot(axis, a) * (1 - cosine));
  return add(addScaled(parallel, a, cosine), scale(cross(axis, a), sine));
}

/** Axis and angle of the rotation from one frame of unit axes to another. */
export function rotationBetween(from, to) {
  // The columns of the rotation matrix are the images of x, y and z.
  const column = (i) => from.reduce((sum, axis, k) => addScaled(sum, to[k], axis[i]), [0, 0, 0]);
  const [x, y, z] = [column(0), column(1), column(2)];
  const twiceSine = [y[2] - z[1], z[0] - x[2], x[1] - y[0]];
  const angle_rad = Math.atan2(length(twiceSine), x[0] + y[1] + z[2] - 1);
  const axis = normalize(twiceSine);
  if (axis && angle_rad < 3.1) return { axis, angle_rad };
  // For half a turn the sine is zero, and R + 1 is twice the outer product of the axis.
  const candidates = [add(x, [1, 0, 0]), add(y, [0, 1, 0]), add(z, [0, 0, 1])];
  candidates.sort((a, b) => length(b) - length(a));
  const half = normalize(candidates[0]);
  return { axis: axis && dot(axis, half) < 0 ? scale(half, -1) : half, angle_rad };
}
