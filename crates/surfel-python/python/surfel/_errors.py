"""Exceptions, with the words of the program's messages."""


class Error(Exception):
    """Base of all exceptions of surfel."""


class InvalidSetting(Error, ValueError):
    """A keyword is unknown, or its value is not valid."""


class InvalidArray(Error, ValueError):
    """An array has a wrong shape or type, or holds what it may not."""


class InvalidScene(Error, ValueError):
    """The data lack what the settings ask for, or nothing can be made of them."""


class InvalidFile(Error, ValueError):
    """A file is damaged, or is of a kind that surfel cannot read or write."""


class MissingFile(Error, FileNotFoundError):
    """There is no such file."""


class InaccessibleFile(Error, OSError):
    """The system does not let a file be read or written."""


class OutOfMemory(Error, MemoryError):
    """The work needs more memory than there is or than `memory_limit` allows."""


class EncoderError(Error, RuntimeError):
    """The program that encodes video is missing or failed."""


# Tracebacks name them as users import them.
for _class in [Error, *Error.__subclasses__()]:
    _class.__module__ = "surfel"
