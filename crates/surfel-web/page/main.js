// Entry point: creates the parts of the page and connects them.

import { animationRows } from './animation.js';
import { makeRoomForAnnotations } from './annotations.js';
import { setUpAxisCube } from './axis-cube.js';
import { clipPainter, grabHandle } from './clip-handles.js';
import * as controls from './controls.js';
import { Crosshair } from './crosshair.js';
import { CursorCoordinates } from './cursor-coordinates.js';
import { element } from './dom.js';
import { histogramRows } from './histogram-choice.js';
import { KEY_HELP, MOUSE_HELP, setUpKeyboard } from './keyboard.js';
import { colormapPreview, setUpLegend } from './legend.js';
import { readLink } from './link.js';
import { MEASURE_TOOLS, MeasureTool } from './measure-tool.js';
import { Navigation } from './navigation.js';
import { objectSection } from './object-controls.js';
import { Overlay, pivotPainter } from './overlay.js';
import { Panel, section } from './panel.js';
import { PickCard } from './pick-card.js';
import { Picture } from './picture.js';
import { setUpPointer } from './pointer.js';
import { setUpSceneLoading } from './scene-loading.js';
import { setUpStatusLine, statisticsTable } from './status.js';
import { sunClock } from './sun-clock.js';
import { exposeState } from './test-hooks.js';
import { setUpNotifications, showToast } from './toast.js';
import { setUpToolbar } from './toolbar.js';
import { Viewer } from './viewer.js';
import { ViewHistory } from './view-history.js';
import { viewRows } from './view-section.js';

const link = readLink(location.hash, showToast);
const viewer = new Viewer(link.patch);
const navigation = new Navigation(viewer);
const panel = new Panel(viewer);
const viewport = document.getElementById('viewport');
const overlay = new Overlay(document.getElementById('overlay'), viewer);
const pickCard = new PickCard(viewer, overlay);
const measureTool = new MeasureTool(viewer, overlay, whenNeeded(async () => {
  const { MeasureCard } = await import('./measure-card.js');
  const card = new MeasureCard(viewer, overlay, measureTool);
  return (figureIdx) => card.show(figureIdx);
}));
const viewHistory = new ViewHistory(viewer, measureTool);
const cursorCoordinates = new CursorCoordinates(viewer);
const crosshair = new Crosshair(viewer, overlay);
overlay.add(clipPainter(viewer));
overlay.add(pivotPainter(navigation));

/** Whether the measurements of the link or the scene were shown. */
let areFirstShown = false;
/** The promise of the last pick, as `pickAfter` returns it. */
let lastPick = null;

const helpDialog = document.getElementById('help-dialog');
const showHelp = () => helpDialog.showModal();
const openSaveDialog = whenNeeded(async () => (await import('./save-dialog.js')).setUpSaveDialog(viewer));
const addFiles = whenNeeded(async () => (await import('./added-files.js')).setUpAddedFiles(viewer));
/** The card of profiles, once one was opened. */
let profileCard = null;
const openProfile = whenNeeded(async () => {
  const { ProfileCard } = await import('./profile-card.js');
  profileCard = new ProfileCard(viewer, overlay, measureTool);
  return (figure) => profileCard.open(figure);
});
const openPathCard = whenNeeded(async () => (await import('./path-card.js')).setUpPathCard(viewer, navigation));
const openExportDialog = whenNeeded(async () => (await import('./export-dialog.js')).setUpExportDialog(viewer, viewHistory, measureTool));

setUpNotifications(viewer);
setUpStatusLine(viewer);
setUpLegend(viewer);
setUpAxisCube(viewer, navigation);
makeRoomForAnnotations(viewer);
measureTool.profileOpened.listen(openProfile);
setUpSceneLoading(viewer, measureTool, addFiles);
setUpToolbar(viewer, navigation, viewHistory, { save: openSaveDialog, export: openExportDialog, help: showHelp, crosshair: showCrosshair });
fillPanel();
fillHelp();

setUpPointer(viewport, viewer, navigation, {
  grab: (event, pixel) => grabHandle(viewer, event, pixel),
  hover(pixel, event) {
    measureTool.hover(inCssPixels(pixel));
    const isOnPicture = event.pointerType !== 'touch' && event.buttons === 0 && !event.target.closest('[data-ui]');
    cursorCoordinates.moveTo(isOnPicture ? pixel : null);
  },
  leave: () => cursorCoordinates.moveTo(null),
  click(pixel, event) {
    crosshair.hide();
    return useTool(pixel, event.altKey);
  },
  async doubleClick(pixel) {
    if (MEASURE_TOOLS.includes(viewer.tool)) {
      await finishFigure();
      return;
    }
    const { point, error } = await pickAfter(null, pixel);
    if (error) showToast(error.message);
    else if (point) navigation.centerOn(point.surface);
  },
});

