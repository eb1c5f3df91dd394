// GeoJSON (RFC 7946) of measurements, in the coordinates of the file, whose system the older member `crs` names.

import { exact } from './format.js';
import { resultsOf } from './measure.js';

/** A feature collection of measurements. */
export function geoJson(measurements, { up, epsg, unit }) {
  const features = measurements.map((figure) => {
    const results = resultsOf(figure, up).map(({ name, value }) => [name.toLowerCase().replaceAll(' ', '_'), Number(exact(value))]);
    return {
      type: 'Feature',
      properties: { name: figure.name, kind: figure.kind, ...(unit ? { unit } : {}), ...Object.fromEntries(results) },
      geometry: geometryOf(figure),
    };
  });
  const crs = epsg ? { crs: { type: 'name', properties: { name: `urn:ogc:def:crs:EPSG::${epsg}` } } } : {};
  return { type: 'FeatureCollection', ...crs, features };
}

function geometryOf({ kind, points }) {
  if (kind === 'area' || kind === 'volume') return { type: 'Polygon', coordinates: [[...points, points[0]]] };
  if (kind === 'annotation') return { type: 'Point', coordinates: points[0] };
  if (kind === 'circle') return { type: 'MultiPoint', coordinates: points };
  return { type: 'LineString', coordinates: points };
}
