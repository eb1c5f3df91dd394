// Roving focus (WAI-ARIA): of a group of elements one is reached by Tab, the others from there by arrow keys.

const STEPS = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 };

/** Lets the focus rove over the elements that `items()` returns; those that are disabled or hidden are skipped. */
export function setUpRovingFocus(group, items) {
  const usable = () => items().filter((item) => !item.disabled && item.checkVisibility());
  const select = (chosen) => {
    for (const item of items()) item.setAttribute('tabindex', item === chosen ? 0 : -1);
  };
  const update = () => {
    const chosen = items().find((item) => item.getAttribute('tabindex') === '0');
    if (!chosen || chosen.disabled) select(usable()[0]);
  };
  group.addEventListener('focusin', (event) => {
    const item = items().find((one) => one.contains(event.target));
    if (item) select(item);
  });
  group.addEventListener('keydown', (event) => {
    const all = usable();
    const current = all.findIndex((item) => item.contains(event.target));
    // A button that was clicked keeps the focus, but not the keys.
    if (current < 0 || !event.target.matches(':focus-visible')) return;
    const next = { Home: 0, End: all.length - 1 }[event.key] ?? (current + STEPS[event.key] + all.length) % all.length;
    if (Number.isNaN(next)) return;
    all[next].focus();
    event.preventDefault();
    event.stopPropagation();
  });
  update();
  return update;
}
