// Signals: functions that pass their arguments to all listeners.

export function signal() {
  const listeners = [];
  const emit = (...values) => listeners.forEach((listener) => listener(...values));
  emit.listen = (listener) => listeners.push(listener);
  return emit;
}