setUpKeyboard(viewer, navigation, viewHistory, {
  help: showHelp,
  enter() {
    if (!crosshair.isMoved) return finishFigure();
    crosshair.markPicked();
    return useTool(crosshair.pixel, false);
  },
  moveCrosshair(direction, isFine) {
    if (viewer.tool === 'navigate') return false;
    crosshair.move(direction, isFine);
    followCrosshair();
    return true;
  },
  escape() {
    if (navigation.turntable_secs || navigation.isFollowing) navigation.stop();
    else if (measureTool.isActive) measureTool.cancel();
    else if (viewer.tool !== 'navigate') viewer.selectTool('navigate');
    else if (pickCard.isOpen) pickCard.close();
    else profileCard?.close();
  },
});

new Picture(document.getElementById('picture'), viewer);
exposeState(viewer);
// The results need the up axis of the data.
viewer.infoChanged.listen(showFirstMeasurements);
viewer.measurementsLoaded.listen((figures) => { measureTool.figures = figures; });
viewer.connect();

/** Returns a function that calls the one that `load` resolves to, whose module is loaded at the first call. */
function whenNeeded(load) {
  let loaded = null;
  return async (...words) => {
    let call;
    try {
      loaded ??= load();
      call = await loaded;
    } catch (error) {
      loaded = null;
      showToast(error.message);
      return;
    }
    call(...words);
  };
}

/** Picks or measures the point behind a pixel, as the tool does; `isPick` picks with any tool. */
async function useTool(pixel, isPick) {
  const { tool } = viewer;
  const { nCancelled } = measureTool;
  const isMeasuring = MEASURE_TOOLS.includes(tool) && !isPick;
  if (!isMeasuring && tool !== 'pick' && !isPick) return;
  lastPick = pickAfter(lastPick, pixel);
  const { point, error } = await lastPick;
  if (viewer.tool !== tool || (isMeasuring && measureTool.nCancelled !== nCancelled)) return;
  if (error) showToast(error.message);
  else if (!point) showToast('There is no point here.');
  else if (isMeasuring) measureTool.add(point.kind === 'point' ? point.position : point.surface);
  else pickCard.show(point);
}

/** Gives the keys to the picture, with a crosshair. */
function showCrosshair() {
  viewport.focus();
  crosshair.show();
  followCrosshair();
}

function followCrosshair() {
  measureTool.hover(inCssPixels(crosshair.pixel));
  cursorCoordinates.moveTo(crosshair.pixel);
}

/** Shows the measurements of the link with which the page was opened, or those of the scene. */
function showFirstMeasurements() {
  if (areFirstShown) return;
  areFirstShown = true;
  measureTool.figures = link.measurements ?? viewer.initialMeasurements;
}

/** Sends a pick at once; resolves to its `{ point }` or `{ error }` after the pick before it, so that points come in the order of the clicks. */
async function pickAfter(previous, pixel) {
  const picked = viewer.pick(pixel).then((point) => ({ point }), (error) => ({ error }));
  await previous;
  return picked;
}

/** Finishes the figure after the answer to the last pick, which adds its last point. */
async function finishFigure() {
  await lastPick;
  measureTool.finish();
}

function inCssPixels({ x, y }) {
  const factor = viewport.clientWidth / viewer.size.width;
  return { x: x * factor, y: y * factor };
}

function fillPanel() {
  const rows = (table) => panel.addRows(table);
  const points = section('Points', false, ...rows(controls.pointControls), ...histogramRows(viewer));
  const surface = section('Surface', true, ...rows(controls.surfaceControls));
  const color = section('Colour', true, ...withPreview(rows(controls.colorControls)));
  viewer.sceneChanged.listen(() => {
    for (const part of [surface, color, points]) part.hidden = !viewer.objects.some((object) => object.points);
  });
  const animation = section('Animation', true, ...animationRows(viewer, () => animation));
  document.getElementById('sections').append(
    animation,
    surface,
    color,
    points,
    objectSection(viewer, panel, navigation),
    section('Sun', true, ...rows(controls.sunControls), sunClock(viewer)),
    section('Sky', true, ...rows(controls.skyControls)),
    section('Picture', false, ...rows(controls.pictureControls)),
    section('Annotations', false, ...rows(controls.annotationControls)),
    section('View', false, ...viewRows(viewer, navigation, openPathCard)),
    section('Clipping', false, ...rows(controls.clipControls)),
    section('Statistics', false, statisticsTable(viewer)));
}

/** Puts the preview of the colour map under its control. */
function withPreview([source, colormap, ...others]) {
  return [source, colormap, colormapPreview(viewer), ...others];
}

function fillHelp() {
  const table = (title, rows) => element('section', {}, element('h3', {}, title), element('dl', { class: 'keys' },
    ...rows.flatMap(([keys, action]) => [element('dt', {}, keys), element('dd', {}, action)])));
  document.getElementById('help-tables').append(table('Mouse and touch', MOUSE_HELP), table('Keyboard', KEY_HELP));
  document.getElementById('help-close').addEventListener('click', () => helpDialog.close());
}
