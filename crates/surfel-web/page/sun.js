// Sun positions by the approximation of NOAA's solar calculator (after Meeus), accurate to about 0.01 degrees.

const RADIANS = Math.PI / 180;
const sine = (angle_deg) => Math.sin(angle_deg * RADIANS);
const cosine = (angle_deg) => Math.cos(angle_deg * RADIANS);
const wrapped = (angle_deg) => ((angle_deg % 360) + 360) % 360;

/**
 * Azimuth (clockwise from north) and elevation of the sun in degrees, at `time_ms` (as `Date` counts, UTC)
 * for a place with this latitude (north) and longitude (east) in degrees.
 */
export function sunPosition(time_ms, latitude, longitude) {
  const { declination, equationOfTime_min } = sunOf(time_ms);
  const minutesOfDay = (((time_ms / 60000) % 1440) + 1440) % 1440;
  const hourAngle = wrapped((minutesOfDay + equationOfTime_min) / 4 + longitude) - 180;
  const height =
    sine(latitude) * sine(declination) + cosine(latitude) * cosine(declination) * cosine(hourAngle);
  const east = -cosine(declination) * sine(hourAngle);
  const north =
    cosine(latitude) * sine(declination) - sine(latitude) * cosine(declination) * cosine(hourAngle);
  const elevation = Math.asin(Math.min(1, Math.max(-1, height))) / RADIANS;
  return {
    azimuth: wrapped(Math.atan2(east, north) / RADIANS),
    elevation: elevation + refraction(elevation),
  };
}

/** Azimuth and elevation of the sun on a day (`yyyy-mm-dd`) at an hour of local mean solar time: noon is about 12. */
export function sunAtHour(day, hour, latitude) {
  return sunPosition(Date.parse(`${day}T00:00:00Z`) + hour * 3600000, latitude, 0);
}

/** Declination in degrees, and the equation of time (apparent minus mean solar time) in minutes. */
function sunOf(time_ms) {
  const century = (time_ms / 86400000 + 2440587.5 - 2451545) / 36525;
  const meanLongitude = wrapped(280.46646 + century * (36000.76983 + century * 0.0003032));
  const anomaly = 357.52911 + century * (35999.05029 - century * 0.0001537);
  const eccentricity = 0.016708634 - century * (0.000042037 + century * 0.0000001267);
  const center =
    sine(anomaly) * (1.914602 - century * (0.004817 + century * 0.000014)) +
    sine(2 * anomaly) * (0.019993 - century * 0.000101) + sine(3 * anomaly) * 0.000289;
  const node = 125.04 - 1934.136 * century;
  const longitude = meanLongitude + center - 0.00569 - 0.00478 * sine(node);
  const seconds = 21.448 - century * (46.815 + century * (0.00059 - century * 0.001813));
  const obliquity = 23 + (26 + seconds / 60) / 60 + 0.00256 * cosine(node);
  const half = Math.tan((obliquity / 2) * RADIANS) ** 2;
  const equation_rad =
    half * sine(2 * meanLongitude) - 2 * eccentricity * sine(anomaly) +
    4 * eccentricity * half * sine(anomaly) * cosine(2 * meanLongitude) -
    0.5 * half * half * sine(4 * meanLongitude) - 1.25 * eccentricity * eccentricity * sine(2 * anomaly);
  return {
    declination: Math.asin(sine(obliquity) * sine(longitude)) / RADIANS,
    equationOfTime_min: (4 * equation_rad) / RADIANS,
  };
}

/** Atmospheric refraction at an elevation, in degrees. */
function refraction(elevation) {
  if (85 < elevation) return 0;
  const tangent = Math.tan(elevation * RADIANS);
  let seconds;
  if (5 < elevation) seconds = 58.1 / tangent - 0.07 / tangent ** 3 + 0.000086 / tangent ** 5;
  else if (-0.575 < elevation) {
    seconds = 1735 + elevation * (-518.2 + elevation * (103.4 + elevation * (-12.79 + elevation * 0.711)));
  } else seconds = -20.772 / tangent;
  return seconds / 3600;
}
