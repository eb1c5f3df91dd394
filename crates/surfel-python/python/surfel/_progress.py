"""Progress on the terminal: a bar of tqdm where it is installed, else a line."""

import sys


def bar():
    """A callback for `progress=True`."""
    try:
        from tqdm.auto import tqdm
    except ImportError:
        return _Line()
    return _Bar(tqdm)


class _Line:
    """One line on stderr, written over and over."""

    def __init__(self):
        self.width = 0

    def __call__(self, stage, done, total):
        share = f"{100 * min(done, total) // total:3} %" if total else ""
        line = f"{stage:>12} {share}"
        # Blanks hide the end of a longer line also where no terminal is told to clear it.
        print(f"\r{line:{self.width}}", end="", file=sys.stderr, flush=True)
        self.width = len(line)

    def close(self):
        print(file=sys.stderr)


class _Bar:
    """A bar for each stage."""

    def __init__(self, tqdm):
        self.tqdm, self.stage, self.bar = tqdm, None, None

    def __call__(self, stage, done, total):
        if stage != self.stage:
            self.close()
            self.stage, self.bar = stage, self.tqdm(desc=stage, total=total or None, leave=False)
        self.bar.update(done - self.bar.n)

    def close(self):
        if self.bar is not None:
            self.bar.close()
