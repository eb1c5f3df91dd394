// Numbers as text: coordinates with all significant digits, other numbers rounded.

/** Six decimals, or seven digits of small values: the precision of files, without the rounding error of doubles. */
export function exact(value) {
  if (typeof value !== 'number' || Number.isInteger(value) || !Number.isFinite(value)) return String(value);
  const whole = Math.max(1, Math.floor(Math.log10(Math.abs(value))) + 1);
  return String(Number(value.toPrecision(Math.min(15, whole + 6))));
}

/** A number with at most nine digits. One that the server holds with single precision has as few as tell it apart. */
export function shortest(value) {
  if (Math.fround(value) !== value) return Number(value.toPrecision(9));
  return [6, 7, 8].map((digits) => Number(value.toPrecision(digits))).find((short) => Math.fround(short) === value)
    ?? Number(value.toPrecision(9));
}

/** A coordinate with the decimals of its file, or with those that it has. */
export function coordinate(value, decimals) {
  return typeof decimals === 'number' ? value.toFixed(decimals) : String(value);
}

/** A value with its unit behind it, if it has one. */
export function withUnit(value, unit) {
  return unit ? `${value}\u00a0${unit}` : value;
}

/** About five digits, with thousands separators. */
export function rounded(value, digits = 5) {
  const whole = Math.abs(value) < 1 ? 0 : Math.floor(Math.log10(Math.abs(value))) + 1;
  const maximumFractionDigits = Math.min(8, Math.max(0, digits - Math.max(whole, 1)));
  return withSeparators(value, { maximumFractionDigits });
}

/** A length, area or volume with about six digits, also if it is small. */
export function measured(value) {
  return Math.abs(value) < 1 ? withSeparators(Number(value.toPrecision(6)), { maximumFractionDigits: 12 }) : rounded(value, 6);
}

export function count(value) {
  return withSeparators(value, { maximumFractionDigits: 0 });
}

/** A number of things: `1 point`, `12 points`. */
export function counted(n, thing) {
  return `${count(n)} ${thing}${n === 1 ? '' : 's'}`;
}

/** A duration in seconds as text: `2.4 s`, `3 min 20 s`. */
export function duration(seconds) {
  if (seconds < 10) return `${seconds.toFixed(1)} s`;
  const whole = Math.round(seconds);
  if (whole < 60) return `${whole} s`;
  if (whole < 3600) return `${Math.floor(whole / 60)} min ${whole % 60} s`;
  return `${Math.floor(whole / 3600)} h ${Math.floor((whole % 3600) / 60)} min`;
}

/** The size of a file as text: `640 B`, `12.3 MB`. */
export function fileSize(bytes) {
  const power = bytes < 1000 ? 0 : Math.min(4, Math.floor(Math.log10(bytes) / 3));
  return withUnit(rounded(bytes / 1000 ** power, 3), ['B', 'kB', 'MB', 'GB', 'TB'][power]);
}

/** About `nTicks` round numbers between two ends, for a scale. */
export function ticks(low, high, nTicks) {
  const raw = (high - low) / nTicks;
  if (!(0 < raw) || !Number.isFinite(raw)) return [];
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((factor) => factor * power).find((size) => raw <= size * 1.0001);
  const first = Math.ceil(low / step - 1e-9);
  const last = Math.floor(high / step + 1e-9);
  return Array.from({ length: last - first + 1 }, (_, i) => Number(((first + i) * step).toPrecision(12)));
}

function withSeparators(value, options) {
  // Thin spaces: many readers take commas for decimal signs.
  return value.toLocaleString('en-US', options).replaceAll(',', '\u202f');
}

/** A file's name without folder and extensions. */
export const stemOf = (name) => name.replace(/^.*[/\\]/, '').replace(/\..*$/, '') || 'picture';
