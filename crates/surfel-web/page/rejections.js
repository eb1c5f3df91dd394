// Rejections of settings: their text, and the control whose value was rejected.

/** A rejection as one line of text: the key at fault, if there is one, then the reason. */
export function rejectionText({ key, text }) {
  return key ? `${key}: ${text}` : text;
}

/** The words of a key: `sun.azimuth`, `sun-azimuth` and `sun_azimuth` have the same. */
const wordsOf = (key) => key.toLowerCase().split(/[._-]+/);

const endsWith = (words, tail) => tail.length <= words.length && tail.every((word, i) => word === words[words.length - tail.length + i]);

/**
 * The index of the control that shows the setting `key`; -1 if there is none. Each control is `{ key, sceneKey }`.
 *
 * The server may name a setting with or without its section: `light.sun-azimuth`, `sun.azimuth` and `sun-azimuth` all
 * mean the control `sun.azimuth`. Of several controls of one setting the one at `lastChangedIdx` is preferred.
 */
export function findControl(controls, key, lastChangedIdx = -1) {
  const words = wordsOf(key);
  // The number of words that agree, and half a word more for the control's own key.
  const score = (control) => Math.max(...[[control.key, 0.5], [control.sceneKey ?? control.key, 0]].map(([own, extra]) => {
    const ownWords = wordsOf(own);
    if (endsWith(words, ownWords)) return ownWords.length + extra;
    return endsWith(ownWords, words) ? words.length + extra : 0;
  }));
  const scores = controls.map(score);
  const best = Math.max(0, ...scores);
  if (best === 0) return -1;
  return scores[lastChangedIdx] === best ? lastChangedIdx : scores.indexOf(best);
}
