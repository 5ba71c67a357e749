"""Exception for mistakes in user input."""


class InputError(Exception):
    """A mistake in user input; the message is one line that names the object and the remedy.

    The command line prints it without a traceback and ends with exit code 2.
    """
