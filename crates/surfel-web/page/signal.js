// Signals: functions that pass what they are called with to all who listen.

export function signal() {
  const listeners = [];
  const tell = (...values) => listeners.forEach((listener) => listener(...values));
  tell.listen = (listener) => listeners.push(listener);
  return tell;
}
