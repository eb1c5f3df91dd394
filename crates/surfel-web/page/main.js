// The page's beginning: makes the parts and joins them.

import { animationRows } from './animation.js';
import { clipPainter, grabHandle } from './clip-handles.js';
import * as controls from './controls.js';
import { element } from './dom.js';
import { exposeState } from './hooks.js';
import { followKeys, KEY_HELP, MOUSE_HELP } from './keyboard.js';
import { colormapPreview, followLegend } from './legend.js';
import { patchOfHash } from './link.js';
import { MEASURE_TOOLS, MeasureTool } from './measure-tool.js';
import { Navigation } from './navigation.js';
import { Overlay, pivotPainter } from './overlay.js';
import { controlRows, section } from './panel.js';
import { PickCard } from './pick-card.js';
import { Picture } from './picture.js';
import { followPointer } from './pointer.js';
import { prepareSaveDialog } from './save-dialog.js';
import { followStatus, statisticsTable } from './status.js';
import { sunClock } from './sun-clock.js';
import { followLoading, prepareTakeDialog } from './take-dialog.js';
import { followConnection, showToast } from './toast.js';
import { followToolbar } from './toolbar.js';
import { Viewer } from './viewer.js';
import { viewRows } from './view-section.js';

const viewer = new Viewer(patchOfHash(location.hash) ?? {});
const navigation = new Navigation(viewer);
const stage = document.getElementById('stage');
const overlay = new Overlay(document.getElementById('overlay'), viewer);
const pickCard = new PickCard(viewer, overlay);
const measureTool = new MeasureTool(viewer, overlay);
overlay.add(clipPainter(viewer));
overlay.add(pivotPainter(navigation));

/** What was last asked of the picture. */
let lastPick = null;

const helpDialog = document.getElementById('help-dialog');
const showHelp = () => helpDialog.showModal();
const saveDialog = prepareSaveDialog(viewer);
const takeDialog = prepareTakeDialog(viewer);

followConnection(viewer);
followStatus(viewer);
followLegend(viewer);
followLoading(viewer);
followToolbar(viewer, navigation, { save: saveDialog, take: takeDialog, help: showHelp });
fillPanel();
fillHelp();

followPointer(stage, viewer, navigation, {
  grab: (event, place) => grabHandle(viewer, event, place),
  hover: (place) => measureTool.hover(inCssPixels(place)),
  async click(place, event) {
    const { tool } = viewer;
    const isMeasuring = MEASURE_TOOLS.includes(tool) && !event.altKey;
    if (!isMeasuring && tool !== 'pick' && !event.altKey) return;
    lastPick = pickAfter(lastPick, place);
    const point = await lastPick;
    if (viewer.tool !== tool) return;
    if (!point) showToast('Nothing is there.');
    else if (isMeasuring) measureTool.add(point.kind === 'point' ? point.position : point.surface);
    else pickCard.show(point);
  },
  async doubleClick(place) {
    if (viewer.tool === 'area') {
      await finishArea();
      return;
    }
    const point = await viewer.pick(place);
    if (point) navigation.centerOn(point.surface);
  },
});

followKeys(viewer, navigation, {
  help: showHelp,
  enter: finishArea,
  escape() {
    if (navigation.turntable_secs) navigation.stop();
    else if (measureTool.isUnderway) measureTool.cancel();
    else if (viewer.tool !== 'look') viewer.use('look');
    else if (pickCard.isOpen) pickCard.close();
  },
});

new Picture(document.getElementById('picture'), viewer);
exposeState(viewer);
viewer.connect();

/** Asked for at once, told in the order of the clicks. */
async function pickAfter(before, place) {
  const asked = viewer.pick(place);
  await before;
  return asked;
}

/** The last corner may still be on its way. */
async function finishArea() {
  await lastPick;
  measureTool.finish();
}

function inCssPixels({ x, y }) {
  const factor = stage.clientWidth / viewer.size.width;
  return { x: x * factor, y: y * factor };
}

function fillPanel() {
  const rows = (table) => controlRows(table, viewer);
  const materials = section('Materials', false);
  viewer.infoChanged.listen(() => {
    const isFilled = materials.dataset.of === viewer.info.name;
    materials.dataset.of = viewer.info.name;
    if (isFilled) return;
    const tables = viewer.info.objects.map((object) => controls.materialControls(object));
    materials.querySelector('.section-body').replaceChildren(...tables.flatMap(rows));
  });
  const animation = section('Animation', true, ...animationRows(viewer, () => animation));
  document.getElementById('sections').append(
    animation,
    section('Surface', true, ...rows(controls.surfaceControls)),
    section('Colour', true, ...withPreview(rows(controls.colorControls))),
    section('Sun', true, ...rows(controls.sunControls), sunClock(viewer)),
    section('Sky', true, ...rows(controls.skyControls)),
    section('Picture', false, ...rows(controls.pictureControls)),
    section('View', false, ...viewRows(viewer, navigation)),
    section('Clipping', false, ...rows(controls.clipControls)),
    materials,
    section('Statistics', false, statisticsTable(viewer)));
}

/** The stripe of the colour map stands under its choice. */
function withPreview([source, map, ...others]) {
  return [source, map, colormapPreview(viewer), ...others];
}

function fillHelp() {
  const table = (title, rows) => element('section', {}, element('h3', {}, title), element('dl', { class: 'keys' },
    ...rows.flatMap(([keys, what]) => [element('dt', {}, keys), element('dd', {}, what)])));
  document.getElementById('help-tables').append(table('Mouse and fingers', MOUSE_HELP), table('Keys', KEY_HELP));
  document.getElementById('help-close').addEventListener('click', () => helpDialog.close());
}
