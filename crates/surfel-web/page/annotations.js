// Legend, scale bar, north arrow and caption of the picture: the elements over it make room for them.

import { isOrthographic } from './camera.js';

export function makeRoomForAnnotations(viewer) {
  const update = () => {
    const { scene, camera } = viewer;
    if (!scene || !camera) return;
    const shown = {
      'has-legend': Boolean(scene.legend && viewer.legend),
      'has-caption': Boolean(scene.caption),
      'has-scale-bar': isOrthographic(camera) && Boolean(scene.scale_bar),
      'has-north': isOrthographic(camera) && Boolean(scene.north),
    };
    for (const [name, isShown] of Object.entries(shown)) document.body.classList.toggle(name, isShown);
  };
  viewer.sceneChanged.listen(update);
  viewer.cameraChanged.listen(update);
}
