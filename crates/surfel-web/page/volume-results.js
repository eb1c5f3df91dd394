// Volumes of polygons over a base plane: what they are made of, and their results.

/** Whether the base and cell size of a volume from a link are valid. */
export function isVolume({ base, cell_size }) {
  const isBase = base === 'lowest' || base === 'mean' || Number.isFinite(base);
  return isBase && (cell_size === undefined || (Number.isFinite(cell_size) && 0 < cell_size));
}

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
