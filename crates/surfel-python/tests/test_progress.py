"""The line that shows progress where tqdm is not installed."""

from surfel._progress import _Line


def test_a_short_line_hides_a_longer_one(capsys):
    line = _Line()
    line("a stage with a long name", 1, 3)
    line("short", 1, 0)
    line("short", 2, 0)
    line.close()
    first, second, third = capsys.readouterr().err.rstrip("\n").split("\r")[1:]
    assert first == "a stage with a long name  33 %" and second.strip() == third.strip() == "short"
    assert len(second) == len(first)
