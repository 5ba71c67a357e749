"""Exception for mistakes in user input, and names: their check, and how they are shown."""

import unicodedata

_UNSEEN = {"Cc", "Cf", "Zl", "Zp"}  # categories of Unicode


class InputError(Exception):
    """A mistake in user input; the message is one line that names the object and the remedy.

    The command line prints it without a traceback and ends with exit code 2.

    Attributes:
        field: Option at fault, where the line does not name it; "": it does, or there is none.
    """

    field = ""


def check_name(name: object) -> None:
    """Checks that a name or path is text, which OpenCV and files of text need. InputError where it
    is not.
    """
    try:
        str(name).encode()
    except UnicodeEncodeError:
        raise InputError(f"the name {name} is not UTF-8: rename it") from None


def visible(text: object) -> str:
    r"""Text in which what is not seen is written as \x1b, for example: control characters but for
    tab and line feed, separators of lines, marks that format or reorder, and what is no Unicode.
    """
    encoded = str(text).encode("utf-8", "backslashreplace").decode("utf-8")
    return "".join(
        ascii(each)[1:-1] if unicodedata.category(each) in _UNSEEN and each not in "\t\n" else each
        for each in encoded
    )
