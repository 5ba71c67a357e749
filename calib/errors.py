"""The one exception that means: the user can mend this."""


class InputError(Exception):
    """A mistake in what the user gave, said in one line that names the thing and the remedy.

    The command line prints it without a traceback and ends with exit code 2.
    """
