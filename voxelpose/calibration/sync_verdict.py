"""What a synchronisation is said to be worth, and what helps where it is not sure."""

from collections.abc import Iterator

from calib.signals import SignalOffsets
from voxelpose.calibration.sync import Sync
from voxelpose.findings import Finding

_NAMES = {
    "board": "the board's speed",
    "sound": "sound",
    "silhouettes": "silhouettes moving up and down",
}
_REMEDIES = {
    "geometry": "the cameras agree at no offset: calibrate first, then synchronise, or give --by",
    "board": "carry the board so that all cameras see it, now faster and now slower",
    "sound": "clap where all cameras hear it, or try --by silhouettes",
    "silhouettes": (
        "let somebody squat, jump or raise the arms in view of all cameras, give --seconds and"
        " --most, or clap and try --by sound"
    ),
}


def sync_findings(sync: Sync) -> list[Finding]:
    """What offsets were found from, and how well the cameras agree: bad where they are not sure."""
    agreed = sync.result.agreed
    level, remedy = ("good", "") if agreed else ("bad", _REMEDIES[sync.by])
    return [Finding("Offsets", level, words, remedy=remedy) for words in _words(sync)]


def _words(sync: Sync) -> Iterator[str]:
    result = sync.result
    if not isinstance(result, SignalOffsets):
        yield (
            f"outlines met within {result.before_px:.1f} px as filmed, {result.after_px:.1f} px"
            " with these offsets"
        )
        if not result.agreed:
            yield (
                "the cameras agree at no offset: the offsets above follow from the motion of the"
                " outlines only, and are rough; check the calibration first"
            )
        return
    pairs = f"by {_NAMES[sync.by]}: pairs of cameras correlate by {result.correlation:.2f}"
    if result.disagreement_s == result.disagreement_s:
        pairs += f", and their offsets agree within {1000 * result.disagreement_s:.1f} ms"
    yield pairs
    if result.unlike:
        yield f"{', '.join(result.unlike)} recorded nothing like the others: not synchronised"
    if result.ambiguous:
        yield (
            f"other offsets are nearly as likely for {', '.join(result.ambiguous)}: motion that"
            " repeats itself, or too little of it"
        )
