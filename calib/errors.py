"""Exception for mistakes in user input, and the check of names."""


class InputError(Exception):
    """A mistake in user input; the message is one line that names the object and the remedy.

    The command line prints it without a traceback and ends with exit code 2.
    """


def check_name(name: object) -> None:
    """Checks that a name or path is text, which OpenCV and files of text need. InputError where it
    is not.
    """
    try:
        str(name).encode()
    except UnicodeEncodeError:
        raise InputError(f"the name {name} is not UTF-8: rename it") from None
