"""What several commands share."""

from calib.errors import InputError


def frame_range(text: str | None) -> tuple[int | None, int | None] | None:
    """Reads A:B as Python slices have it: 10:50, 10:, :50; a single number is that frame alone.

    Raises:
        InputError: it is none of these.
    """
    if text is None:
        return None
    first, colon, last = text.partition(":")
    try:
        if not colon:
            return int(first), int(first) + 1
        return (int(first) if first else None), (int(last) if last else None)
    except ValueError:
        raise InputError(
            f"--frames {text} is not understood: give first:last, as in 0:100 (the last is not"
            " included)"
        ) from None


def camera_names(text: str | None) -> tuple[str, ...] | None:
    """Reads names with commas between them."""
    if text is None:
        return None
    names = tuple(name.strip() for name in text.split(",") if name.strip())
    if not names:
        raise InputError(
            "--cameras names none: give names with commas between them, as in cam_1,cam_3"
        )
    return names
