// Results of volumes of polygons over a base plane.

/** The results of a volume as rows of name, value and dimension; none until the server has computed it. */
export function volumeResults({ volume }) {
  if (!volume) return [];
  return [
    { name: 'Cut', value: volume.cut, dimension: 3 },
    { name: 'Fill', value: volume.fill, dimension: 3 },
    { name: 'Net', value: volume.cut - volume.fill, dimension: 3 },
    { name: 'Level area', value: volume.area, dimension: 2 },
    { name: 'Base height', value: volume.base, dimension: 1 },
    { name: 'Cell size', value: volume.cell_size, dimension: 1 },
    { name: 'Empty cells', value: 100 * volume.empty_fraction, dimension: 'percent' },
  ];
}
