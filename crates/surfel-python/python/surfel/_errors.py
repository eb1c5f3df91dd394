"""Exceptions, with the words of the program's messages."""


class Error(Exception):
    """Base of all exceptions of surfel."""

    __module__ = "surfel"


class InvalidSetting(Error, ValueError):
    """A keyword is unknown, or its value is not valid."""

    __module__ = "surfel"


class InvalidArray(Error, ValueError):
    """An array has a wrong shape or type, or holds what it may not."""

    __module__ = "surfel"


class InvalidScene(Error, ValueError):
    """The data lack what the settings ask for, or nothing can be made of them."""

    __module__ = "surfel"


class InvalidFile(Error, ValueError):
    """A file is damaged, or is of a kind that surfel cannot read or write."""

    __module__ = "surfel"


class MissingFile(Error, FileNotFoundError):
    """There is no such file."""

    __module__ = "surfel"


class InaccessibleFile(Error, OSError):
    """The system does not let a file be read or written."""

    __module__ = "surfel"


class OutOfMemory(Error, MemoryError):
    """The work needs more memory than there is or than `memory_limit` allows."""

    __module__ = "surfel"


class EncoderError(Error, RuntimeError):
    """The program that encodes video is missing or failed."""

    __module__ = "surfel"
